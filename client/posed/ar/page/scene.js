/** What is known and what was asked for, and what follows: the orientations and places that the page draws. */

import { format } from "./angles.js";
import { Camera } from "./camera.js";
import { fromEnu } from "./geodesy.js";
import { aboutUp, conjugate, extrapolate, multiply } from "./quaternion.js";
import { Places } from "./places.js";

const DEGREE = Math.PI / 180;
const STALE_AFTER_MS = 500;
// The truth comes every 20 ms; after a silence the drawn world stops rather than drift away.
const LONGEST_TRUTH_STEP_S = 0.1;
const TRUTH_LOST_AFTER_MS = 150;
// At 10 Hz a pose is at most some 130 ms old when drawn; beyond this the pose counts as lost.
const LONGEST_POSE_STEP_S = 0.5;
const PACE_KEPT = 16;

export class Scene {
  constructor() {
    this.camera = new Camera({ width: 1, height: 1, fovDeg: 65, rotation: 0 });
    this.places = new Places();
    this.settings = { declination_deg: null, wmm_declination_deg: null, position: null, background: null };
    /** What the user chose; null follows the device, the server or the truth. */
    this.chosen = { fovDeg: null, rotation: null, declination: null, view: "world", unit: "deg", extrapolate: false };
    this.device = { name: "", fov_deg: 65, rotation: 0 };
    this.link = { state: "CONNECTING", reason: "" };
    /** Position correction: an ENU-free WGS 84 place or null; heading offset in rad, added to headings. */
    this.correction = { name: "", headingOffset: 0, position: null };
    this.pose = null;
    this.poseAt = -Infinity;
    this.truth = null;
    this.observer = null;
    this._start = null;
    this._previousTruth = null;
    this._arrivals = new Float64Array(PACE_KEPT);
    this._arrived = 0;
    this._frozen = null;
  }

  /** Take the pose of a frame that arrived at `at` (performance.now()). */
  takePose(pose, at) {
    if (this._frozen === null) this.pose = pose;
    else this._frozen.pose = pose;
    // A pause is no measure of the pace.
    if (this.isStale(at)) this.forgetPace();
    this.poseAt = at;
    this._arrivals[this._arrived++ % PACE_KEPT] = at;
  }

  takeTruth(truth) {
    if (this._frozen !== null) return;
    this._previousTruth = this.truth;
    this.truth = truth;
  }

  /** Hold still what is seen at an instant, until `thaw`: what is dragged must not move by itself. */
  freeze(bootMs) {
    this._frozen = { bootMs, pose: this.pose };
  }

  thaw() {
    if (this._frozen === null) return;
    this.pose = this._frozen.pose;
    // The step from before to after says nothing of the rate.
    this._previousTruth = null;
    this._frozen = null;
  }

  get isFrozen() {
    return this._frozen !== null;
  }

  /**
   * Take how the way to the daemon stands; one that has just been found may be another phone, somewhere else.
   *
   * A tab that slept has not seen that the one before was lost: the count of connections tells.
   */
  takeLink(link) {
    const isNew = this.link.state !== "CONNECTED" || link.n !== this.link.n;
    if (link.state === "CONNECTED" && isNew) this._forget();
    this.link = link;
  }

  _forget() {
    this.truth = null;
    this._previousTruth = null;
    this.takeObserver(null);
  }

  /** @param {?Object} place  null where the daemon knows no position */
  takeObserver(place) {
    this.observer = place;
    if (place === null) {
      this._start = null;
      return;
    }
    // The truth's path begins at a position that was stated; a measured one is where it has come to.
    const gone = this.truth?.e ?? [0, 0, 0];
    if (place.source === "fixed") this._start = place;
    else this._start ??= fromEnu(place, gone.map((metres) => -metres));
  }

  /** Poses a second, from the arrivals of the last 16; NaN before the second, 0 when they have stopped. */
  measuredHz(now) {
    const n = Math.min(this._arrived, PACE_KEPT);
    if (n < 2) return NaN;
    if (this.isStale(now)) return 0;
    const oldest = this._arrivals[this._arrived < PACE_KEPT ? 0 : this._arrived % PACE_KEPT];
    return ((n - 1) * 1000) / (this.poseAt - oldest);
  }

