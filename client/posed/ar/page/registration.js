/** How far the overlay is from the truth: the angle and the pixels between where each of them puts the same thing. */

const byPose = new Float64Array(3);
const byTruth = new Float64Array(3);

/**
 * The error at the target, or where the camera truly points if there is none on the screen.
 *
 * @param {import("./projector.js").Projector} overlay  aimed by the fused pose
 * @param {import("./projector.js").Projector} world  aimed by the truth
 * @param {?import("./places.js").Place} target
 * @param {{deg:number, px:number}} into  px is NaN if either is not ahead of the camera
 */
export function measure(overlay, world, target, into) {
  if (target !== null && isOnScreen(world, target.anchor)) {
    const [e, n, u] = target.anchor;
    overlay.inCamera(e, n, u, byPose);
    world.inCamera(e, n, u, byTruth);
  } else {
    const [e, n, u] = world.axes.subarray(6, 9);
    overlay.inCamera(overlay.eye[0] + e, overlay.eye[1] + n, overlay.eye[2] + u, byPose);
    byTruth.fill(0);
    byTruth[2] = 1;
  }
  const [a, b, c] = byPose;
  const [x, y, z] = byTruth;
  const sine = Math.hypot(b * z - c * y, c * x - a * z, a * y - b * x);
  into.deg = (Math.atan2(sine, a * x + b * y + c * z) * 180) / Math.PI;
  const f = world.camera.f;
  into.px = c > 0 && z > 0 ? f * Math.hypot(a / c - x / z, b / c - y / z) : NaN;
  return into;
}

function isOnScreen(world, [e, n, u]) {
  return world.point(e, n, u) && world.isOnScreen();
}
