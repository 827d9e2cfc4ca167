/** The places as the fused pose sees them: outlines, dots, labels that do not overlap, arrows to what is outside. */

import { Declutter } from "./declutter.js";
import { DARK, LabelCache, RED, WHITE, formatDistance, strokeOutlined } from "./draw.js";

const DOT_RADIUS = 5;
// Labels nearest first; what is farther shows its dot only.
const MOST_LABELS = 48;
const ARROWS = 3;
const HIT_RADIUS = 22;
// From the edge of the free space to the middle of an arrow, and the places along the edge it may be moved to.
const EDGE = 18;
const EDGE_SLOTS = 7;
const CROSS_PX = 30;
// Fainter, the text of a label over a bright sky would be below a contrast of 4.5.
const FAINTEST_LABEL = 0.75;
const FAINTEST_LINE = 0.5;

/**
 * @typedef {Object} Drawn
 * @property {string} id @property {string} name
 * @property {number} x @property {number} y  CSS pixels, of the dot
 * @property {boolean} visible  ahead of the camera and on the screen
 */

export class Overlay {
  /**
   * @param {CanvasRenderingContext2D} context
   * @param {import("./projector.js").Projector} projector  aimed by the corrected pose
   */
  constructor(context, projector) {
    this._context = context;
    this._to = projector;
    this._labels = new LabelCache();
    this._declutter = new Declutter();
    this._inCamera = new Float64Array(3);
    /** Where the last drawing put each place, nearest first. @type {Drawn[]} */
    this.drawn = [];
    this._candidates = [];
    this._takenAtEdge = [];
    this._cross = { x: 0, y: 0, width: 2 * CROSS_PX, height: 2 * CROSS_PX };
  }

  resize(scale, screenWidth) {
    this._labels.clear(scale, screenWidth);
  }

  /**
   * @param {import("./places.js").Places} places
   * @param {?import("./places.js").Place} target
   * @param {{left:number, top:number, right:number, bottom:number}} free  of instruments, CSS pixels
   */
  draw(places, target, free) {
    this._cross.x = this._to.camera.width / 2 - CROSS_PX;
    this._cross.y = this._to.camera.height / 2 - CROSS_PX;
    this._project(places);
    this._drawShapes(places, target);
    this._drawLabels(places, target, free);
    this._drawDots(target);
    this._drawArrows(places, target, free);
  }

  /** The place drawn at a point, by its label or its dot; or null. */
  at(x, y) {
    for (const label of this._candidates) {
      if (label.hidden) continue;
      if (x >= label.x && x <= label.x + label.width && y >= label.y && y <= label.y + label.height) return label.id;
    }
    return this.dotAt(x, y, HIT_RADIUS);
  }

  /** The place whose dot is nearest to a point within `radius` pixels; or null. */
  dotAt(x, y, radius) {
    let nearest = null;
    let least = radius;
    for (const dot of this.drawn) {
      const distance = dot.visible ? Math.hypot(dot.x - x, dot.y - y) : Infinity;
      if (distance < least) {
        least = distance;
        nearest = dot.id;
      }
    }
    return nearest;
  }

  _project(places) {
    const to = this._to;
    const all = places.all;
    if (this.drawn.length !== all.length || all.some((place, i) => place.id !== this.drawn[i].id)) {
      this.drawn = all.map(({ id, name }) => ({ id, name, x: 0, y: 0, visible: false }));
    }
    for (let i = 0; i < all.length; i++) {
      const { anchor } = all[i];
      const dot = this.drawn[i];
      const isAhead = to.point(anchor[0], anchor[1], anchor[2]);
      dot.x = isAhead ? to.x : NaN;
      dot.y = isAhead ? to.y : NaN;
      dot.visible = isAhead && to.isOnScreen();
    }
  }

