/** The field book: sights recorded on the page, kept by the browser, given out as CSV and GeoJSON. */

import { format, formatBearing } from "./angles.js";
import { formatDistance } from "./draw.js";
import { make } from "./panels.js";

const KEPT_AS = "posed-ar-book";
const MOST = 2000;

/**
 * @typedef {Object} Sight  angles in degrees against true north, positions WGS 84, heights above the ellipsoid (m)
 * @property {string} time  ISO 8601, UTC
 * @property {string} name  @property {string} id  of the place; both empty for a sight of nothing known
 * @property {number} bearing @property {number} elevation  from the position to the place, or of the camera
 * @property {?number} distance  m
 * @property {?import("./geodesy.js").Position} place  @property {?import("./geodesy.js").Position} position
 * @property {number} cameraBearing @property {number} cameraElevation  where the camera pointed
 * @property {number} headingAccuracy  one standard deviation  @property {number} declination  east positive
 * @property {string} correction  @property {string} mode  @property {number} sequence  of the pose
 */

/** Name of a column, what it holds, and the decimals of a number. */
const COLUMNS = [
  ["time", (sight) => sight.time],
  ["name", (sight) => sight.name],
  ["bearing_deg", (sight) => sight.bearing, 3],
  ["elevation_deg", (sight) => sight.elevation, 3],
  ["distance_m", (sight) => sight.distance, 2],
  ["camera_bearing_deg", (sight) => sight.cameraBearing, 3],
  ["camera_elevation_deg", (sight) => sight.cameraElevation, 3],
  ["heading_accuracy_deg", (sight) => sight.headingAccuracy, 2],
  ["declination_deg", (sight) => sight.declination, 3],
  ["correction", (sight) => sight.correction],
  ["rate_mode", (sight) => sight.mode],
  ["pose_sequence", (sight) => sight.sequence, 0],
  ["position_latitude", (sight) => sight.position?.latitude, 8],
  ["position_longitude", (sight) => sight.position?.longitude, 8],
  ["position_height_m", (sight) => sight.position?.height, 2],
  ["place_id", (sight) => sight.id],
  ["place_latitude", (sight) => sight.place?.latitude, 8],
  ["place_longitude", (sight) => sight.place?.longitude, 8],
  ["place_height_m", (sight) => sight.place?.height, 2],
];

export class Book {
  /** @param {function(): string} unit  of angles  @param {function(string): void} tell */
  constructor(unit, tell) {
    this._unit = unit;
    this._tell = tell;
    this._list = document.querySelector("#book-records");
    this._files = { "#book-csv": [toCsv, "text/csv", "csv"], "#book-geojson": [toGeoJson, "application/geo+json", "geojson"] };
    for (const [button, [write, type, suffix]] of Object.entries(this._files)) {
      document.querySelector(button).addEventListener("click", () => download(write(this.sights), type, suffix));
    }
    /** @type {Sight[]} */
    this.sights = this._load();
    this._isKept = true;
    this.show();
  }

  /** Add a sight; returns it in words. */
  record(sight) {
    this._takeKept();
    this.sights.push(sight);
    if (this.sights.length > MOST) this.sights.shift();
    this._keep();
    this.show();
    return `Recorded ${sight.name || "a free sight"}: ${this._inWords(sight)}`;
  }

  show() {
    const count = this.sights.length;
    document.querySelector("#book-count").textContent = count ? ` ${count}` : "";
    document.querySelector("#book-empty").hidden = count > 0;
    for (const button of Object.keys(this._files)) document.querySelector(button).disabled = count === 0;
    // Newest first.
    this._list.replaceChildren(...this.sights.map((sight) => this._item(sight)).reverse());
  }

  _item(sight) {
    const name = sight.name || "Free sight";
    const remove = () => {
      this._takeKept();
      const written = JSON.stringify(sight);
      const at = this.sights.findIndex((other) => JSON.stringify(other) === written);
      if (at !== -1) this.sights.splice(at, 1);
      this._keep();
      this.show();
      document.querySelector("#book-title").focus();
    };
    return make(
      "li",
      {},
      make(
        "div",
        {},
        make("div", { class: "name", dir: "auto" }, name),
        make("div", { class: "detail" }, this._inWords(sight)),
        make("div", { class: "detail" }, `${sight.time.slice(0, 19).replace("T", " ")} UTC, heading ±${sight.headingAccuracy.toFixed(1)}°`),
      ),
      make("button", { class: "slim", "aria-label": `Delete the record of ${name}`, onclick: remove }, "✕"),
    );
  }

  _inWords({ bearing, elevation, distance }) {
    const unit = this._unit();
    const digits = unit === "dms" ? 0 : 2;
    const parts = [formatBearing(radians(bearing), unit, digits), format(radians(elevation), unit, digits)];
    if (distance !== null) parts.push(formatDistance(distance));
    return parts.join(" · ");
  }

  /** Another tab may have changed the book since; one that the browser does not keep is in this tab alone. */
  _takeKept() {
    if (this._isKept) this.sights = this._load();
  }

  _load() {
    try {
      const kept = JSON.parse(localStorage.getItem(KEPT_AS) ?? "[]");
      return Array.isArray(kept) ? kept.filter((sight) => typeof sight?.time === "string") : [];
    } catch (error) {
      this._tell(`The field book kept by this browser cannot be read (${error.message}): beginning a new one.`);
      return [];
    }
  }

  _keep() {
    try {
      localStorage.setItem(KEPT_AS, JSON.stringify(this.sights));
      this._isKept = true;
    } catch (error) {
      this._isKept = false;
      this._tell(`This browser does not keep the field book (${error.name}): download it before you leave the page.`);
    }
  }
}

/** The sights as CSV (RFC 4180). */
export function toCsv(sights) {
  const rows = sights.map((sight) => COLUMNS.map(([, of, digits]) => cell(of(sight), digits)));
  return [COLUMNS.map(([name]) => name), ...rows].map((row) => `${row.join(",")}\r\n`).join("");
}

/** The sights as GeoJSON (RFC 7946): points at the places; free sights at the position they were taken from. */
export function toGeoJson(sights) {
  const features = sights.map((sight) => ({
    type: "Feature",
    geometry: geometryOf(sight.place ?? sight.position),
    properties: Object.fromEntries(COLUMNS.map(([name, of, digits]) => [name, rounded(of(sight), digits)])),
  }));
  return `${JSON.stringify({ type: "FeatureCollection", features }, null, 1)}\n`;
}

function geometryOf(position) {
  if (position === null) return null;
  const { latitude, longitude, height } = position;
  return { type: "Point", coordinates: height === null ? [longitude, latitude] : [longitude, latitude, height] };
}

function cell(value, digits) {
  const text = typeof value === "number" ? value.toFixed(digits) : (value ?? "");
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

function rounded(value, digits) {
  return typeof value === "number" ? Number(value.toFixed(digits)) : (value ?? null);
}

function radians(degrees) {
  return (degrees * Math.PI) / 180;
}

function download(text, type, suffix) {
  const stamp = new Date().toISOString().slice(0, 19).replaceAll(/[:-]/g, "");
  const link = make("a", { href: URL.createObjectURL(new Blob([text], { type })), download: `sights-${stamp}.${suffix}` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
