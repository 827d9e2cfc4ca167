/**
 * The AR page: brings together what comes from the server, what the user does, and what is drawn.
 *
 * `window.posedAr` tells tests, and users at the browser's console, what is drawn: see told.js.
 */

import { Live } from "/web/live.js";
import { format, formatBearing } from "./angles.js";
import { Book } from "./book.js";
import { CorrectionPanel } from "./correction-panel.js";
import { formatDistance } from "./draw.js";
import { Frame } from "./frame.js";
import { listenToKeys } from "./keyboard.js";
import { Pace } from "./pace.js";
import { Panels } from "./panels.js";
import { Readout, notify } from "./readout.js";
import { Scene } from "./scene.js";
import { SettingsPanel } from "./settings-panel.js";
import { listenTo } from "./stage.js";
import { Target, sightOf } from "./target.js";
import { told } from "./told.js";

const DEGREE = Math.PI / 180;
const READ_EVERY_MS = 200;
// Opening the page takes so long itself; a banner would only flash.
const PATIENCE_MS = 1000;
const MODES = ["NORMAL", "UI", "GAME", "FASTEST"];

const scene = new Scene();
const target = new Target();
const readout = new Readout();
const frame = new Frame(scene, target, notify);
const stage = document.querySelector("#stage");
const overlay = document.querySelector("#overlay");

let isNewPose = false;
/** Of the newest pose, ms. */
const delay = { publishedToDrawn: NaN, ageWhenDrawn: NaN };

const pace = new Pace(() => {
  const isNew = isNewPose;
  isNewPose = false;
  const goesOn = frame.draw(live.bootMs(), isNew);
  if (isNew && scene.pose !== null) {
    const drawnAt = live.bootMs();
    delay.publishedToDrawn = drawnAt - scene.pose.b;
    delay.ageWhenDrawn = drawnAt - scene.pose.t;
  }
  return goesOn;
});

/** Have everything drawn anew. */
function redraw() {
  frame.force();
  pace.wake();
}

const live = new Live("/live", {
  opened: () => askForTruth(),
  closed: async (wasOpen) => {
    scene.link = { state: "SERVER_LOST", reason: "" };
    read();
    if (!wasOpen && (await isRefused())) scene.link = { state: "REFUSED", reason: "" };
  },
  on: {
    // First: with another daemon the rest is another phone's.
    s: (link) => {
      scene.takeLink(link);
      read();
      redraw();
    },
    p: (pose) => {
      scene.takePose(pose, performance.now());
      isNewPose = true;
      if (overlay.classList.contains("stale")) read();
      pace.wake();
    },
    t: (truth) => {
      scene.takeTruth(truth);
      pace.wake();
    },
    o: (observer) => {
      scene.takeObserver(observer);
      redraw();
    },
    v: (device) => {
      scene.device = device;
      resize();
      settings.show();
    },
  },
});

const settings = new SettingsPanel(scene, frame.background, () => {
  askForTruth();
  resize();
  book.show();
});
const correction = new CorrectionPanel(scene, target, frame, { changed: redraw, tell: notify, bootMs: () => live.bootMs() });
const book = new Book(() => scene.chosen.unit, notify);
const panels = new Panels((id) => {
  if (id === "settings") settings.show();
  if (id === "correct") void correction.show();
});

/** A drawn view needs the truth, and only where somebody looks. */
function askForTruth() {
  live.send({ t: frame.background.isDrawn && !document.hidden });
}

function resize() {
  frame.resize();
  pace.wake();
}

async function isRefused() {
  try {
    return (await fetch("/settings.json", { cache: "no-store" })).status === 403;
  } catch {
    return false; // it is not there: the link's state says so
  }
}

/** Bring the figures, the banner and what is spoken up to date. */
function read() {
  const now = performance.now();
  const isLost = scene.link.state !== "CONNECTED" && scene.link.state !== "CONNECTING";
  const isStale = isLost || scene.isStale(now);
  overlay.classList.toggle("stale", isStale);
  readout.showBanner(isStale && now > PATIENCE_MS ? scene.link : null, now - scene.poseAt);
  const { pose, chosen } = scene;
  const hz = scene.measuredHz(now);
  readout.showFigures(
    {
      pose,
      isStale,
      hz,
      ageMs: delay.ageWhenDrawn,
      delayMs: delay.publishedToDrawn,
      registration: frame.registration,
      truthNote: isStale ? "stale" : frame.truthNote,
      correction: scene.describeCorrection(),
      script: pace.script(),
    },
    chosen.unit,
  );
  readout.showTarget(target.place, frame.sight, target.isHeld, chosen.unit, withoutTarget());
  for (const button of modeButtons) {
    button.setAttribute("aria-pressed", `${button.dataset.mode === pose?.m}`);
  }
  if (pose !== null) readout.sayTarget(isStale ? "No pose arrives." : targetInWords(), now);
}