  _drawShapes(places, target) {
    const context = this._context;
    for (let i = places.all.length - 1; i >= 0; i--) {
      const place = places.all[i];
      if (place.kind === "point") continue;
      context.beginPath();
      for (const ring of place.rings) this._to.trace(context, ring);
      context.globalAlpha = fade(place.distance, FAINTEST_LINE);
      strokeOutlined(context, RED, place === target ? 3 : 2);
    }
    context.globalAlpha = 1;
  }

  _drawDots(target) {
    const context = this._context;
    context.beginPath();
    for (const dot of this.drawn) {
      if (!dot.visible) continue;
      context.moveTo(dot.x + DOT_RADIUS + 1, dot.y);
      context.arc(dot.x, dot.y, DOT_RADIUS + 1, 0, 2 * Math.PI);
    }
    context.fillStyle = DARK;
    context.fill();
    context.beginPath();
    for (const dot of this.drawn) {
      if (!dot.visible) continue;
      context.moveTo(dot.x + DOT_RADIUS, dot.y);
      context.arc(dot.x, dot.y, DOT_RADIUS, 0, 2 * Math.PI);
    }
    context.fillStyle = RED;
    context.fill();
    const held = target === null ? undefined : this.drawn.find((dot) => dot.id === target.id);
    if (held?.visible) {
      context.beginPath();
      context.arc(held.x, held.y, 13, 0, 2 * Math.PI);
      strokeOutlined(context, WHITE, 1.75);
    }
  }

  _drawLabels(places, target, free) {
    const context = this._context;
    const labels = this._candidates;
    labels.length = 0;
    for (let i = 0; i < this.drawn.length && labels.length < MOST_LABELS; i++) {
      const dot = this.drawn[i];
      const place = places.all[i];
      if (!dot.visible || !isInside(dot, free)) continue;
      const picture = this._labels.get(place.name, formatDistance(this._distance(place)), place === target);
      labels.push({
        id: place.id,
        x: 0,
        y: 0,
        width: picture.width,
        height: picture.height,
        priority: place === target ? Infinity : -place.distance,
        anchorX: dot.x,
        anchorY: dot.y,
        alpha: place === target ? 1 : fade(place.distance, FAINTEST_LABEL),
        picture: picture.canvas,
        hidden: false,
      });
    }
    this._declutter.place(labels, free, this._cross);
    context.beginPath();
    for (const label of labels) {
      if (label.hidden) continue;
      const isAbove = label.y + label.height <= label.anchorY;
      const x = Math.min(Math.max(label.anchorX, label.x + 6), label.x + label.width - 6);
      context.moveTo(x, isAbove ? label.y + label.height : label.y);
      context.lineTo(label.anchorX, label.anchorY);
    }
    strokeOutlined(context, RED, 1.5);
    for (let i = labels.length - 1; i >= 0; i--) {
      const label = labels[i];
      if (label.hidden) continue;
      context.globalAlpha = label.alpha;
      context.drawImage(label.picture, label.x, label.y, label.width, label.height);
    }
    context.globalAlpha = 1;
  }

  _distance({ anchor }) {
    const { eye } = this._to;
    return Math.hypot(anchor[0] - eye[0], anchor[1] - eye[1], anchor[2] - eye[2]);
  }

  /** Arrows at the edge: to the target wherever it is, to the nearest others that are not behind. */
  _drawArrows(places, target, free) {
    this._takenAtEdge.length = 0;
    const held = target === null ? undefined : this.drawn.find((dot) => dot.id === target.id);
    if (held !== undefined && !(held.visible && isInside(held, free))) this._drawArrow(target, true, free);
    let left = ARROWS;
    for (let i = 0; i < this.drawn.length && left > 0; i++) {
      const place = places.all[i];
      if (this.drawn[i].visible || place === target) continue;
      if (this._drawArrow(place, false, free)) left--;
    }
  }

