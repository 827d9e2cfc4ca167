/** The drawn world: sky, horizon, ground and the real objects standing on it, as the true orientation sees them. */

import { font, GREEN } from "./draw.js";

const DEGREE = Math.PI / 180;
// Far enough for every screen, near enough for exact gradients.
const BEYOND = 6000;
const MARK_RADIUS = 7.5;
const FAR_M = 4000;
const NAMES = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];
const STONE = "#d6cfc0";
const STONE_SHADE = "#a69d8c";
const HILL = "#7d8b97";
const LINE = "#e9dfc4";
const AREA = "rgba(206, 214, 170, 0.42)";

export class World {
  /** @param {import("./projector.js").Projector} projector  aimed by the truth */
  constructor(projector) {
    this._to = projector;
    this._sky = null;
    this._heightOfGradients = 0;
    this._bars = makeBearings();
  }

  /**
   * @param {CanvasRenderingContext2D} context  @param {number} scale  device pixels a CSS pixel
   * @param {import("./places.js").Places} places
   */
  draw(context, scale, places) {
    const to = this._to;
    const { width, height, f } = to.camera;
    this._makeGradients(context, Math.max(width, height));
    this._intoHorizon(context, scale, width, height, f);
    context.fillStyle = this._sky;
    context.fillRect(-BEYOND, -5 * BEYOND, 2 * BEYOND, 5 * BEYOND);
    context.setTransform(scale, 0, 0, scale, 0, 0);
    this._drawGraticule(context);
    this._drawHills(context, places);
    this._intoHorizon(context, scale, width, height, f);
    context.fillStyle = this._ground;
    context.fillRect(-BEYOND, 0, 2 * BEYOND, 5 * BEYOND);
    context.fillStyle = "rgba(255, 255, 255, 0.55)";
    context.fillRect(-BEYOND, -0.75, 2 * BEYOND, 1.5);
    this._drawGrid(context, scale, places.ground);
    context.setTransform(scale, 0, 0, scale, 0, 0);
    this._drawShapes(context, places);
    this._drawMasts(context, places);
    this._drawBearings(context, scale);
  }

  /** Mark each object where it truly is: what the overlay's dot should lie in. */
  drawMarks(context, scale, places) {
    const to = this._to;
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.beginPath();
    for (const { anchor } of places.all) {
      if (!to.point(anchor[0], anchor[1], anchor[2]) || !to.isOnScreen(MARK_RADIUS)) continue;
      context.moveTo(to.x + MARK_RADIUS, to.y);
      context.arc(to.x, to.y, MARK_RADIUS, 0, 2 * Math.PI);
    }
    context.lineWidth = 5;
    context.strokeStyle = "rgba(4, 30, 22, 0.8)";
    context.stroke();
    context.lineWidth = 3;
    context.strokeStyle = GREEN;
    context.stroke();
  }

  /** Have y = 0 along the horizon, and y up to the ground: the screen turned and shifted, so that widths stay. */
  _intoHorizon(context, scale, width, height, f) {
    const to = this._to;
    const cosine = -to.upY * scale;
    const sine = to.upX * scale;
    const below = Math.max(-2 * BEYOND, Math.min(2 * BEYOND, (f * to.pitchSine) / Math.max(to.pitchCosine, 1e-6)));
    const x = (width / 2) * scale - sine * below;
    const y = (height / 2) * scale + cosine * below;
    context.setTransform(cosine, sine, -sine, cosine, x, y);
  }

  _makeGradients(context, longer) {
    if (this._heightOfGradients === longer) return;
    this._heightOfGradients = longer;
    this._sky = context.createLinearGradient(0, 0, 0, -longer);
    this._sky.addColorStop(0, "#cddbe7");
    this._sky.addColorStop(0.12, "#b3cbe0");
    this._sky.addColorStop(0.5, "#7fa8cf");
    this._sky.addColorStop(1, "#5c8cbd");
    this._ground = context.createLinearGradient(0, 0, 0, longer * 0.8);
    this._ground.addColorStop(0, "#a3aa97");
    this._ground.addColorStop(0.06, "#878f76");
    this._ground.addColorStop(0.4, "#666e54");
    this._ground.addColorStop(1, "#4d543e");
    this._grid = context.createLinearGradient(0, 0, 0, longer * 0.5);
    this._grid.addColorStop(0, "rgba(255, 255, 255, 0)");
    this._grid.addColorStop(0.05, "rgba(255, 255, 255, 0.1)");
    this._grid.addColorStop(1, "rgba(255, 255, 255, 0.5)");
  }

