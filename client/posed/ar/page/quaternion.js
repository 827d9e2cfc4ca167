/** Unit quaternions (x, y, z, w), as Android's rotation vector orders them; an orientation leads from device to world. */

/** The rotation b, then the rotation a. */
export function multiply(a, b) {
  const [ax, ay, az, aw] = a;
  const [bx, by, bz, bw] = b;
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

export function conjugate([x, y, z, w]) {
  return [-x, -y, -z, w];
}

/** A turn about the zenith by an angle in rad, anticlockwise as seen from above. */
export function aboutUp(angle) {
  return [0, 0, Math.sin(angle / 2), Math.cos(angle / 2)];
}

/** The orientation after so many seconds at an angular rate (rad/s, device axes). */
export function extrapolate(q, [x, y, z], seconds) {
  const rate = Math.hypot(x, y, z);
  if (rate === 0) return q;
  const sine = Math.sin((rate * seconds) / 2) / rate;
  return multiply(q, [x * sine, y * sine, z * sine, Math.cos((rate * seconds) / 2)]);
}

/** A vector turned by a quaternion. */
export function rotate([x, y, z, w], [a, b, c]) {
  const tx = 2 * (y * c - z * b);
  const ty = 2 * (z * a - x * c);
  const tz = 2 * (x * b - y * a);
  return [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx];
}