  _drawArrow({ anchor, name }, isTarget, free) {
    const [right, up, ahead] = this._to.inCamera(anchor[0], anchor[1], anchor[2], this._inCamera);
    const aside = Math.hypot(right, up);
    if (aside === 0 || (ahead <= 0 && !isTarget)) return false;
    const { width, height } = this._to.camera;
    const dx = right / aside;
    const dy = -up / aside;
    const toSide = ((dx > 0 ? free.right - width / 2 : width / 2 - free.left) - EDGE) / Math.max(Math.abs(dx), 1e-9);
    const toEnd = ((dy > 0 ? free.bottom - height / 2 : height / 2 - free.top) - EDGE) / Math.max(Math.abs(dy), 1e-9);
    const reach = Math.max(Math.min(toSide, toEnd), 0);
    const x = width / 2 + dx * reach;
    const y = height / 2 + dy * reach;
    const away = isTarget ? `${Math.round((Math.atan2(aside, ahead) * 180) / Math.PI)}°` : "";
    const picture = this._labels.get(name, away, isTarget);
    const box = this._freeBox(x, y, dx, dy, toSide < toEnd, picture, free);
    if (box === null) return false;
    this._context.drawImage(picture.canvas, box.x, box.y, picture.width, picture.height);
    this._drawArrowHead(x + box.movedX, y + box.movedY, Math.atan2(dy, dx), isTarget);
    return true;
  }

  /** Room for an arrow's name inwards of it; where another is, the arrow moves along the edge to free room. */
  _freeBox(x, y, dx, dy, isAtSide, { width, height }, free) {
    const inwardsX = x - (isAtSide ? Math.sign(dx) * (EDGE + width / 2) : 0) - width / 2;
    const inwardsY = y - (isAtSide ? 0 : Math.sign(dy) * (EDGE + height / 2)) - height / 2;
    for (let slot = 0; slot < EDGE_SLOTS; slot++) {
      const steps = (slot % 2 ? -1 : 1) * Math.ceil(slot / 2);
      const movedX = isAtSide ? 0 : steps * (width + 10);
      const movedY = isAtSide ? steps * (height + 6) : 0;
      const box = { x: inwardsX + movedX, y: inwardsY + movedY, width, height, movedX, movedY };
      if (box.y < free.top || box.y + height > free.bottom) continue;
      if (x + movedX < free.left || x + movedX > free.right) continue;
      // At the top and the foot a name may be longer than half the way to the corner.
      box.x = clamp(box.x, free.left + 4, free.right - width - 4);
      if (overlap(box, this._cross)) continue;
      if (this._takenAtEdge.some((other) => overlap(box, other))) continue;
      if (this._candidates.some((label) => !label.hidden && overlap(box, label))) continue;
      if (this.drawn.some((dot) => dot.visible && covers(box, dot))) continue;
      this._takenAtEdge.push(box);
      return box;
    }
    return null;
  }

  _drawArrowHead(x, y, angle, isTarget) {
    const context = this._context;
    context.save();
    context.translate(x, y);
    context.rotate(angle);
    context.beginPath();
    context.moveTo(12, 0);
    context.lineTo(-6, -8);
    context.lineTo(-2, 0);
    context.lineTo(-6, 8);
    context.closePath();
    context.restore();
    context.lineWidth = 2.5;
    context.strokeStyle = DARK;
    context.stroke();
    context.fillStyle = isTarget ? WHITE : RED;
    context.fill();
  }
}

function overlap(a, b) {
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}

function covers(box, { x, y }) {
  const reach = DOT_RADIUS + 3;
  return x > box.x - reach && x < box.x + box.width + reach && y > box.y - reach && y < box.y + box.height + reach;
}

function clamp(value, low, high) {
  return Math.min(Math.max(value, low), Math.max(low, high));
}

/** Opacity by distance: full to 300 m, the faintest from 50 km on. */
function fade(metres, faintest) {
  const decades = Math.log10(Math.max(metres, 300) / 300) / Math.log10(50_000 / 300);
  return 1 - (1 - faintest) * Math.min(decades, 1);
}

function isInside({ x, y }, { left, top, right, bottom }) {
  return x >= left && x <= right && y >= top && y <= bottom;
}
