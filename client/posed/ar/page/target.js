/** Which place is the target: the one held by a tap, else the one under the blue cross. */

import { wrap } from "./angles.js";
import { polar } from "./geodesy.js";

// So far from the middle of the screen a place still counts as under the cross.
const REACH_PX = 42;
const REACH_LINE_PX = 16;
// What is the target stays it until another is nearer by so much: else two close ones would flicker.
const STAY = 0.7;

export class Target {
  constructor() {
    /** @type {?import("./places.js").Place} */
    this.place = null;
    this.isHeld = false;
  }

  hold(place) {
    this.place = place;
    this.isHeld = place !== null;
  }

  /** Take what is under the cross, unless a target is held. */
  aim(places, drawn, projector) {
    if (this.isHeld) {
      // The places may have been worked out anew.
      if (!places.all.includes(this.place)) this.hold(places.byId(this.place.id));
      return;
    }
    const { width, height } = projector.camera;
    let best = null;
    let least = REACH_PX;
    for (let i = 0; i < places.all.length; i++) {
      const place = places.all[i];
      let distance = drawn[i].visible ? Math.hypot(drawn[i].x - width / 2, drawn[i].y - height / 2) : Infinity;
      if (place.kind !== "point") distance = Math.min(distance, outlineDistance(place, projector));
      if (place.id === this.place?.id) distance *= STAY;
      if (distance < least) {
        least = distance;
        best = place;
      }
    }
    this.place = best;
  }

  /** Hold the next place by bearing, to the right (1) or to the left (-1) of the target or of `heading`. */
  step(places, eye, heading, direction) {
    // Those of equal bearing stay in the order of `all`: each has one before it and one after it.
    const sorted = [...places.all].sort((a, b) => bearingOf(a, eye) - bearingOf(b, eye));
    const at = sorted.findIndex(({ id }) => id === this.place?.id);
    const left = at === -1 ? sorted.filter((place) => bearingOf(place, eye) < wrap(heading)).length - 1 : at - 1;
    const right = at === -1 ? left + 1 : at + 1;
    const next = direction < 0 ? left : right;
    if (sorted.length > 0) this.hold(sorted.at(next % sorted.length));
  }
}

/** Bearing, elevation (rad; as it appears, true north) and distance (m) of a place from the eye. */
export function sightOf({ anchor }, eye) {
  return polar([anchor[0] - eye[0], anchor[1] - eye[1], anchor[2] - eye[2]]);
}

function bearingOf({ anchor }, eye) {
  return Math.atan2(anchor[0] - eye[0], anchor[1] - eye[1]);
}

/** How far an outline passes from the middle of the screen, as far as a point would have to be to rank the same. */
function outlineDistance({ rings }, projector) {
  const x = projector.camera.width / 2;
  const y = projector.camera.height / 2;
  let least = Infinity;
  for (const ring of rings) {
    let wasAhead = false;
    let fromX = 0;
    let fromY = 0;
    for (let i = 0; i < ring.length; i += 3) {
      const isAhead = projector.point(ring[i], ring[i + 1], ring[i + 2]);
      if (isAhead && wasAhead) {
        least = Math.min(least, distanceToSegment(x, y, fromX, fromY, projector.x, projector.y));
      }
      wasAhead = isAhead;
      fromX = projector.x;
      fromY = projector.y;
    }
  }
  return least < REACH_LINE_PX ? least * (REACH_PX / REACH_LINE_PX) : Infinity;
}

function distanceToSegment(x, y, x1, y1, x2, y2) {
  const dx = x2 - x1;
  const dy = y2 - y1;
  const length = dx * dx + dy * dy;
  const part = length === 0 ? 0 : Math.min(Math.max(((x - x1) * dx + (y - y1) * dy) / length, 0), 1);
  return Math.hypot(x1 + part * dx - x, y1 + part * dy - y);
}
