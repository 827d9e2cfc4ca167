/** Heading and position of the camera from places that the user has aligned with their real objects. */

import { wrap } from "./angles.js";
import { enu, fromEnu, polar, refract } from "./geodesy.js";

const DEGREE = Math.PI / 180;
// What a drag is good for: a pixel or two, and the pose's own unrest.
const SIGMA = 0.3 * DEGREE;
// Nearer to the zenith a bearing says little of the heading.
const STEEPEST = 75 * DEGREE;
const CLOSEST_BEARINGS = 10 * DEGREE;
// Any receiver tells a position better than this.
const WORST_M = 50;
const ROUNDS = 40;
const DONE_M = 1e-4;

/**
 * @typedef {Object} Alignment  a place, and where its real object is seen by the uncorrected pose
 * @property {string} id  @property {string} name
 * @property {import("./geodesy.js").Position} position  height null: unknown
 * @property {number} bearing  rad, against true north  @property {number} elevation  rad
 */

/**
 * @typedef {Object} Solution
 * @property {number} headingOffset  rad, to add to the pose's headings  @property {number} headingSigma  rad
 * @property {?import("./geodesy.js").Position} position  null where it was not solved for
 * @property {?number[]} moved  ENU m, from where the pose had it  @property {number} positionSigma  m, horizontal
 * @property {{id:string, bearing:number, elevation:number}[]} residuals  rad, measured less computed
 * @property {number} rms  rad, of the bearings  @property {number} spare  observations more than unknowns
 */

/** Nothing could be solved; the message says why and what to do. */
export class SolveError extends Error {}

/**
 * Solve for the heading alone: the mean of what each place tells, weighted by how level it is seen.
 *
 * @param {Alignment[]} alignments  at least one
 * @param {import("./geodesy.js").Position} eye  where the camera is
 * @returns {Solution}
 */
export function solveHeading(alignments, eye) {
  if (alignments.length === 0) throw new SolveError("Align a place first: drag its dot onto the real object.");
  requireLevel(alignments);
  let east = 0;
  let north = 0;
  for (const { bearing, elevation, position } of alignments) {
    const weight = Math.cos(elevation) ** 2;
    const turn = sight(eye, position).bearing - bearing;
    east += weight * Math.sin(turn);
    north += weight * Math.cos(turn);
  }
  const headingOffset = Math.atan2(east, north);
  const weights = alignments.reduce((sum, { elevation }) => sum + Math.cos(elevation) ** 2, 0);
  return {
    headingOffset,
    headingSigma: SIGMA / Math.sqrt(weights),
    position: null,
    moved: null,
    positionSigma: NaN,
    ...judge(alignments, eye, headingOffset, 1),
  };
}

/**
 * Solve for heading and horizontal position, and with three heights that are known for the camera's height as well, by
 * Gauss and Newton on bearings and elevations.
 *
 * @param {Alignment[]} alignments  two of known height, or three
 * @param {import("./geodesy.js").Position} start  where the camera is thought to be
 * @returns {Solution}
 */
export function solveBoth(alignments, start) {
  const heights = alignments.filter(({ position }) => position.height !== null).length;
  if (alignments.length < 3 && heights < 2) {
    throw new SolveError("Heading and position need three aligned places, or two whose heights are known.");
  }
  requireLevel(alignments);
  requireSpread(alignments);
  const unknowns = heights >= 3 ? 4 : 3;
  let offset = solveHeading(alignments, start).headingOffset;
  let moved = [0, 0, 0];
  let normal = null;
  let best = costOf(alignments, start, moved, offset);
  for (let round = 0; round < ROUNDS; round++) {
    normal = normalEquations(alignments, fromEnu(start, moved), offset, unknowns);
    const step = solveLinear(normal.matrix, normal.vector);
    if (step === null) throw new SolveError(badGeometry(alignments, start));
    // A full step may overshoot where the places are near: then half of it.
    let part = 1;
    let next = stepped(moved, step, part);
    let cost = costOf(alignments, start, next, offset + part * step[0]);
    for (; cost > best && part > 1e-3; cost = costOf(alignments, start, next, offset + part * step[0])) {
      part /= 2;
      next = stepped(moved, step, part);
    }
    offset = wrap(offset + part * step[0]);
    moved = next;
    best = Math.min(cost, best);
    if (part * Math.hypot(...step.slice(1)) < DONE_M) break;
  }
  const position = fromEnu(start, moved);
  normal = normalEquations(alignments, position, offset, unknowns);
  const covariance = inverse(normal.matrix);
  const distances = alignments.map((alignment) => sight(position, alignment.position).distance);
  const nearest = Math.min(...distances);
  const positionSigma = covariance === null ? Infinity : SIGMA * Math.sqrt(covariance[1][1] + covariance[2][2]);
  // Beyond a tenth of the nearest distance the equations are no more the straight ones that the sigma is from.
  if (!(positionSigma < Math.min(nearest / 10, WORST_M))) throw new SolveError(badGeometry(alignments, start, positionSigma));
  if (Math.hypot(...moved) > 5 * Math.max(...distances)) throw new SolveError(badGeometry(alignments, start));
  return {
    headingOffset: offset,
    headingSigma: SIGMA * Math.sqrt(covariance[0][0]),
    position,
    moved,
    positionSigma,
    ...judge(alignments, position, offset, unknowns, heights),
  };
}

function sight(eye, position) {
  return polar(refract(enu(eye, { ...position, height: position.height ?? eye.height })));
}

function stepped([e, n, u], step, part) {
  return [e + part * step[1], n + part * step[2], u + part * (step[3] ?? 0)];
}

