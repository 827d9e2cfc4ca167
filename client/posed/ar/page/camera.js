/** A pinhole camera that looks out of the phone's back: which way in the world a pixel of the screen lies. */

import { rotate } from "./quaternion.js";

export class Camera {
  /**
   * @param {Object} view
   * @param {number} view.width  CSS pixels  @param {number} view.height
   * @param {number} view.fovDeg  degrees along the longer side
   * @param {0|90|180|270} view.rotation  of what is drawn, clockwise from the natural orientation, as Android's
   *   Display.getRotation: at 90 the phone lies on its left side, and its x axis points up
   */
  constructor({ width, height, fovDeg, rotation }) {
    this.width = width;
    this.height = height;
    this.fovDeg = fovDeg;
    this.rotation = rotation;
    /** Focal length, pixels. */
    this.f = Math.max(width, height) / 2 / Math.tan((fovDeg * Math.PI) / 360);
    // Rounded, for the sine of half a turn is not quite 0.
    this._sine = Math.round(Math.sin((rotation * Math.PI) / 180));
    this._cosine = Math.round(Math.cos((rotation * Math.PI) / 180));
  }

  /** Unit direction (ENU) of a pixel, for an orientation that leads from device to world. */
  ray(q, x, y) {
    const right = (x - this.width / 2) / this.f;
    const up = (this.height / 2 - y) / this.f;
    const length = Math.hypot(right, up, 1);
    return rotate(q, [
      (this._cosine * right + this._sine * up) / length,
      (this._cosine * up - this._sine * right) / length,
      -1 / length,
    ]);
  }
}
