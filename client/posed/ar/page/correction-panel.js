/** The pose correction: by dragging overlays onto their real objects, by numbers, by a name it was saved under. */

import { format, parse, wrap } from "./angles.js";
import { polar } from "./geodesy.js";
import { make } from "./panels.js";
import { solveBoth, solveHeading, SolveError } from "./solve.js";
import { sightOf } from "./target.js";

const DEGREE = Math.PI / 180;
// Faster, neither hand nor pose is sure of the degree that an alignment is about.
const FASTEST = 5 * DEGREE;
const POSITION = [["latitude", 90], ["longitude", 180], ["height", 20_000]];

/**
 * @typedef {Object} Ways  to the rest of the page
 * @property {function(): void} changed  the correction is another  @property {function(string): void} tell
 * @property {function(): number} bootMs  the server's time
 */

export class CorrectionPanel {
  /**
   * @param {import("./scene.js").Scene} scene  @param {import("./target.js").Target} target
   * @param {import("./frame.js").Frame} frame  @param {Ways} ways
   */
  constructor(scene, target, frame, ways) {
    this._scene = scene;
    this._target = target;
    this._frame = frame;
    this._ways = ways;
    /** @type {Map<string, import("./solve.js").Alignment>} */
    this._alignments = new Map();
    this._residuals = [];
    this._dragged = null;
    this._before = null;
    this._saved = {};
    this._numbers = document.querySelector("#numbers");
    this._drag = document.querySelector("#drag");
    this._drag.addEventListener("click", () => this._setDragging(!this.isDragging));
    document.querySelector("#align").addEventListener("click", () => this.alignTarget());
    document.querySelector("#solve-heading").addEventListener("click", () => this._solve(solveHeading));
    document.querySelector("#solve-both").addEventListener("click", () => this._solve(solveBoth));
    document.querySelector("#reset").addEventListener("click", () => this._reset());
    this._numbers.addEventListener("submit", (event) => this._applyNumbers(event));
    document.querySelector("#save").addEventListener("submit", (event) => this._save(event));
  }

  get isDragging() {
    return this._drag.getAttribute("aria-pressed") === "true";
  }

  /** Write what holds into the panel, and fetch what is saved. */
  async show() {
    this._showNumbers();
    this._showAlignments();
    await this._request("GET", "/corrections.json");
  }

  /** Take hold of the dot at a point, if overlays can be dragged and there is one. */
  grabbed(x, y, reach) {
    if (!this.isDragging || this._scene.pose === null) return false;
    const place = this._scene.places.byId(this._frame.overlay.dotAt(x, y, reach));
    if (place === null || !this._isStill()) return false;
    this._dragged = place;
    this._before = this._scene.correction;
    this._scene.freeze(this._ways.bootMs());
    this._frame.background.hold(true);
    this._target.hold(place);
    return true;
  }

  /** Turn the overlay with the dot. */
  dragged(x, y) {
    const { bearing } = this._seenAt(x, y);
    // The places may have been worked out anew.
    const place = this._scene.places.byId(this._dragged.id) ?? this._dragged;
    const headingOffset = wrap(sightOf(place, this._frame.eye).bearing - bearing);
    this._scene.correction = { ...this._scene.correction, name: "", headingOffset };
    this._ways.changed();
  }

  /** Align the dot with where it was let go, and solve for the heading; nulls: the drag was broken off. */
  dropped(x, y) {
    this._scene.correction = this._before;
    if (x !== null) {
      this._align(this._dragged, this._seenAt(x, y));
      this._solve(solveHeading);
    }
    this._dragged = null;
    this._scene.thaw();
    this._frame.background.hold(false);
    this._ways.changed();
  }

  /** Align the target with what the blue cross is aimed at. */
  alignTarget() {
    const { place } = this._target;
    if (place === null || this._scene.pose === null) {
      this._ways.tell("Tap a place to hold it as the target, aim the blue cross at the real one, then align.");
      return;
    }
    if (!this._isStill()) return;
    const { width, height } = this._scene.camera;
    this._align(place, this._seenAt(width / 2, height / 2));
    this._solution(`${place.name} is aligned. Solve, or align another.`);
  }

  /** Bearing and elevation (rad) of a pixel by the uncorrected pose, brought to the instant of the picture. */
  _seenAt(x, y) {
    const { camera } = this._scene;
    return polar(camera.ray(this._scene.poseOrientation(this._ways.bootMs()), x, y));
  }

