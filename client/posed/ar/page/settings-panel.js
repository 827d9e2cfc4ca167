/** The settings: what the user chose over what device, server and truth say. */

import { format, parse } from "./angles.js";
import { VIEWS } from "./background.js";

const NARROWEST_DEG = 10;
const WIDEST_DEG = 150;
const ZOOM = 1.1;

export class SettingsPanel {
  /**
   * @param {import("./scene.js").Scene} scene
   * @param {import("./background.js").Background} background
   * @param {function(): void} changed
   */
  constructor(scene, background, changed) {
    this._scene = scene;
    this._background = background;
    this._changed = changed;
    this._form = document.querySelector("#settings-form");
    this._error = document.querySelector("#settings-error");
    this._form.addEventListener("change", (event) => this._take(event.target));
    this._form.addEventListener("submit", (event) => event.preventDefault());
  }

  /** Write what holds into the form. */
  show() {
    const { chosen, camera, declination } = this._scene;
    const field = this._form.elements;
    field.view.value = this._background.view;
    for (const option of field.view.options) option.disabled = !this._views().includes(option.value);
    document.querySelector("#panorama-heading").hidden = this._background.view !== "panorama";
    field.fov.value = (chosen.fovDeg ?? camera.fovDeg).toFixed(1);
    field.rotation.value = `${camera.rotation}`;
    field.unit.value = chosen.unit;
    field.extrapolate.checked = chosen.extrapolate;
    const angle = format(declination.angle, chosen.unit, chosen.unit === "dms" ? 0 : 2);
    field.declination.value = chosen.declination === null ? "" : angle;
    field.declination.placeholder = chosen.declination === null ? `automatic: ${angle} (${declination.source})` : "automatic";
    this._complain(null, "");
  }

  /** Show a view; one that cannot be had falls back to the world. */
  async showView(view) {
    this._scene.chosen.view = view;
    const inForce = await this._background.show(view);
    // The user may have gone on meanwhile.
    if (this._scene.chosen.view === view) this._scene.chosen.view = inForce;
    this._changed();
    this.show();
  }

  nextView() {
    const views = this._views();
    const next = views[(views.indexOf(this._background.view) + 1) % views.length];
    return this.showView(next);
  }

  /** Narrow the field of view by a tenth (1), or widen it (-1). */
  zoom(direction) {
    const wanted = this._scene.camera.fovDeg / ZOOM ** direction;
    this._scene.chosen.fovDeg = Math.min(Math.max(wanted, NARROWEST_DEG), WIDEST_DEG);
    this._changed();
    this.show();
  }

  toggleExtrapolation() {
    this._scene.chosen.extrapolate = !this._scene.chosen.extrapolate;
    this._changed();
    this.show();
    return this._scene.chosen.extrapolate;
  }

  /** The views that can be had; the camera's can only be tried. */
  _views() {
    const { background } = this._scene.settings;
    return VIEWS.filter((view) => view === "world" || view === "camera" || view === background);
  }

  _take(field) {
    const { chosen } = this._scene;
    if (field.name === "view") {
      void this.showView(field.value);
      return;
    }
    if (field.name === "panorama") this._background.panoramaMiddle = (field.valueAsNumber || 0) * (Math.PI / 180);
    else if (field.name === "rotation") chosen.rotation = Number(field.value);
    else if (field.name === "unit") chosen.unit = field.value;
    else if (field.name === "extrapolate") chosen.extrapolate = field.checked;
    else if (field.name === "fov") {
      if (!(field.valueAsNumber >= NARROWEST_DEG && field.valueAsNumber <= WIDEST_DEG)) {
        this._complain(field, `A field of view is from ${NARROWEST_DEG} to ${WIDEST_DEG} degrees.`);
        return;
      }
      chosen.fovDeg = field.valueAsNumber;
    } else if (field.name === "declination") {
      const angle = field.value.trim() === "" ? null : parse(field.value, chosen.unit);
      if (angle !== null && !(Math.abs(angle) <= Math.PI)) {
        this._complain(field, `“${field.value}” is no declination; write 5.5, 5° 30′, 6.1 gon or 5.5 W.`);
        return;
      }
      chosen.declination = angle;
    }
    this._changed();
    this.show();
  }

  _complain(field, text) {
    for (const other of this._form.elements) other.removeAttribute("aria-invalid");
    field?.setAttribute("aria-invalid", "true");
    this._error.textContent = text;
  }
}
