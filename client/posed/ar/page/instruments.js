/** Crosses, heading tape, roll and pitch scales: what the fused pose says, drawn as instruments. */

import { format, formatBearing } from "./angles.js";
import { BLUE, QUIET, WHITE, YELLOW, font, plate, strokeOutlined } from "./draw.js";

const DEGREE = Math.PI / 180;
const TAPE_HEIGHT = 36;
const TAPE_TOP = 10;
const WIDEST_TAPE = 540;
const VALUE_HEIGHT = 24;
const TOP_OF_ROLL = TAPE_TOP + TAPE_HEIGHT + VALUE_HEIGHT + 20;
const ROLL_HEIGHT = 52;
const MARGIN = 8;
// On its side a phone has the thumbnail where the pitch scale would be.
const LOW = 560;
const ROLL_RADIUS = 150;
const ROLL_REACH = 40;
const PITCH_PER_DEGREE = 5;
const PITCH_WIDTH = 46;
const NAMES = { 0: "N", 45: "NE", 90: "E", 135: "SE", 180: "S", 225: "SW", 270: "W", 315: "NW" };

// Ticks of the tape in the circle's own parts: deg and DMS share theirs.
const TAPES = {
  deg: { circle: 360, small: 5, labelled: 10 },
  dms: { circle: 360, small: 5, labelled: 10 },
  gon: { circle: 400, small: 5, labelled: 10 },
};

export class Instruments {
  constructor(context) {
    this._context = context;
  }

  /** What the instruments at the edges of a screen leave free: {left, top, right, bottom}, CSS pixels. */
  static freeOf(width, height) {
    const pitch = PITCH_WIDTH + 26;
    const isLow = height < LOW;
    return {
      left: isLow ? MARGIN : pitch,
      top: TOP_OF_ROLL + ROLL_HEIGHT,
      right: width - (isLow ? pitch : MARGIN),
      bottom: height - MARGIN,
    };
  }

  /**
   * @param {{heading:number, pitch:number, roll:number}} attitude  rad, of the camera, true north
   * @param {{angle:number, source:string}} declination  rad, east positive
   * @param {import("./camera.js").Camera} camera
   * @param {import("./projector.js").Projector} projector  aimed by the same pose
   */
  draw(attitude, declination, camera, projector, unit) {
    this._drawTape(attitude.heading, declination, camera.width, unit);
    this._drawRoll(attitude.roll, camera.width);
    this._drawPitch(attitude.pitch, camera);
    this._drawInertialCross(camera, projector);
    this._drawCross(camera);
  }

  _drawTape(heading, declination, screenWidth, unit) {
    const context = this._context;
    const width = Math.min(WIDEST_TAPE, screenWidth - 16);
    const left = (screenWidth - width) / 2;
    const middle = screenWidth / 2;
    const { circle, small, labelled } = TAPES[unit];
    const perPart = (width / 72) * (360 / circle);
    const shown = (heading / (2 * Math.PI)) * circle;

    plate(context, left, TAPE_TOP, width, TAPE_HEIGHT);
    context.save();
    context.beginPath();
    context.rect(left + 4, TAPE_TOP, width - 8, TAPE_HEIGHT);
    context.clip();
    context.textAlign = "center";
    context.textBaseline = "middle";
    const reach = width / 2 / perPart + labelled;
    for (let part = Math.ceil((shown - reach) / small) * small; part <= shown + reach; part += small) {
      const x = middle + (part - shown) * perPart;
      const onCircle = ((part % circle) + circle) % circle;
      const isLabelled = onCircle % labelled === 0;
      context.fillStyle = isLabelled ? WHITE : QUIET;
      context.fillRect(x - 0.75, TAPE_TOP + TAPE_HEIGHT - (isLabelled ? 10 : 6), 1.5, isLabelled ? 10 : 6);
      const name = NAMES[(onCircle * 360) / circle];
      if (!isLabelled && name === undefined) continue;
      // NW stands between 310 and 320: where it is narrow, in their place.
      const isCrowded = perPart * small < 32 && name === undefined;
      if (isCrowded && (NAMES[onCircle - small] ?? NAMES[onCircle + small]) !== undefined && circle === 360) continue;
      context.fillStyle = WHITE;
      context.font = name === undefined ? TICK_FONT : NAME_FONT;
      context.fillText(name ?? `${onCircle}`, x, TAPE_TOP + 13);
    }
    this._drawMagneticNorth(heading, declination.angle, middle, (perPart * circle) / (2 * Math.PI));
    context.restore();

    context.beginPath();
    context.moveTo(middle, TAPE_TOP + TAPE_HEIGHT - 11);
    context.lineTo(middle - 7, TAPE_TOP + TAPE_HEIGHT + 1);
    context.lineTo(middle + 7, TAPE_TOP + TAPE_HEIGHT + 1);
    context.closePath();
    context.fillStyle = BLUE;
    context.fill();
    this._drawHeadings(heading, declination, middle, unit);
  }

