/** What the drawing modules share: colours that read over sky and ground alike, outlined strokes, text and its cache. */

export const RED = "#ff2d2d";
export const GREEN = "#00e5a0";
export const BLUE = "#2f8fff";
export const YELLOW = "#ffd400";
export const WHITE = "#ffffff";
export const QUIET = "#c9d1dc";
export const DARK = "#14080a";
export const PLATE = "rgba(12, 15, 20, 0.86)";
const HALO = "rgba(0, 0, 0, 0.62)";

const FAMILY = 'system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif';
export const font = (px, weight = 400) => `${weight} ${px}px ${FAMILY}`;

// Hebrew, Arabic, Syriac, Thaana, NKo and their presentation forms, against letters of all other scripts.
const FIRST_STRONG = /[\p{L}]/u;
const RIGHT_TO_LEFT = /[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufeff\u{10800}-\u{10fff}\u{1e800}-\u{1efff}]/u;

/** Return "rtl" or "ltr" by the first letter, as dir="auto" does. */
export function directionOf(text) {
  const letter = FIRST_STRONG.exec(text);
  return letter !== null && RIGHT_TO_LEFT.test(letter[0]) ? "rtl" : "ltr";
}

/** Stroke the current path in a colour, with a dark line around it. */
export function strokeOutlined(context, colour, width) {
  context.lineWidth = width + 2.5;
  context.strokeStyle = HALO;
  context.stroke();
  context.lineWidth = width;
  context.strokeStyle = colour;
  context.stroke();
}

/** A filled plate with round corners. */
export function plate(context, x, y, width, height, radius = 7) {
  context.fillStyle = PLATE;
  context.beginPath();
  context.roundRect(x, y, width, height, radius);
  context.fill();
}

/** Fit a canvas to a size in CSS pixels and return the scale to device pixels. */
export function fit(canvas, width, height) {
  // Beyond 2 device pixels a CSS pixel nothing here looks sharper, but each costs to fill.
  const scale = Math.min(window.devicePixelRatio || 1, 2);
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  return scale;
}

/** Metres as a person says them. */
export function formatDistance(metres) {
  if (metres < 1000) return `${metres.toFixed(0)} m`;
  const kilometres = metres / 1000;
  return `${kilometres.toFixed(kilometres < 10 ? 2 : kilometres < 100 ? 1 : 0)} km`;
}

// Reads on a label that is drawn with a quarter of the bright sky in it.
const DETAIL = "#dde3ea";
const LABEL_HEIGHT = 22;
const MOST_LABELS = 400;
// Of the screen's width; a phone is to show more than one name.
const LONGEST_NAME = 0.3;
const LONGEST_NAME_PX = 190;

/** Labels drawn once and kept: measuring and drawing text anew each frame would be most of the frame's time. */
export class LabelCache {
  constructor() {
    this._kept = new Map();
    this.scale = 1;
  }

  /** Forget all: the resolution or the width of the screen changed. */
  clear(scale, screenWidth) {
    this._kept.clear();
    this.scale = scale;
    this._longest = Math.min(LONGEST_NAME_PX, screenWidth * LONGEST_NAME);
  }

  /** @returns {{canvas: HTMLCanvasElement, width: number, height: number}} */
  get(name, detail, isTarget) {
    const key = `${isTarget ? 1 : 0}\n${name}\n${detail}`;
    let label = this._kept.get(key);
    if (label === undefined) {
      if (this._kept.size >= MOST_LABELS) this._kept.clear();
      label = drawLabel(name, detail, isTarget, this.scale, this._longest);
      this._kept.set(key, label);
    }
    return label;
  }
}

function drawLabel(name, detail, isTarget, scale, longest) {
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("2d");
  const nameFont = font(13, 600);
  const detailFont = font(12);
  context.font = nameFont;
  const shown = shortened(context, name, longest);
  const nameWidth = Math.ceil(context.measureText(shown).width);
  context.font = detailFont;
  const detailWidth = Math.ceil(context.measureText(detail).width);
  const gap = detail === "" ? 0 : 7;
  const width = 9 + nameWidth + gap + detailWidth + 9;
  canvas.width = Math.ceil(width * scale);
  canvas.height = Math.ceil(LABEL_HEIGHT * scale);
  context.scale(scale, scale);
  context.fillStyle = isTarget ? "#b3141a" : "rgba(12, 15, 20, 0.8)";
  context.beginPath();
  context.roundRect(0, 0, width, LABEL_HEIGHT, 5);
  context.fill();
  if (!isTarget) {
    context.strokeStyle = RED;
    context.lineWidth = 1;
    context.beginPath();
    context.roundRect(0.5, 0.5, width - 1, LABEL_HEIGHT - 1, 4.5);
    context.stroke();
  }
  context.textBaseline = "middle";
  context.textAlign = "left";
  const direction = directionOf(name);
  // A name that runs right to left comes first at the right, and its distance follows at the left.
  const nameX = direction === "rtl" ? 9 + detailWidth + gap : 9;
  const detailX = direction === "rtl" ? 9 : 9 + nameWidth + gap;
  context.direction = direction;
  context.font = nameFont;
  context.fillStyle = WHITE;
  context.fillText(shown, nameX, LABEL_HEIGHT / 2 + 0.5);
  context.direction = "ltr";
  context.font = detailFont;
  context.fillStyle = isTarget ? WHITE : DETAIL;
  context.fillText(detail, detailX, LABEL_HEIGHT / 2 + 0.5);
  return { canvas, width, height: LABEL_HEIGHT };
}

function shortened(context, name, longest) {
  if (context.measureText(name).width <= longest) return name;
  const letters = Array.from(name);
  while (letters.length > 1 && context.measureText(`${letters.join("")}…`).width > longest) letters.pop();
  return `${letters.join("").trimEnd()}…`;
}