  _isStill() {
    const rate = Math.hypot(...this._scene.pose.w);
    if (rate <= FASTEST) return true;
    this._ways.tell(`The phone turns at ${(rate / DEGREE).toFixed(0)}° a second: hold it still to align.`);
    return false;
  }

  _align({ id, name, position }, { bearing, elevation }) {
    this._alignments.set(id, { id, name, position, bearing, elevation });
    this._residuals = [];
    this._showAlignments();
  }

  _solve(solve) {
    const { position, chosen } = this._scene;
    if (position === null) {
      this._solution("Your position is unknown: enter it below first.", true);
      return;
    }
    try {
      const solution = solve([...this._alignments.values()], position);
      this._residuals = solution.residuals;
      this._apply("", solution.headingOffset, solution.position ?? this._scene.correction.position);
      this._solution(inWords(solution, this._alignments.size, chosen.unit));
    } catch (error) {
      if (!(error instanceof SolveError)) throw error;
      this._residuals = [];
      this._solution(error.message, true);
    }
    this._showAlignments();
  }

  _apply(name, headingOffset, position) {
    this._scene.correction = { name, headingOffset, position };
    this._showNumbers();
    this._ways.changed();
  }

  _reset() {
    this._alignments.clear();
    this._residuals = [];
    this._apply("", 0, null);
    this._showAlignments();
    this._solution("The pose is shown as it comes.");
  }

  _setDragging(on) {
    this._drag.setAttribute("aria-pressed", `${on}`);
    document.querySelector("#stage").classList.toggle("dragging", on);
    if (on) this._ways.tell("Drag a red dot onto its real object; the view stands still meanwhile.");
  }

  _solution(text, isError = false) {
    const element = document.querySelector("#solution");
    element.textContent = text;
    element.classList.toggle("error", isError);
  }

  _showAlignments() {
    const { unit } = this._scene.chosen;
    const items = [...this._alignments.values()].map((alignment) => {
      const residual = this._residuals.find(({ id }) => id === alignment.id);
      const remove = () => {
        this._alignments.delete(alignment.id);
        this._residuals = [];
        this._showAlignments();
        this._drag.focus();
      };
      const detail = residual === undefined ? `seen at ${fine(alignment.bearing, unit)}` : residualInWords(residual, unit);
      return make(
        "li",
        {},
        make("div", {}, make("div", { class: "name", dir: "auto" }, alignment.name), make("div", { class: "detail" }, detail)),
        make("button", { class: "slim", "aria-label": `Remove the alignment of ${alignment.name}`, onclick: remove }, "✕"),
      );
    });
    document.querySelector("#alignments").replaceChildren(...items);
    document.querySelector("#solve-heading").disabled = items.length < 1;
    document.querySelector("#solve-both").disabled = items.length < 2;
  }

  _showNumbers() {
    const { correction, knownPosition, chosen } = this._scene;
    const field = this._numbers.elements;
    field.offset.value = format(correction.headingOffset, chosen.unit, chosen.unit === "dms" ? 0 : 2);
    for (const [key] of POSITION) {
      const digits = key === "height" ? 1 : 7;
      field[key].value = correction.position?.[key].toFixed(digits) ?? "";
      field[key].placeholder = knownPosition?.[key].toFixed(digits) ?? "";
    }
    this._complain("#numbers", "");
  }

  _applyNumbers(event) {
    event.preventDefault();
    const field = this._numbers.elements;
    const offset = field.offset.value.trim() === "" ? 0 : parse(field.offset.value, this._scene.chosen.unit);
    if (!(Math.abs(offset) <= 2 * Math.PI)) {
      this._complain("#numbers", `“${field.offset.value}” is no angle; write −7.3, 7° 18′, 8.1 gon.`, field.offset);
      return;
    }
    let position = null;
    if (POSITION.some(([key]) => field[key].value.trim() !== "")) {
      position = {};
      for (const [key, limit] of POSITION) {
        // What is left empty stays as the pose has it.
        const text = field[key].value.trim() || field[key].placeholder;
        position[key] = text === "" ? NaN : Number(text.replace(",", ".").replace("−", "-"));
        if (!(Math.abs(position[key]) <= limit)) {
          this._complain("#numbers", `The ${key} is a number from −${limit} to ${limit}, not “${text}”.`, field[key]);
          return;
        }
      }
    }
    this._residuals = [];
    this._showAlignments();
    this._apply("", wrap(offset), position);
    this._ways.tell("The correction is applied.");
  }