  /** A hollow wedge at magnetic north, when the tape shows it. */
  _drawMagneticNorth(heading, declination, middle, perRadian) {
    const context = this._context;
    const x = middle + Math.atan2(Math.sin(declination - heading), Math.cos(declination - heading)) * perRadian;
    context.beginPath();
    context.moveTo(x, TAPE_TOP + TAPE_HEIGHT - 1);
    context.lineTo(x - 5, TAPE_TOP + TAPE_HEIGHT - 11);
    context.lineTo(x + 5, TAPE_TOP + TAPE_HEIGHT - 11);
    context.closePath();
    context.lineWidth = 1.75;
    context.strokeStyle = YELLOW;
    context.stroke();
  }

  _drawHeadings(heading, { angle, source }, middle, unit) {
    const context = this._context;
    const digits = unit === "dms" ? 0 : 1;
    const truth = `${formatBearing(heading, unit, digits)} true`;
    const magnetic = `${formatBearing(heading - angle, unit, digits)} magnetic`;
    const top = TAPE_TOP + TAPE_HEIGHT + 3;
    context.font = VALUE_FONT;
    const truthWidth = context.measureText(truth).width;
    context.font = SMALL_FONT;
    const magneticWidth = context.measureText(magnetic).width;
    const declination = `declination ${format(Math.abs(angle), unit, digits)} ${angle < 0 ? "W" : "E"} (${source})`;
    const declinationWidth = context.measureText(declination).width;
    const width = Math.max(truthWidth + 14 + magneticWidth, declinationWidth) + 22;
    // Whole steps, so that the plate does not tremble with its figures.
    const held = Math.ceil(width / 24) * 24;
    plate(context, middle - held / 2, top, held, VALUE_HEIGHT + 16);
    context.textAlign = "left";
    context.textBaseline = "middle";
    const left = middle - (truthWidth + 14 + magneticWidth) / 2;
    context.font = VALUE_FONT;
    context.fillStyle = WHITE;
    context.fillText(truth, left, top + 13);
    context.font = SMALL_FONT;
    context.fillStyle = YELLOW;
    context.fillText(magnetic, left + truthWidth + 14, top + 13.5);
    context.textAlign = "center";
    context.fillStyle = QUIET;
    context.fillText(declination, middle, top + 30);
  }

  /** An arc under the headings: its pointer leans as the camera does. */
  _drawRoll(roll, screenWidth) {
    const context = this._context;
    const x = screenWidth / 2;
    const top = TOP_OF_ROLL + 14;
    const y = top + ROLL_RADIUS;
    const from = -Math.PI / 2 - ROLL_REACH * DEGREE;
    const to = -Math.PI / 2 + ROLL_REACH * DEGREE;
    context.beginPath();
    context.arc(x, y, ROLL_RADIUS, from, to);
    for (let mark = -40; mark <= 40; mark += 10) {
      const sine = Math.sin(mark * DEGREE);
      const cosine = Math.cos(mark * DEGREE);
      const outer = ROLL_RADIUS + (mark % 20 === 0 ? 9 : 6);
      context.moveTo(x + sine * ROLL_RADIUS, y - cosine * ROLL_RADIUS);
      context.lineTo(x + sine * outer, y - cosine * outer);
    }
    strokeOutlined(context, WHITE, 1.5);
    const shown = Math.min(Math.max(roll, -ROLL_REACH * DEGREE), ROLL_REACH * DEGREE);
    context.save();
    context.translate(x, y);
    context.rotate(shown);
    context.beginPath();
    context.moveTo(0, -ROLL_RADIUS + 1);
    context.lineTo(-6, -ROLL_RADIUS + 13);
    context.lineTo(6, -ROLL_RADIUS + 13);
    context.closePath();
    context.restore();
    context.fillStyle = YELLOW;
    context.lineWidth = 2;
    context.strokeStyle = "rgba(0, 0, 0, 0.6)";
    context.stroke();
    context.fill();
    this._label(`${signed(roll / DEGREE)}°`, x, y - ROLL_RADIUS + 25);
  }

