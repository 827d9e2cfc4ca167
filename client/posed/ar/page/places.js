/** The places around the observer, in metres east, north and up, nearest first. */

import { enu, refract } from "./geodesy.js";

// Moving by less, places shift as a whole; by more, they are worked out anew. 200 m turn the vertical by 0.002 degrees.
const WORK_OUT_ANEW_M = 200;
// What has no height is level with the eye: so much higher or lower, and it no longer looks it.
const LEVEL_WITHIN_M = 0.1;
const GROUND_NEARBY_M = 3000;
const EYE_M = 1.7;

/**
 * @typedef {Object} Place
 * @property {string} id
 * @property {string} name
 * @property {"point"|"line"|"polygon"} kind
 * @property {string} note
 * @property {?string} color
 * @property {number[]} anchor  ENU m: what is labelled and targeted, as it appears (refraction is in)
 * @property {?number} ground  up of the ground under a point, m
 * @property {Float64Array[]} rings  ENU m, x y z after each other; rings of polygons are closed; none for points
 * @property {number} distance  m, from the origin to the anchor
 * @property {{latitude:number, longitude:number, height:?number}} position  of the anchor; null: no height is known
 */

export class Places {
  constructor() {
    this.viewpoint = null;
    /** @type {Place[]} */
    this.all = [];
    /** Up of the ground around the observer, m. */
    this.ground = -EYE_M;
    this.origin = null;
    this._raw = [];
    /** Whether some place has no height. */
    this._hasLevel = false;
  }

  /** Take what /places.json holds. */
  load(json) {
    this.viewpoint = json.viewpoint;
    this._raw = json.places;
    this._hasLevel = json.places.some(lacksHeight);
    this.origin = null;
  }

  get isEmpty() {
    return this._raw.length === 0;
  }

  byId(id) {
    return this.all.find((place) => place.id === id) ?? null;
  }

  /**
   * Return where the observer is, ENU m from the origin; works the places out anew if they have moved far from it.
   *
   * @param {?import("./geodesy.js").Position} observer  null: nobody knows, and so there are no places around
   */
  moveTo(observer) {
    if (observer === null) {
      if (this.origin !== null) this.all = [];
      this.origin = null;
      return [0, 0, 0];
    }
    if (this.origin !== null) {
      const shift = this.fromOrigin(observer);
      const isLevel = !this._hasLevel || Math.abs(shift[2]) <= LEVEL_WITHIN_M;
      if (isLevel && Math.hypot(shift[0], shift[1], shift[2]) < WORK_OUT_ANEW_M) return shift;
    }
    this._workOut(observer);
    return [0, 0, 0];
  }

  /** Return where a position lies, ENU m from the origin. */
  fromOrigin(position) {
    return enu(this.origin, position);
  }

  _workOut(origin) {
    this.origin = origin;
    // What has no height is drawn level with the observer.
    const seen = ([longitude, latitude, height]) =>
      refract(enu(origin, { latitude, longitude, height: height ?? origin.height }));
    this.all = this._raw.map((raw) => workedOut(raw, seen));
    this.all.sort((a, b) => a.distance - b.distance);
    const grounds = this.all
      .filter((place) => place.ground !== null && place.distance < GROUND_NEARBY_M)
      .map((place) => place.ground)
      .sort((a, b) => a - b);
    const middle = grounds.length ? grounds[grounds.length >> 1] : -EYE_M;
    this.ground = Math.min(middle, -EYE_M);
  }
}

function workedOut(raw, seen) {
  const rings = ringsOf(raw).map((ring) => Float64Array.from(ring.flatMap(seen)));
  const position = positionOf(raw);
  const anchor = seen(position);
  const [longitude, latitude, height] = position;
  return {
    id: raw.id,
    name: raw.name,
    kind: raw.kind,
    note: raw.note ?? "",
    color: raw.color,
    anchor,
    ground: raw.ground == null ? null : seen([longitude, latitude, raw.ground])[2],
    rings,
    distance: Math.hypot(anchor[0], anchor[1], anchor[2]),
    position: { latitude, longitude, height },
  };
}

function lacksHeight({ kind, coordinates }) {
  const positions = kind === "polygon" ? coordinates.flat() : coordinates;
  return positions.some(([, , height]) => height === null);
}

function ringsOf(raw) {
  if (raw.kind === "line") return [raw.coordinates];
  if (raw.kind === "polygon") return raw.coordinates;
  return [];
}

/** A point itself, the middle vertex of a line, the middle of a polygon's outer ring. */
function positionOf(raw) {
  if (raw.kind === "point") return raw.coordinates[0];
  if (raw.kind === "line") return raw.coordinates[raw.coordinates.length >> 1];
  const corners = raw.coordinates[0].slice(0, -1);
  const mean = (of) => corners.reduce((sum, corner) => sum + of(corner), 0) / corners.length;
  // The short way from the first corner: across 180 degrees the numbers' own mean lies on the earth's other side.
  const [first] = corners[0];
  const longitude = within180(first + mean((corner) => within180(corner[0] - first)));
  const isKnown = corners.every((corner) => corner[2] !== null);
  return [longitude, mean((corner) => corner[1]), isKnown ? mean((corner) => corner[2]) : null];
}

function within180(degrees) {
  return degrees - 360 * Math.round(degrees / 360);
}