  async _save(event) {
    event.preventDefault();
    const field = event.target.elements.name;
    const name = field.value.trim();
    // A path of the server: a slash would part it, dots alone would lead elsewhere.
    if (name === "" || /\/|^\.\.?$/.test(name)) {
      const remedy = name === "" ? "Give the correction a name." : `“${name}” is no name: leave out slashes, and dots alone.`;
      this._complain("#save", remedy, field);
      return;
    }
    const { headingOffset, position } = this._scene.correction;
    const body = { heading_offset_deg: headingOffset / DEGREE, position, saved: new Date().toISOString() };
    if (await this._request("PUT", pathOf(name), body)) {
      this._scene.correction = { ...this._scene.correction, name };
      field.value = "";
      this._ways.changed();
      this._ways.tell(`Saved as ${name}.`);
    }
  }

  /** Ask the server; it answers with all that is saved, or with what is wrong. Returns whether it did as asked. */
  async _request(method, path, body) {
    try {
      const headers = body === undefined ? {} : { "content-type": "application/json" };
      const response = await fetch(path, { method, headers, body: body && JSON.stringify(body) });
      const answer = response.status === 403 ? { error: await response.text() } : await response.json();
      if (!response.ok) throw new Error(answer.error);
      this._saved = answer.corrections;
      this._complain("#save", "");
      this._showSaved();
      return true;
    } catch (error) {
      this._complain("#save", error instanceof TypeError ? "posed ar does not answer: nothing was saved." : error.message);
      return false;
    }
  }

  _showSaved() {
    const { unit } = this._scene.chosen;
    const items = Object.entries(this._saved).map(([name, kept]) => {
      const headingOffset = wrap(kept.heading_offset_deg * DEGREE);
      const load = () => {
        this._residuals = [];
        this._apply(name, headingOffset, kept.position);
        this._showAlignments();
        this._ways.tell(`${name} is applied.`);
      };
      const remove = async () => {
        await this._request("DELETE", pathOf(name));
        document.querySelector("#save").elements.name.focus();
      };
      const detail = `${fine(headingOffset, unit)}${kept.position === null ? "" : ", position"} · ${kept.saved.slice(0, 10)}`;
      return make(
        "li",
        {},
        make("div", {}, make("div", { class: "name", dir: "auto" }, name), make("div", { class: "detail" }, detail)),
        make("button", { "aria-label": `Load ${name}`, onclick: load }, "Load"),
        make("button", { class: "slim", "aria-label": `Delete ${name}`, onclick: remove }, "✕"),
      );
    });
    document.querySelector("#saved").replaceChildren(...items);
  }

  _complain(form, text, field = null) {
    const element = document.querySelector(form);
    for (const other of element.elements) other.removeAttribute("aria-invalid");
    field?.setAttribute("aria-invalid", "true");
    field?.focus();
    document.querySelector(form === "#save" ? "#saved-error" : "#numbers-error").textContent = text;
  }
}

function pathOf(name) {
  return `/corrections/${encodeURIComponent(name)}`;
}

function fine(rad, unit) {
  return format(rad, unit, unit === "dms" ? 0 : 2);
}

function residualInWords({ bearing, elevation }, unit) {
  const height = Number.isNaN(elevation) ? "" : `, elevation ${fine(elevation, unit)}`;
  return `residual: bearing ${fine(bearing, unit)}${height}`;
}

function inWords({ headingOffset, headingSigma, moved, positionSigma, rms, spare }, count, unit) {
  const parts = [`Heading offset ${fine(headingOffset, unit)} ±${fine(headingSigma, unit)}`];
  if (moved !== null) {
    const [e, n, u] = moved;
    const east = `${Math.abs(e).toFixed(1)} m ${e < 0 ? "west" : "east"}`;
    const north = `${Math.abs(n).toFixed(1)} m ${n < 0 ? "south" : "north"}`;
    const up = Math.abs(u) < 0.05 ? "" : `, ${Math.abs(u).toFixed(1)} m ${u < 0 ? "down" : "up"}`;
    parts.push(`moved ${Math.hypot(e, n).toFixed(1)} m ±${positionSigma.toFixed(1)} m (${east}, ${north}${up})`);
  }
  const from = count === 1 ? "1 alignment" : `${count} alignments`;
  const judged = spare > 0 ? `; bearings agree to ${fine(rms, unit)}` : "; one more would show how well they agree";
  return `${parts.join("; ")}; from ${from}${judged}.`;
}