  _drawPitch(pitch, camera) {
    const context = this._context;
    const isLow = camera.height < LOW;
    const half = Math.min(110, camera.height * 0.125);
    const x = isLow ? camera.width - PITCH_WIDTH - 10 : 10;
    const y = camera.height / 2;
    const shown = pitch / DEGREE;
    plate(context, x, y - half, PITCH_WIDTH, 2 * half);
    context.save();
    context.beginPath();
    context.rect(x, y - half + 2, PITCH_WIDTH, 2 * half - 4);
    context.clip();
    context.font = TICK_FONT;
    context.textAlign = "right";
    context.textBaseline = "middle";
    const reach = half / PITCH_PER_DEGREE + 5;
    for (let mark = Math.ceil((shown - reach) / 5) * 5; mark <= shown + reach; mark += 5) {
      if (Math.abs(mark) > 90) continue;
      const at = y - (mark - shown) * PITCH_PER_DEGREE;
      const isLabelled = mark % 10 === 0;
      context.fillStyle = mark === 0 ? YELLOW : isLabelled ? WHITE : QUIET;
      context.fillRect(x, at - 0.75, isLabelled ? 10 : 6, 1.5);
      // The value of the middle is in its own frame: a mark behind it would only blur it. At the ends half is cut off.
      const off = Math.abs(at - y);
      if (!isLabelled || off < 19 || off > half - 8) continue;
      context.fillText(`${mark}`.replace("-", "−"), x + PITCH_WIDTH - 6, at);
    }
    context.restore();
    context.fillStyle = "rgb(12, 15, 20)";
    context.beginPath();
    context.moveTo(x + 2, y);
    context.lineTo(x + 9, y - 10);
    context.lineTo(x + PITCH_WIDTH + 6, y - 10);
    context.lineTo(x + PITCH_WIDTH + 6, y + 10);
    context.lineTo(x + 9, y + 10);
    context.closePath();
    context.fill();
    context.lineWidth = 1.25;
    context.strokeStyle = YELLOW;
    context.stroke();
    context.font = BOLD_FONT;
    context.fillStyle = WHITE;
    context.textAlign = "right";
    context.fillText(`${signed(shown)}°`, x + PITCH_WIDTH + 3, y + 0.5);
  }

  /** Blue, in the middle of the screen: where the camera points. */
  _drawCross({ width, height }) {
    const context = this._context;
    const x = width / 2;
    const y = height / 2;
    context.beginPath();
    context.moveTo(x - 26, y);
    context.lineTo(x - 7, y);
    context.moveTo(x + 7, y);
    context.lineTo(x + 26, y);
    context.moveTo(x, y - 26);
    context.lineTo(x, y - 7);
    context.moveTo(x, y + 7);
    context.lineTo(x, y + 26);
    context.lineCap = "round";
    strokeOutlined(context, BLUE, 3);
    context.lineCap = "butt";
    context.beginPath();
    context.arc(x, y, 1.75, 0, 2 * Math.PI);
    context.fillStyle = BLUE;
    context.fill();
  }

  /** Yellow, along the horizon below or above the middle: leans as the camera is tilted, level when on the blue one. */
  _drawInertialCross(camera, projector) {
    const context = this._context;
    const furthest = Math.min(camera.width, camera.height) * 0.3;
    const toHorizon = (camera.f * projector.pitchSine) / Math.max(projector.pitchCosine, 1e-6);
    const shown = Math.min(Math.max(toHorizon, -furthest), furthest);
    const { upX, upY } = projector;
    const x = camera.width / 2 - upX * shown;
    const y = camera.height / 2 - upY * shown;
    const arm = Math.min(84, camera.width * 0.2);
    context.beginPath();
    // Along the horizon: up turned by a right angle.
    context.moveTo(x - upY * arm, y + upX * arm);
    context.lineTo(x - upY * 34, y + upX * 34);
    context.moveTo(x + upY * arm, y - upX * arm);
    context.lineTo(x + upY * 34, y - upX * 34);
    context.moveTo(x + upX * 46, y + upY * 46);
    context.lineTo(x + upX * 32, y + upY * 32);
    context.moveTo(x - upX * 46, y - upY * 46);
    context.lineTo(x - upX * 32, y - upY * 32);
    context.lineCap = "round";
    // At the end of its way it is dashed: the horizon is farther out.
    if (shown !== toHorizon) context.setLineDash(BEYOND);
    strokeOutlined(context, YELLOW, 2.5);
    context.setLineDash(SOLID);
    context.lineCap = "butt";
  }

  _label(text, x, y) {
    const context = this._context;
    context.font = BOLD_FONT;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = 3.5;
    context.lineJoin = "round";
    context.strokeStyle = "rgba(0, 0, 0, 0.7)";
    context.strokeText(text, x, y);
    context.fillStyle = WHITE;
    context.fillText(text, x, y);
  }
}

const TICK_FONT = font(12);
const NAME_FONT = font(14, 700);
const VALUE_FONT = font(15, 700);
const SMALL_FONT = font(12);
const BOLD_FONT = font(12.5, 600);
const BEYOND = [7, 7];
const SOLID = [];

/** One decimal with its sign; no sign on what rounds to zero. */
function signed(value) {
  const text = value.toFixed(1);
  return value > 0 && text !== "0.0" ? `+${text}` : text.replace("-0.0", "0.0").replace("-", "−");
}