  /** Begin to measure the pace anew. */
  forgetPace() {
    this._arrived = 0;
  }

  isStale(now) {
    return now - this.poseAt > STALE_AFTER_MS;
  }

  /** Declination in rad (east positive) and where it is from. */
  get declination() {
    if (this.chosen.declination !== null) return { angle: this.chosen.declination, source: "entered" };
    if (this.settings.declination_deg !== null) return { angle: this.settings.declination_deg * DEGREE, source: "given" };
    if (this.truth !== null) return { angle: this.truth.d * DEGREE, source: "truth" };
    const modelled = this.observer?.wmm_declination_deg ?? this.settings.wmm_declination_deg;
    if (modelled !== null) return { angle: modelled * DEGREE, source: "WMM 2025" };
    return { angle: 0, source: "unknown" };
  }

  /** Where the camera is according to the pose, before any correction. */
  get knownPosition() {
    return this.observer ?? this.settings.position ?? this.places.viewpoint;
  }

  /** Where the camera is for the overlay. */
  get position() {
    return this.correction.position ?? this.knownPosition;
  }

  /** Where the truth's path began. */
  get start() {
    return this._start ?? this.settings.position ?? this.places.viewpoint;
  }

  /** The fused orientation against true north, before any correction; at `bootMs`, or at the pose's sample time. */
  poseOrientation(bootMs = NaN) {
    const { q, w, t } = this.pose;
    if (this._frozen !== null && !Number.isNaN(bootMs)) bootMs = this._frozen.bootMs;
    const ahead = Math.min(Math.max((bootMs - t) / 1000, 0), LONGEST_POSE_STEP_S);
    return multiply(aboutUp(-this.declination.angle), ahead > 0 ? extrapolate(q, w, ahead) : q);
  }

  /** The same, corrected: what the overlay is drawn by. A heading is clockwise, a rotation about up is not. */
  corrected(q) {
    const offset = this.correction.headingOffset;
    return offset === 0 ? q : multiply(aboutUp(-offset), q);
  }

  /** The true orientation at `bootMs`, going on at the rate between the last two truths. */
  truthOrientation(bootMs) {
    const { q, t } = this.truth;
    const before = this._previousTruth;
    const ahead = ((this._frozen?.bootMs ?? bootMs) - t) / 1000;
    if (before === null || !(ahead > 0) || t <= before.t || t - before.t > 1000 * LONGEST_TRUTH_STEP_S) return q;
    const rate = rateBetween(before.q, q, (t - before.t) / 1000);
    return extrapolate(q, rate, Math.min(ahead, LONGEST_TRUTH_STEP_S));
  }

  /** The correction in a few words. */
  describeCorrection() {
    const { name, headingOffset, position } = this.correction;
    if (headingOffset === 0 && position === null) return "none";
    if (name) return name;
    const parts = [];
    if (headingOffset !== 0) parts.push(format(headingOffset, this.chosen.unit, this.chosen.unit === "dms" ? 0 : 1));
    if (position !== null) parts.push("position");
    return parts.join(", ");
  }

  /** Whether the truth has stopped, as motion capture's does where it loses the phone: the world stands still. */
  truthIsLost(bootMs) {
    return this.truth !== null && !this.isFrozen && bootMs - this.truth.t > TRUTH_LOST_AFTER_MS;
  }

  /** Fit the camera to a window of so many CSS pixels. */
  fitCamera(width, height) {
    const fovDeg = this.chosen.fovDeg ?? this.device.fov_deg;
    const rotation = this.chosen.rotation ?? this.device.rotation;
    this.camera = new Camera({ width, height, fovDeg, rotation });
  }
}

/** Angular rate in device axes, rad/s, that leads from one orientation to another. */
function rateBetween(from, to, seconds) {
  const [x, y, z, w] = multiply(conjugate(from), to);
  const sine = Math.hypot(x, y, z);
  if (sine < 1e-12) return [0, 0, 0];
  const turn = (2 * Math.atan2(w < 0 ? -sine : sine, Math.abs(w))) / (sine * seconds);
  return [x * turn, y * turn, z * turn];
}
