/** One frame: what is drawn of a scene, and what came out of it. */

import { Background } from "./background.js";
import { fit } from "./draw.js";
import { Instruments } from "./instruments.js";
import { Overlay } from "./overlay.js";
import { Projector } from "./projector.js";
import { measure } from "./registration.js";
import { sightOf } from "./target.js";
import { Thumbnail } from "./thumbnail.js";

const HERE = [0, 0, 0];
const NO_SIGHT = { bearing: NaN, elevation: NaN, distance: NaN };
// A thousandth of a pixel: what has turned or moved by less looks the same.
const SAME_TURN = 1e-6;
const SAME_PLACE_M = 1e-3;
const MARGIN = 8;

export class Frame {
  /** @param {import("./scene.js").Scene} scene  @param {import("./target.js").Target} target */
  constructor(scene, target, tell) {
    this._scene = scene;
    this._target = target;
    this._stage = document.querySelector("#stage");
    this._canvas = document.querySelector("#overlay");
    this._context = this._canvas.getContext("2d");
    this.background = new Background(this._stage, tell);
    /** Aimed by the corrected pose. */
    this.projector = new Projector();
    this.overlay = new Overlay(this._context, this.projector);
    this._instruments = new Instruments(this._context);
    this._thumbnail = new Thumbnail(document.querySelector("#thumbnail"));
    this._free = Instruments.freeOf(0, 0);
    this._seen = { q: [0, 0, 0, 0], eye: [0, 0, 0] };
    this._scale = 1;
    this._isForced = true;
    /** Of the last frame. */
    this.eye = HERE;
    this.attitude = { heading: 0, pitch: 0, roll: 0 };
    this.sight = NO_SIGHT;
    this.registration = { deg: NaN, px: NaN };
    /** Why there is no registration error; null if there is. */
    this.truthNote = "no truth yet";
  }

  /** Fit to the window and to what lies over the view. */
  resize() {
    const { innerWidth: width, innerHeight: height } = window;
    this._scene.fitCamera(width, height);
    this._scale = fit(this._canvas, width, height);
    this.overlay.resize(this._scale, width);
    this.background.resize(width, height);
    this._thumbnail.resize();
    this.makeRoom();
  }

  /** Keep labels out of what lies over the view now. */
  makeRoom() {
    this._free = freeSpace(window.innerWidth, window.innerHeight);
    this._isForced = true;
  }

  /** Draw all anew in the next frame, whether anything moved or not. */
  force() {
    this._isForced = true;
  }

  /**
   * Draw what has changed.
   *
   * @param {number} bootMs  the server's boot time now, NaN while unknown
   * @param {boolean} isNewPose  whether the overlay has something new to show
   * @returns {boolean} whether the next frame will differ though nothing new arrives
   */
  draw(bootMs, isNewPose) {
    const scene = this._scene;
    const { pose, places, truth } = scene;
    const isForced = this._isForced;
    this._isForced = false;
    if (pose === null && truth === null) return false;

    const isAhead = pose !== null && scene.chosen.extrapolate && !scene.isFrozen;
    const uncorrected = pose === null ? null : scene.poseOrientation(isAhead ? bootMs : NaN);
    const byPose = uncorrected === null ? null : scene.corrected(uncorrected);
    this.eye = places.moveTo(scene.position);
    const isMoving = this._drawBackground(byPose, bootMs, isForced);
    if (byPose === null) return isMoving;
    if (isNewPose || isForced || isAhead) this._drawOverlay(byPose);
    this._measure(truth, scene.truthIsLost(bootMs));
    return isMoving || this._isForced || (isAhead && Math.hypot(...pose.w) > 1e-3);
  }

  /** The camera's true orientation by the truth, or by the pose where there is none. */
  _drawBackground(byPose, bootMs, isForced) {
    const { truth, start, places, camera } = this._scene;
    if (!this.background.isDrawn) return false;
    const q = truth === null ? byPose : this._scene.truthOrientation(bootMs);
    if (q === null) return false;
    let eye = this.eye;
    if (truth !== null && start !== null) {
      eye = places.fromOrigin(start);
      if (truth.e !== null) eye = [eye[0] + truth.e[0], eye[1] + truth.e[1], eye[2] + truth.e[2]];
    }
    if (!isForced && isSame(q, this._seen.q, SAME_TURN) && isSame(eye, this._seen.eye, SAME_PLACE_M)) return false;
    this._seen = { q, eye };
    this.background.projector.aim(camera, q, eye);
    this.background.draw(places);
    return truth !== null;
  }

  _drawOverlay(byPose) {
    const { camera, places, chosen, declination } = this._scene;
    const { projector: to, overlay } = this;
    const context = this._context;
    to.aim(camera, byPose, this.eye);
    this.attitude = attitudeOf(to);
    context.setTransform(this._scale, 0, 0, this._scale, 0, 0);
    context.clearRect(0, 0, camera.width, camera.height);
    overlay.draw(places, this._target.place, this._free);
    const before = this._target.place;
    this._target.aim(places, overlay.drawn, to);
    // The new target's label is drawn as such at once, not with the next pose.
    if (this._target.place !== before) this._isForced = true;
    this._instruments.draw(this.attitude, declination, camera, to, chosen.unit);
    const halfView = Math.atan(camera.width / 2 / camera.f);
    this._thumbnail.draw(places, this._target.place, this.eye, this.attitude.heading, halfView);
    this.sight = this._target.place === null ? NO_SIGHT : sightOf(this._target.place, this.eye);
  }

  _measure(truth, isLost) {
    if (!this.background.isDrawn) this.truthNote = "no truth in this view";
    else if (truth === null) this.truthNote = "no truth";
    else if (isLost) this.truthNote = "truth lost";
    else {
      this.truthNote = null;
      measure(this.projector, this.background.projector, this._target.place, this.registration);
      return;
    }
    this.registration.deg = NaN;
    this.registration.px = NaN;
  }
}

/** Heading, pitch and roll of the camera, rad; roll is positive with the right edge of the screen lowered. */
function attitudeOf({ axes, pitchSine, upX, upY }) {
  const heading = Math.atan2(axes[6], axes[7]);
  return {
    heading: heading < 0 ? heading + 2 * Math.PI : heading,
    pitch: Math.asin(Math.min(Math.max(pitchSine, -1), 1)),
    roll: Math.atan2(-upX, -upY),
  };
}

/** Where labels may be: between the instruments at the top and what lies at the foot or the side. */
function freeSpace(width, height) {
  const free = Instruments.freeOf(width, height);
  for (const element of document.querySelectorAll("#thumbnail, #target, #readout, #modes, .panel")) {
    const box = element.getBoundingClientRect();
    if (box.width === 0) continue;
    const isAtSide = box.left > width / 2 && box.top < height / 2;
    if (isAtSide) {
      // Figures at the top right leave the space under them free.
      if (box.height > height / 2 || element.classList.contains("panel")) free.right = Math.min(free.right, box.left - MARGIN);
    } else {
      free.bottom = Math.min(free.bottom, box.top - MARGIN);
    }
  }
  return free;
}

function isSame(a, b, tolerance) {
  for (let i = 0; i < a.length; i++) if (!(Math.abs(a[i] - b[i]) <= tolerance)) return false;
  return true;
}