  /** Circles of equal elevation and of bearing, so that a turn shows in an empty sky as well. */
  _drawGraticule(context) {
    const to = this._to;
    context.beginPath();
    for (let elevation = 15; elevation <= 75; elevation += 15) {
      const up = Math.sin(elevation * DEGREE);
      const out = Math.cos(elevation * DEGREE);
      let isDown = false;
      for (let i = 0; i <= 72; i += 2) {
        const isAhead = to.direction(out * this._bars[i % 72].e, out * this._bars[i % 72].n, up);
        const isNear = isAhead && to.isOnScreen(500);
        if (isNear && isDown) context.lineTo(to.x, to.y);
        else if (isNear) context.moveTo(to.x, to.y);
        isDown = isNear;
      }
    }
    for (let bar = 0; bar < 72; bar += 6) {
      const { e, n } = this._bars[bar];
      let isDown = false;
      for (let elevation = 0; elevation <= 90; elevation += 7.5) {
        const out = Math.cos(elevation * DEGREE);
        const isNear = to.direction(out * e, out * n, Math.sin(elevation * DEGREE)) && to.isOnScreen(500);
        if (isNear && isDown) context.lineTo(to.x, to.y);
        else if (isNear) context.moveTo(to.x, to.y);
        isDown = isNear;
      }
    }
    context.lineWidth = 1;
    context.strokeStyle = "rgba(255, 255, 255, 0.26)";
    context.stroke();
  }

  /** What is far stands behind the ground, for its foot is below the horizon: a hill as wide as such heights are. */
  _drawHills(context, places) {
    const to = this._to;
    context.fillStyle = HILL;
    for (let i = places.all.length - 1; i >= 0; i--) {
      const { anchor, ground, kind, distance } = places.all[i];
      if (distance < FAR_M) break;
      if (kind !== "point" || ground === null || anchor[2] <= ground) continue;
      const spread = (2.6 * (anchor[2] - ground)) / distance;
      context.globalAlpha = distance > 40_000 ? 0.45 : 0.75;
      context.beginPath();
      to.segment(
        context, anchor[0] - spread * anchor[1], anchor[1] + spread * anchor[0], ground, anchor[0], anchor[1], anchor[2],
      );
      const ahead = to.segment(
        context, anchor[0], anchor[1], anchor[2], anchor[0] + spread * anchor[1], anchor[1] - spread * anchor[0], ground,
        true,
      );
      if (ahead) context.fill();
    }
    context.globalAlpha = 1;
  }

  _drawGrid(context, scale, ground) {
    const to = this._to;
    const spacing = 10 ** Math.ceil(Math.log10(-ground * 3));
    for (let step = spacing, width = 1.2; step <= 10 * spacing; step *= 10, width = 1.6) {
      const east = Math.round(to.eye[0] / step) * step;
      const north = Math.round(to.eye[1] / step) * step;
      const level = to.eye[2] + ground;
      const reach = 10 * step;
      context.setTransform(scale, 0, 0, scale, 0, 0);
      context.beginPath();
      for (let off = -reach; off <= reach; off += step) {
        to.segment(context, east + off, north - reach, level, east + off, north + reach, level);
        to.segment(context, east - reach, north + off, level, east + reach, north + off, level);
      }
      const { width: w, height: h, f } = to.camera;
      this._intoHorizon(context, scale, w, h, f);
      context.lineWidth = width;
      context.strokeStyle = this._grid;
      context.stroke();
    }
  }

  _drawShapes(context, places) {
    for (let i = places.all.length - 1; i >= 0; i--) {
      const { kind, rings } = places.all[i];
      if (kind === "point") continue;
      context.beginPath();
      for (const ring of rings) this._to.trace(context, ring);
      if (kind === "polygon") {
        context.fillStyle = AREA;
        context.fill("evenodd");
      }
      context.lineWidth = 3;
      context.strokeStyle = LINE;
      context.stroke();
    }
  }

