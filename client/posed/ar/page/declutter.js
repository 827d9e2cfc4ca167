/** Labels that never overlap: each in the nearest free place over or under its dot, and there it stays. */

// Distance of a label's near edge from its dot, in labels' heights, by preference: above before below.
const SLOTS = [0, 1, -1, 2, -2, 3, -3, 4, 5, 6];
const GAP = 4;
// What was hidden shows again only where so much more is free: else a pose that trembles would make it flicker.
const ROOM_TO_RETURN = 10;
const NEAR_EDGE = 22;

/**
 * @typedef {Object} Label
 * @property {string} id  @property {number} priority  the higher goes first
 * @property {number} x @property {number} y  of its top left corner; given as first choice, set to where it goes
 * @property {number} width @property {number} height
 * @property {number} anchorX @property {number} anchorY  the dot
 * @property {boolean} hidden  set: there is no room for it
 */

export class Declutter {
  constructor() {
    /** By id: the slot of the last time, and null if it was hidden then. */
    this._before = new Map();
    this._now = new Map();
    this._order = [];
    this._placed = [];
  }

  /**
   * Place labels, by priority, each where it was before if that will do; else rather not over others' dots.
   *
   * @param {Label[]} labels
   * @param {{left:number, top:number, right:number, bottom:number}} free
   * @param {{x:number, y:number, width:number, height:number}} cross  to be left free
   */
  place(labels, free, cross) {
    this._order.length = 0;
    this._placed.length = 0;
    this._placed.push(cross);
    this._now.clear();
    for (const label of labels) this._order.push(label);
    this._order.sort(byPriority);
    for (const label of this._order) {
      const slot = this._settle(label, free);
      label.hidden = slot === null;
      if (slot !== null) this._placed.push(label);
      this._now.set(label.id, slot);
    }
    [this._before, this._now] = [this._now, this._before];
  }

  _settle(label, free) {
    const before = this._before.get(label.id);
    if (before != null && this._fits(label, before, free, GAP)) return before;
    // One that is new or moves needs no more room than others do; one that was hidden does.
    const gap = before === null ? GAP + ROOM_TO_RETURN : GAP;
    for (const slot of SLOTS) if (this._fits(label, slot, free, gap) && !this._coversDot(label)) return slot;
    for (const slot of SLOTS) if (this._fits(label, slot, free, gap)) return slot;
    return null;
  }

  _coversDot({ x, y, width, height }) {
    for (const { anchorX, anchorY } of this._order) {
      if (anchorX > x - GAP && anchorX < x + width + GAP && anchorY > y - GAP && anchorY < y + height + GAP) return true;
    }
    return false;
  }

  _fits(label, slot, free, gap) {
    const { width, height } = label;
    label.x = clamp(label.anchorX - width / 2, free.left, free.right - width);
    const away = NEAR_EDGE + Math.abs(slot) * (height + GAP + 1);
    label.y = slot >= 0 ? label.anchorY - away - height : label.anchorY + away - height - GAP;
    if (label.y < free.top || label.y + height > free.bottom) return false;
    for (const other of this._placed) {
      if (
        label.x < other.x + other.width + gap && other.x < label.x + width + gap &&
        label.y < other.y + other.height + gap && other.y < label.y + height + gap
      ) {
        return false;
      }
    }
    return true;
  }
}

function byPriority(a, b) {
  return b.priority - a.priority;
}

function clamp(value, low, high) {
  return Math.min(Math.max(value, low), Math.max(low, high));
}