function withoutTarget() {
  if (scene.position === null) {
    return { name: "Position unknown", note: "Start posed ar with --position, or enter one under Correct." };
  }
  if (scene.places.isEmpty) return { name: "No places", note: "Start posed ar with --places FILE." };
  return { name: "No target under the cross", note: "" };
}

function targetInWords() {
  if (target.place === null) return "No target.";
  const { bearing, elevation, distance } = frame.sight;
  const { unit } = scene.chosen;
  const digits = unit === "dms" ? 0 : 1;
  const height = format(elevation, unit, digits);
  return `${target.place.name}, bearing ${formatBearing(bearing, unit, digits)}, elevation ${height}, ${formatDistance(distance)}.`;
}

function hold(place) {
  target.hold(place);
  redraw();
  requestAnimationFrame(read);
}

function step(direction) {
  if (scene.places.all.length === 0) return;
  target.step(scene.places, frame.eye, frame.attitude.heading, direction);
  hold(target.place);
}

function record() {
  if (scene.pose === null) {
    notify("There is no pose to record yet.");
    return;
  }
  const { place } = target;
  const { heading, pitch } = frame.attitude;
  const sight = place === null ? { bearing: heading, elevation: pitch, distance: null } : sightOf(place, frame.eye);
  const words = book.record({
    time: new Date().toISOString(),
    name: place?.name ?? "",
    id: place?.id ?? "",
    bearing: sight.bearing / DEGREE,
    elevation: sight.elevation / DEGREE,
    distance: sight.distance,
    place: place?.position ?? null,
    position: scene.position && { ...scene.position },
    cameraBearing: heading / DEGREE,
    cameraElevation: pitch / DEGREE,
    headingAccuracy: scene.pose.a,
    declination: scene.declination.angle / DEGREE,
    correction: scene.describeCorrection(),
    mode: scene.pose.m,
    sequence: scene.pose.n,
  });
  notify(words);
}

function setMode(mode) {
  live.send({ m: mode });
}

function escape() {
  if (panels.open !== null) panels.close();
  else hold(null);
}

const modeButtons = document.querySelectorAll("#modes button");
for (const button of modeButtons) button.addEventListener("click", () => setMode(button.dataset.mode));
document.querySelector("#record").addEventListener("click", record);
document.querySelector("#target-clear").addEventListener("click", () => {
  hold(null);
  stage.focus();
});

listenTo(stage, {
  tapped: (x, y) => hold(scene.places.byId(frame.overlay.at(x, y))),
  grabbed: (x, y, reach) => correction.grabbed(x, y, reach),
  dragged: (x, y) => correction.dragged(x, y),
  dropped: (x, y) => correction.dropped(x, y),
});

listenToKeys({
  ArrowLeft: () => step(-1),
  ArrowRight: () => step(1),
  Enter: record,
  r: record,
  a: () => correction.alignTarget(),
  1: () => setMode(MODES[0]),
  2: () => setMode(MODES[1]),
  3: () => setMode(MODES[2]),
  4: () => setMode(MODES[3]),
  "+": () => settings.zoom(1),
  "=": () => settings.zoom(1),
  "-": () => settings.zoom(-1),
  v: () => settings.nextView(),
  e: () => notify(`Extrapolation between poses is ${settings.toggleExtrapolation() ? "on" : "off"}.`),
  b: () => panels.toggle("book"),
  c: () => panels.toggle("correct"),
  s: () => panels.toggle("settings"),
  "?": () => panels.toggle("help"),
  Escape: escape,
});

addEventListener("resize", resize);
// What lies over the view takes room from the labels.
const room = new ResizeObserver(() => {
  frame.makeRoom();
  pace.wake();
});
for (const element of document.querySelectorAll("#target, #readout, #modes, .panel")) room.observe(element);
document.addEventListener("visibilitychange", () => {
  askForTruth();
  if (document.hidden) return;
  scene.forgetPace();
  redraw();
  read();
});
setInterval(() => {
  if (!document.hidden) read();
}, READ_EVERY_MS);

async function load() {
  const [places, given] = await Promise.all(["/places.json", "/settings.json"].map(fetchJson));
  scene.places.load(places);
  scene.settings = { ...scene.settings, ...given };
  await settings.showView(given.background ?? "world");
  redraw();
}

async function fetchJson(path) {
  const response = await fetch(path);
  if (!response.ok) throw new Error(`${path}: ${response.status} ${await response.text()}`);
  return response.json();
}

window.posedAr = told({ scene, target, frame, live, pace, delay });

resize();
stage.focus();
load().catch((error) => {
  notify(`The page could not be set up (${error.message}). Load it again.`);
});
