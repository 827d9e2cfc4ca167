/** WGS 84 positions and where they lie from one another: metres east, north and up. */

const DEGREE = Math.PI / 180;
const A = 6378137;
const F = 1 / 298.257223563;
const E2 = F * (2 - F);
const MEAN_RADIUS = 6371000;
// Curvature of a ray against the earth's, in air as it is by day (Gauss).
const REFRACTION = 0.13;

/** @typedef {{latitude:number, longitude:number, height:number}} Position  degrees, metres above the ellipsoid */

/** Earth-centred, earth-fixed coordinates of a position, m. */
export function toEcef({ latitude, longitude, height }) {
  const sine = Math.sin(latitude * DEGREE);
  const cosine = Math.cos(latitude * DEGREE);
  const n = A / Math.sqrt(1 - E2 * sine * sine);
  return [
    (n + height) * cosine * Math.cos(longitude * DEGREE),
    (n + height) * cosine * Math.sin(longitude * DEGREE),
    (n * (1 - E2) + height) * sine,
  ];
}

/** The position of earth-centred, earth-fixed coordinates, by Bowring's iteration: to 1e-9 degrees near the ground. */
export function fromEcef([x, y, z]) {
  const p = Math.hypot(x, y);
  const b = A * (1 - F);
  let beta = Math.atan2(z, (1 - F) * p);
  let latitude = 0;
  for (let i = 0; i < 3; i++) {
    latitude = Math.atan2(
      z + ((E2 * A * A) / b) * Math.sin(beta) ** 3,
      p - E2 * A * Math.cos(beta) ** 3,
    );
    beta = Math.atan((1 - F) * Math.tan(latitude));
  }
  const sine = Math.sin(latitude);
  const cosine = Math.cos(latitude);
  const n = A / Math.sqrt(1 - E2 * sine * sine);
  // The sum of both parts holds at the poles as well, where either quotient alone would not.
  const height = p * cosine + z * sine - n * (1 - E2 * sine * sine);
  return { latitude: latitude / DEGREE, longitude: Math.atan2(y, x) / DEGREE, height };
}

/** Metres east, north and up of a position from an origin: a straight line, so the earth's curvature is in. */
export function enu(origin, position) {
  const from = toEcef(origin);
  const to = toEcef(position);
  const m = axesAt(origin);
  const x = to[0] - from[0];
  const y = to[1] - from[1];
  const z = to[2] - from[2];
  return [m[0] * x + m[1] * y, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z];
}

/** The position that lies so many metres east, north and up of an origin. */
export function fromEnu(origin, [e, n, u]) {
  const [x, y, z] = toEcef(origin);
  const m = axesAt(origin);
  return fromEcef([x + m[0] * e + m[3] * n + m[6] * u, y + m[1] * e + m[4] * n + m[7] * u, z + m[5] * n + m[8] * u]);
}

/** East, north and up at a position, in earth-centred coordinates, after each other. */
function axesAt({ latitude, longitude }) {
  const sinLat = Math.sin(latitude * DEGREE);
  const cosLat = Math.cos(latitude * DEGREE);
  const sinLon = Math.sin(longitude * DEGREE);
  const cosLon = Math.cos(longitude * DEGREE);
  return [-sinLon, cosLon, 0, -sinLat * cosLon, -sinLat * sinLon, cosLat, cosLat * cosLon, cosLat * sinLon, sinLat];
}

/** Where something (ENU m) appears to be: the air bends its light by 0.13 of the earth's curvature. */
export function refract([e, n, u]) {
  return [e, n, u + (REFRACTION * (e * e + n * n)) / (2 * MEAN_RADIUS)];
}

/** Bearing (rad from north, clockwise, 0 to 2 pi), elevation (rad) and distance (m) of a vector (ENU m). */
export function polar([e, n, u]) {
  const bearing = Math.atan2(e, n);
  const level = Math.hypot(e, n);
  return {
    bearing: bearing < 0 ? bearing + 2 * Math.PI : bearing,
    elevation: Math.atan2(u, level),
    distance: Math.hypot(level, u),
  };
}
