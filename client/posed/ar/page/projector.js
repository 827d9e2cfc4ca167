/** Projection of many points a frame: the camera's axes worked out once, results left in fields, nothing allocated. */

// A line is cut where it passes the eye closer than this part of its farther end's distance: what is nearer to the
// camera's plane would land a hundred screens away, where strokes lose their precision.
const NEAR = 0.02;

export class Projector {
  constructor() {
    /** Result of the last point(): screen pixels, and metres ahead of the camera (not positive: not on the screen). */
    this.x = 0;
    this.y = 0;
    this.depth = 0;
    /** Right, up and ahead of the camera in ENU, after each other. */
    this.axes = new Float64Array(9);
    this._ends = new Float64Array(6);
  }

  /**
   * @param {import("./camera.js").Camera} camera
   * @param {number[]} q  device to world (ENU, true north)
   * @param {number[]} eye  where the camera is, ENU metres from the origin of what will be projected
   */
  aim(camera, q, eye) {
    this.camera = camera;
    this.eye = eye;
    this._middleX = camera.width / 2;
    this._middleY = camera.height / 2;
    const f = (this._f = camera.f);
    const ahead = camera.ray(q, this._middleX, this._middleY);
    const right = camera.ray(q, this._middleX + f, this._middleY);
    const up = camera.ray(q, this._middleX, this._middleY - f);
    const m = this.axes;
    for (let i = 0; i < 3; i++) {
      // A ray one focal length off the middle is 45 degrees off the axis.
      m[i] = Math.SQRT2 * right[i] - ahead[i];
      m[3 + i] = Math.SQRT2 * up[i] - ahead[i];
      m[6 + i] = ahead[i];
    }
    /** Direction of the zenith as the screen shows it (x right, y down, unit), and sine and cosine of the pitch. */
    this.pitchSine = m[8];
    this.pitchCosine = Math.hypot(m[2], m[5]);
    this.upX = this.pitchCosine > 1e-9 ? m[2] / this.pitchCosine : 0;
    this.upY = this.pitchCosine > 1e-9 ? -m[5] / this.pitchCosine : -1;
  }

  /** Project a point (ENU metres from the origin); true if it is ahead of the camera. */
  point(e, n, u) {
    return this.direction(e - this.eye[0], n - this.eye[1], u - this.eye[2]);
  }

  /** Project something infinitely far away in a direction (ENU); true if it is ahead of the camera. */
  direction(e, n, u) {
    const m = this.axes;
    this.depth = m[6] * e + m[7] * n + m[8] * u;
    if (this.depth <= 0) return false;
    const scale = this._f / this.depth;
    this.x = this._middleX + scale * (m[0] * e + m[1] * n + m[2] * u);
    this.y = this._middleY - scale * (m[3] * e + m[4] * n + m[5] * u);
    return true;
  }

  /** Whether the last point is on the screen, give or take a margin in pixels. */
  isOnScreen(margin = 0) {
    return (
      this.depth > 0 &&
      this.x >= -margin &&
      this.y >= -margin &&
      this.x <= this.camera.width + margin &&
      this.y <= this.camera.height + margin
    );
  }

  /** Where a point is seen from the camera: metres to the right of its axis, above it and ahead, into `into`. */
  inCamera(e, n, u, into) {
    const m = this.axes;
    e -= this.eye[0];
    n -= this.eye[1];
    u -= this.eye[2];
    into[0] = m[0] * e + m[1] * n + m[2] * u;
    into[1] = m[3] * e + m[4] * n + m[5] * u;
    into[2] = m[6] * e + m[7] * n + m[8] * u;
    return into;
  }

  /** Add a line through points (x, y, z after each other) to the canvas's path, as far as it is ahead. */
  trace(context, points) {
    let isDown = false;
    for (let i = 3; i < points.length; i += 3) {
      isDown = this.segment(
        context, points[i - 3], points[i - 2], points[i - 1], points[i], points[i + 1], points[i + 2], isDown,
      );
    }
  }

  /** Add a segment to the path, going on from the last one if `isDown`; returns whether the next may go on. */
  segment(context, e1, n1, u1, e2, n2, u2, isDown = false) {
    const m = this.axes;
    const s = this._ends;
    for (let end = 0; end < 2; end++) {
      const e = (end ? e2 : e1) - this.eye[0];
      const n = (end ? n2 : n1) - this.eye[1];
      const u = (end ? u2 : u1) - this.eye[2];
      s[3 * end] = m[0] * e + m[1] * n + m[2] * u;
      s[3 * end + 1] = m[3] * e + m[4] * n + m[5] * u;
      s[3 * end + 2] = m[6] * e + m[7] * n + m[8] * u;
    }
    const near = NEAR * Math.max(Math.hypot(s[0], s[1], s[2]), Math.hypot(s[3], s[4], s[5]));
    const isFirstCut = s[2] < near;
    const isSecondCut = s[5] < near;
    if (isFirstCut && isSecondCut) return false;
    if (isFirstCut || isSecondCut) {
      const part = (near - s[2]) / (s[5] - s[2]);
      const cut = isFirstCut ? 0 : 3;
      const a = s[0] + part * (s[3] - s[0]);
      const b = s[1] + part * (s[4] - s[1]);
      s[cut] = a;
      s[cut + 1] = b;
      s[cut + 2] = near;
    }
    const f = this._f;
    if (!isDown || isFirstCut) context.moveTo(this._middleX + (f * s[0]) / s[2], this._middleY - (f * s[1]) / s[2]);
    context.lineTo(this._middleX + (f * s[3]) / s[5], this._middleY - (f * s[4]) / s[5]);
    return !isSecondCut;
  }
}
