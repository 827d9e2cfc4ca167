/** The top view of the target, north up: the user, the field of view, the places around, a scale bar. */

import { DARK, QUIET, RED, WHITE, fit, font } from "./draw.js";

const MARGIN = 26;
const NARROWEST_M = 40;
const WITHOUT_TARGET_M = 600;
const BAR_PX = 52;
const TITLE_FONT = font(11);

export class Thumbnail {
  constructor(canvas) {
    this._canvas = canvas;
    this._context = canvas.getContext("2d");
    this._drawn = "";
    this._drawnPlaces = null;
  }

  resize() {
    this._width = this._canvas.clientWidth;
    this._scale = fit(this._canvas, this._width, this._width);
    this._drawn = "";
  }

  /**
   * @param {import("./places.js").Places} places
   * @param {?import("./places.js").Place} target
   * @param {number[]} eye  ENU m
   * @param {number} heading  rad, true  @param {number} halfView  rad, half of what the screen shows from left to right
   */
  draw(places, target, eye, heading, halfView) {
    // A degree is less than a pixel here: between them there is nothing new to draw.
    const key = `${target?.id} ${Math.round(heading * 57.3)} ${Math.round(halfView * 57.3)} ${eye[0].toFixed(1)} ${eye[1].toFixed(1)}`;
    if (key === this._drawn && places.all === this._drawnPlaces) return;
    this._drawn = key;
    this._drawnPlaces = places.all;
    const context = this._context;
    const size = this._width;
    const east = target === null ? 0 : target.anchor[0] - eye[0];
    const north = target === null ? 0 : target.anchor[1] - eye[1];
    const span = target === null ? WITHOUT_TARGET_M : Math.max(Math.abs(east), Math.abs(north), NARROWEST_M);
    const perMetre = (size - 2 * MARGIN) / span;
    // User and target at equal distances from the middle.
    this._x = size / 2 - (east / 2) * perMetre;
    this._y = size / 2 + (north / 2) * perMetre;
    this._perMetre = perMetre;
    this._eye = eye;

    context.setTransform(this._scale, 0, 0, this._scale, 0, 0);
    context.fillStyle = "#1a222b";
    context.fillRect(0, 0, size, size);
    this._drawWedge(heading, halfView, size);
    this._drawPlaces(places, target);
    this._drawUser(heading);
    this._drawNorth(size);
    this._drawBar(span / (size - 2 * MARGIN), size);
  }

  _drawWedge(heading, halfView, size) {
    const context = this._context;
    context.beginPath();
    context.moveTo(this._x, this._y);
    context.arc(this._x, this._y, 1.5 * size, heading - halfView - Math.PI / 2, heading + halfView - Math.PI / 2);
    context.closePath();
    context.fillStyle = "rgba(77, 163, 255, 0.22)";
    context.fill();
    context.lineWidth = 1;
    context.strokeStyle = "rgba(124, 188, 255, 0.7)";
    context.stroke();
  }

  _drawPlaces(places, target) {
    const context = this._context;
    for (const place of places.all) {
      context.beginPath();
      for (const ring of place.rings) {
        context.moveTo(this._toX(ring[0]), this._toY(ring[1]));
        for (let i = 3; i < ring.length; i += 3) context.lineTo(this._toX(ring[i]), this._toY(ring[i + 1]));
      }
      context.lineWidth = place === target ? 2.5 : 1.25;
      context.strokeStyle = place === target ? RED : "#b98a8a";
      context.stroke();
      if (place === target) continue;
      context.beginPath();
      context.arc(this._toX(place.anchor[0]), this._toY(place.anchor[1]), 2.5, 0, 2 * Math.PI);
      context.fillStyle = QUIET;
      context.fill();
    }
    if (target === null) return;
    const x = this._toX(target.anchor[0]);
    const y = this._toY(target.anchor[1]);
    context.beginPath();
    context.moveTo(this._x, this._y);
    context.lineTo(x, y);
    context.lineWidth = 1;
    context.strokeStyle = RED;
    context.stroke();
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    context.fillStyle = RED;
    context.fill();
    context.lineWidth = 1.5;
    context.strokeStyle = WHITE;
    context.stroke();
  }

  _drawUser(heading) {
    const context = this._context;
    context.save();
    context.translate(this._x, this._y);
    context.rotate(heading);
    context.beginPath();
    context.moveTo(0, -9);
    context.lineTo(6, 7);
    context.lineTo(0, 3.5);
    context.lineTo(-6, 7);
    context.closePath();
    context.restore();
    context.fillStyle = "#4da3ff";
    context.fill();
    context.lineWidth = 1.5;
    context.strokeStyle = WHITE;
    context.stroke();
  }

  _drawNorth(size) {
    const context = this._context;
    context.beginPath();
    context.moveTo(size - 14, 7);
    context.lineTo(size - 9.5, 18);
    context.lineTo(size - 18.5, 18);
    context.closePath();
    context.fillStyle = WHITE;
    context.fill();
    context.font = TITLE_FONT;
    context.textAlign = "center";
    context.textBaseline = "top";
    context.fillText("N", size - 14, 20);
  }

  _drawBar(metresPerPixel, size) {
    const context = this._context;
    const metres = roundedDown(BAR_PX * metresPerPixel);
    const width = metres / metresPerPixel;
    context.beginPath();
    context.moveTo(9, size - 13);
    context.lineTo(9, size - 9);
    context.lineTo(9 + width, size - 9);
    context.lineTo(9 + width, size - 13);
    context.lineWidth = 3.5;
    context.strokeStyle = DARK;
    context.stroke();
    context.lineWidth = 1.5;
    context.strokeStyle = WHITE;
    context.stroke();
    context.font = TITLE_FONT;
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.lineWidth = 3;
    context.strokeStyle = "#1a222b";
    const length = metres < 1000 ? `${metres} m` : `${metres / 1000} km`;
    context.strokeText(length, 9, size - 15);
    context.fillStyle = WHITE;
    context.fillText(length, 9, size - 15);
  }

  _toX(east) {
    return this._x + (east - this._eye[0]) * this._perMetre;
  }

  _toY(north) {
    return this._y - (north - this._eye[1]) * this._perMetre;
  }
}

/** The largest of 1, 2, 5 times a power of ten that is not larger. */
function roundedDown(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  const lead = value / power;
  return power * (lead >= 5 ? 5 : lead >= 2 ? 2 : 1);
}
