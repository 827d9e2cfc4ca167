/** The figures beside the view, the banner when no pose comes, and what is said to screen readers. */

import { format, formatBearing } from "./angles.js";
import { formatDistance } from "./draw.js";

const STATUS = [
  "initialising", "at rest", "magnetic disturbance", "gyroscope lost", "free fall", "gap", "bad sample", "heading free",
  "accelerometer lost",
];
// All but "at rest".
const WORRYING = 0b111111101;
const SAY_EVERY_MS = 3000;
const STEADY_MS = 700;

const LINK_TEXT = {
  CONNECTED: ["No pose arrives", "The daemon is there but sends none; waiting."],
  CONNECTING: ["No daemon yet", "Looking for one."],
  DISCONNECTED: ["Daemon died", "Waiting for its return."],
  BINDING_DIED: ["Binding died", "Waiting for the daemon."],
  SERVER_LOST: ["posed ar does not answer", "Trying to reach it again."],
  REFUSED: ["This browser is not let in any more", "Open the newest link that posed ar printed."],
};

export class Readout {
  constructor() {
    this._elements = new Map();
    this._banner = document.querySelector("#banner");
    this._saidAt = -Infinity;
    this._said = "";
    this._steadySince = 0;
    this._waiting = "";
  }

  /** Write a text, if it is another than the one that is there. */
  write(id, text, isWarning = false) {
    let element = this._elements.get(id);
    if (element === undefined) {
      element = { node: document.getElementById(id), text: null, isWarning: false };
      this._elements.set(id, element);
    }
    if (element.text !== text) {
      element.text = text;
      element.node.textContent = text;
    }
    if (element.isWarning !== isWarning) {
      element.isWarning = isWarning;
      element.node.classList.toggle("warn", isWarning);
    }
  }

  /** @param {object} figures  see `figures` in ar.js  @param {"deg"|"dms"|"gon"} unit */
  showFigures(figures, unit) {
    const { pose, isStale, hz, ageMs, delayMs, registration, truthNote, correction, script } = figures;
    const rate = isStale ? "0 Hz" : Number.isNaN(hz) ? "–" : `${hz.toFixed(1)} Hz`;
    const error = truthNote ?? `${registration.deg.toFixed(2)}° · ${pixels(registration.px)}`;
    this.write("r-registration", error);
    this.write("r-script", `${script.p95.toFixed(1)} ms`, script.p95 > 4);
    this.write("r-correction", correction);
    if (pose === null) {
      this.write("brief", "no pose yet");
      return;
    }
    const age = isStale ? "stale" : milliseconds(ageMs);
    const accuracy = `±${format((pose.a * Math.PI) / 180, unit, unit === "dms" ? 0 : 1)}`;
    this.write("r-rate", pose.x > 0 ? `${rate}, ${pose.x} missed` : rate, isStale);
    this.write("r-age", age, isStale);
    this.write("r-delay", isStale ? "–" : milliseconds(delayMs));
    this.write("r-mode", pose.m);
    this.write("r-accuracy", accuracy);
    this.write("r-state", isStale ? "stale" : statusText(pose.s), isStale || (pose.s & WORRYING) !== 0);
    const below = isStale ? "waiting for a pose" : (truthNote ?? `error ${error}`);
    this.write("brief", `${rate} · ${age} · ${accuracy}\n${below}`);
  }

  /**
   * @param {?import("./places.js").Place} target  @param {{bearing:number, elevation:number, distance:number}} sight
   * @param {{name:string, note:string}} otherwise  shown where there is no target
   */
  showTarget(target, sight, isHeld, unit, otherwise) {
    const digits = unit === "dms" ? 0 : 2;
    document.getElementById("target").classList.toggle("none", target === null);
    document.getElementById("target-clear").hidden = !isHeld;
    this.write("target-name", (target ?? otherwise).name);
    this.write("target-note", (target ?? otherwise).note);
    this.write("target-bearing", formatBearing(sight.bearing, unit, digits));
    this.write("target-elevation", format(sight.elevation, unit, digits));
    this.write("target-distance", target === null ? "–" : formatDistance(sight.distance));
  }

  /** Say a change of the target, once it has lasted, and not more often than one can listen. */
  sayTarget(text, now) {
    if (text !== this._waiting) {
      this._waiting = text;
      this._steadySince = now;
    }
    if (text === this._said || now - this._steadySince < STEADY_MS || now - this._saidAt < SAY_EVERY_MS) return;
    this._said = text;
    this._saidAt = now;
    document.getElementById("said").textContent = text;
  }

  /** @param {?{state:string, reason:string}} link  why no pose comes; null while they do */
  showBanner(link, silentMs) {
    const isHidden = link === null;
    if (this._banner.hidden !== isHidden) this._banner.hidden = isHidden;
    if (isHidden) return;
    const [title, remedy] = LINK_TEXT[link.state] ?? [link.state, ""];
    // Whole seconds, and not spoken: an alert that counts would be read out again each time.
    const text = link.reason && link.state !== "DISCONNECTED" ? `${sentence(link.reason)} ${remedy}` : remedy;
    const [strong, span] = this._banner.children;
    if (strong.textContent !== title) strong.textContent = title;
    if (span.textContent !== text) span.textContent = text;
    const wait = Number.isFinite(silentMs) ? `No pose for ${Math.floor(silentMs / 1000)} s` : "No pose yet";
    if (this._banner.title !== wait) this._banner.title = wait;
  }
}

let noticeTimer = 0;

/** A short message that goes by itself. */
export function notify(text) {
  const notice = document.querySelector("#notice");
  notice.textContent = text;
  notice.hidden = false;
  clearTimeout(noticeTimer);
  noticeTimer = setTimeout(() => (notice.hidden = true), 3000 + 40 * text.length);
}

function statusText(bits) {
  const on = STATUS.filter((_, bit) => bits & (1 << bit));
  return on.length ? on.join(", ") : "tracking";
}

function milliseconds(value) {
  // The clocks of browser and daemon are compared to some milliseconds.
  if (value < 1) return "< 1 ms";
  return Number.isFinite(value) ? `${value.toFixed(value < 10 ? 1 : 0)} ms` : "–";
}

function pixels(value) {
  return Number.isNaN(value) ? "off screen" : `${value.toFixed(1)} px`;
}

function sentence(text) {
  const trimmed = text.trim();
  return /[.!?]$/.test(trimmed) ? trimmed : `${trimmed}.`;
}