  /** A shaft from the ground to the height, two sides of it, thinner than it is high and never invisible. */
  _drawMasts(context, places) {
    const to = this._to;
    const f = to.camera.f;
    for (let i = places.all.length - 1; i >= 0; i--) {
      const { anchor, ground, kind, distance, color } = places.all[i];
      if (kind !== "point" || ground === null || distance >= FAR_M) continue;
      if (!to.point(anchor[0], anchor[1], ground)) continue;
      const x = to.x;
      const y = to.y;
      const wide = Math.min(Math.max((anchor[2] - ground) / 4, 0.6), 14);
      const half = Math.max((0.5 * f * wide) / to.depth, 1.5);
      if (!to.point(anchor[0], anchor[1], anchor[2])) continue;
      if (!to.isOnScreen(half) && !(x > -half && x < to.camera.width + half)) continue;
      const top = half * 0.8;
      // Across the shaft, along the screen: its own axis turned by a right angle.
      const length = Math.hypot(to.x - x, to.y - y) || 1;
      const ax = (to.y - y) / length;
      const ay = (x - to.x) / length;
      context.fillStyle = color ?? STONE;
      context.beginPath();
      context.moveTo(x - ax * half, y - ay * half);
      context.lineTo(to.x - ax * top, to.y - ay * top);
      context.lineTo(to.x + ax * top, to.y + ay * top);
      context.lineTo(x + ax * half, y + ay * half);
      context.closePath();
      context.fill();
      context.fillStyle = color === null ? STONE_SHADE : "rgba(0, 0, 0, 0.28)";
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(to.x, to.y);
      context.lineTo(to.x - ax * top, to.y - ay * top);
      context.lineTo(x - ax * half, y - ay * half);
      context.closePath();
      context.fill();
    }
  }

  /** Marks along the horizon: each 5 degrees a tick, each 15 its bearing, each 45 its name. */
  _drawBearings(context, scale) {
    const to = this._to;
    const cosine = -to.upY * scale;
    const sine = to.upX * scale;
    for (let i = 0; i < 72; i++) {
      const bar = this._bars[i];
      if (!to.direction(bar.e, bar.n, 0) || !to.isOnScreen(30)) continue;
      context.setTransform(cosine, sine, -sine, cosine, to.x * scale, to.y * scale);
      context.fillStyle = "rgba(255, 255, 255, 0.9)";
      context.fillRect(-0.75, 0, 1.5, i % 3 === 0 ? 9 : 5);
      if (i % 3 !== 0) continue;
      const { canvas, width, height } = this._textOf(bar, scale);
      context.drawImage(canvas, -width / 2, 10, width, height);
    }
    context.setTransform(scale, 0, 0, scale, 0, 0);
  }

  /** The text of a bearing, drawn once: stroked text costs more than all else in a frame. */
  _textOf(bar, scale) {
    if (bar.scale === scale) return bar.picture;
    const canvas = document.createElement("canvas");
    const width = TEXT_WIDTH;
    const height = TEXT_HEIGHT;
    canvas.width = width * scale;
    canvas.height = height * scale;
    const context = canvas.getContext("2d");
    context.scale(scale, scale);
    context.textAlign = "center";
    context.textBaseline = "top";
    context.font = bar.isNamed ? NAME_FONT : BEARING_FONT;
    context.lineWidth = 3;
    context.strokeStyle = "rgba(20, 26, 16, 0.6)";
    context.strokeText(bar.text, width / 2, 2);
    context.fillStyle = "rgba(255, 255, 255, 0.9)";
    context.fillText(bar.text, width / 2, 2);
    bar.picture = { canvas, width, height };
    bar.scale = scale;
    return bar.picture;
  }
}

const TEXT_WIDTH = 44;
const TEXT_HEIGHT = 28;
const NAME_FONT = font(19, 700);
const BEARING_FONT = font(12);

function makeBearings() {
  const bars = [];
  for (let i = 0; i < 72; i++) {
    const bearing = i * 5 * DEGREE;
    const isNamed = i % 9 === 0;
    const text = isNamed ? NAMES[i / 9] : `${i * 5}`;
    bars.push({ e: Math.sin(bearing), n: Math.cos(bearing), isNamed, text, scale: 0, picture: null });
  }
  return bars;
}