/** Normal equations of the unknowns: heading offset (rad), east, north and maybe up (m) of the eye. */
function normalEquations(alignments, eye, offset, unknowns) {
  const matrix = Array.from({ length: unknowns }, () => new Array(unknowns).fill(0));
  const vector = new Array(unknowns).fill(0);
  const add = (row, residual, weight) => {
    for (let i = 0; i < unknowns; i++) {
      vector[i] += weight * row[i] * residual;
      for (let j = 0; j < unknowns; j++) matrix[i][j] += weight * row[i] * row[j];
    }
  };
  for (const alignment of alignments) {
    const { bearing, elevation, distance } = sight(eye, alignment.position);
    const level = distance * Math.cos(elevation);
    const sine = Math.sin(bearing);
    const cosine = Math.cos(bearing);
    // Measured = computed - offset. Going east turns a place in the north to the west.
    add(
      [-1, -cosine / level, sine / level, 0],
      wrap(alignment.bearing - (bearing - offset)),
      Math.cos(elevation) ** 2,
    );
    if (alignment.position.height === null) continue;
    const rise = Math.sin(elevation) / distance;
    add([0, rise * sine, rise * cosine, -Math.cos(elevation) / distance], alignment.elevation - elevation, 1);
  }
  return { matrix, vector };
}

function costOf(alignments, start, moved, offset) {
  const eye = fromEnu(start, moved);
  let sum = 0;
  for (const alignment of alignments) {
    const { bearing, elevation } = sight(eye, alignment.position);
    sum += (Math.cos(elevation) * wrap(alignment.bearing - bearing + offset)) ** 2;
    if (alignment.position.height !== null) sum += (alignment.elevation - elevation) ** 2;
  }
  return sum;
}

function judge(alignments, eye, offset, unknowns, heights = 0) {
  let sum = 0;
  const residuals = alignments.map((alignment) => {
    const computed = sight(eye, alignment.position);
    const bearing = wrap(alignment.bearing - computed.bearing + offset);
    sum += bearing * bearing;
    const elevation = alignment.position.height === null ? NaN : alignment.elevation - computed.elevation;
    return { id: alignment.id, bearing, elevation };
  });
  return { residuals, rms: Math.sqrt(sum / alignments.length), spare: alignments.length + heights - unknowns };
}

function requireLevel(alignments) {
  const steep = alignments.find(({ elevation }) => Math.abs(elevation) > STEEPEST);
  if (steep !== undefined) {
    throw new SolveError(`${steep.name} is seen too steeply to tell a heading; remove it, or align a place lower down.`);
  }
}

function requireSpread(alignments) {
  let widest = 0;
  for (const a of alignments) {
    for (const b of alignments) {
      // Two places in opposite directions lie on one line as well.
      widest = Math.max(widest, Math.abs(Math.sin(a.bearing - b.bearing)));
    }
  }
  if (widest < Math.sin(CLOSEST_BEARINGS)) {
    throw new SolveError(
      "The aligned places lie in one line with you: how far along it you are, they cannot tell. Align one to the side.",
    );
  }
}

function badGeometry(alignments, eye, sigma = Infinity) {
  if (alignments.length > 2 && isDangerCircle(alignments, eye)) {
    return (
      "You and the aligned places lie nearly on one circle, and all along it they are seen under the same angles. " +
      "Align a place that is much nearer or much farther."
    );
  }
  const by = Number.isFinite(sigma) ? `only to ${sigma < 10 ? sigma.toFixed(1) : sigma.toFixed(0)} m` : "not at all";
  return `These places tell your position ${by}. Align nearer ones, or ones in other directions; the heading alone can be solved.`;
}

/** Whether the eye is on the circle through the first three places, give or take a tenth of its radius. */
function isDangerCircle(alignments, eye) {
  const [a, b, c] = alignments.map(({ position }) => enu(eye, { ...position, height: eye.height }));
  const d = 2 * (a[0] * (b[1] - c[1]) + b[0] * (c[1] - a[1]) + c[0] * (a[1] - b[1]));
  const [aa, bb, cc] = [a, b, c].map(([x, y]) => x * x + y * y);
  const x = (aa * (b[1] - c[1]) + bb * (c[1] - a[1]) + cc * (a[1] - b[1])) / d;
  const y = (aa * (c[0] - b[0]) + bb * (a[0] - c[0]) + cc * (b[0] - a[0])) / d;
  const radius = Math.hypot(a[0] - x, a[1] - y);
  return Math.abs(Math.hypot(x, y) - radius) < radius / 10;
}

/** Solve a symmetric system by elimination with pivots on its scaled diagonal; null where it is singular. */
export function solveLinear(matrix, vector) {
  const n = vector.length;
  // Metres and radians differ by their thousands: without scaling no threshold would serve both.
  const scale = matrix.map((row, i) => 1 / Math.sqrt(row[i]));
  if (!scale.every(Number.isFinite)) return null;
  const rows = matrix.map((row, i) => [...row.map((value, j) => value * scale[i] * scale[j]), vector[i] * scale[i]]);
  for (let column = 0; column < n; column++) {
    let pivot = column;
    for (let i = column + 1; i < n; i++) if (Math.abs(rows[i][column]) > Math.abs(rows[pivot][column])) pivot = i;
    [rows[column], rows[pivot]] = [rows[pivot], rows[column]];
    if (Math.abs(rows[column][column]) < 1e-9) return null;
    for (let i = 0; i < n; i++) {
      if (i === column) continue;
      const part = rows[i][column] / rows[column][column];
      for (let j = column; j <= n; j++) rows[i][j] -= part * rows[column][j];
    }
  }
  return rows.map((row, i) => (row[n] / row[i]) * scale[i]);
}

function inverse(matrix) {
  const columns = matrix.map((_, i) => solveLinear(matrix, matrix.map((_, j) => (i === j ? 1 : 0))));
  return columns.some((column) => column === null) ? null : columns;
}
