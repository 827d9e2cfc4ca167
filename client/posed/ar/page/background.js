/** What lies behind the overlay: the drawn world, a panorama, a photograph or a camera's picture. */

import { fit } from "./draw.js";
import { Panorama } from "./panorama.js";
import { Projector } from "./projector.js";
import { World } from "./world.js";

export const VIEWS = ["world", "panorama", "photo", "camera"];

export class Background {
  /**
   * @param {HTMLElement} stage  with #view, #camera and #photo in it
   * @param {function(string): void} tell  shows a short message
   */
  constructor(stage, tell) {
    this._canvas = stage.querySelector("#view");
    this._video = stage.querySelector("#camera");
    this._photo = stage.querySelector("#photo");
    this._context = this._canvas.getContext("2d", { alpha: false });
    this._tell = tell;
    /** Aimed by the truth. */
    this.projector = new Projector();
    this._world = new World(this.projector);
    this._panorama = new Panorama(this.projector);
    this._scale = 1;
    this.view = "world";
  }

  resize(width, height) {
    this._scale = fit(this._canvas, width, height);
  }

  /** Whether the view moves by the orientation, and so needs the truth. */
  get isDrawn() {
    return this.view === "world" || this.view === "panorama";
  }

  /** True bearing of the panorama's middle, rad. */
  set panoramaMiddle(bearing) {
    this._panorama.middle = bearing;
  }

  /** Change the view; one that cannot be had falls back to the world, with a message. Returns the view in force. */
  async show(view) {
    this.view = view;
    try {
      if (view === "panorama" && !this._panorama.isLoaded) await this._panorama.load("/background");
      if (view === "photo" && !this._photo.src) await this._loadPhoto();
      if (view === "camera") await this._openCamera();
    } catch (error) {
      // Meanwhile the user may have gone on to another view.
      if (this.view === view) this.view = "world";
      this._tell(reasonOf(view, error));
    }
    if (this.view !== "camera") this._closeCamera();
    this._video.hidden = this.view !== "camera";
    this._photo.hidden = this.view !== "photo";
    this._canvas.hidden = !this.isDrawn;
    return this.view;
  }

  /** Hold a camera's picture still, or let it go on. */
  hold(isHeld) {
    if (isHeld) this._video.pause();
    else if (this.view === "camera") void this._video.play();
  }

  /** Draw the view if it is a drawn one; the projector is to be aimed. */
  draw(places) {
    if (this.view === "panorama" && this._panorama.isLoaded) {
      this._panorama.draw(this._context, this._scale);
      this._world.drawMarks(this._context, this._scale, places);
    } else if (this.isDrawn) {
      this._world.draw(this._context, this._scale, places);
      this._world.drawMarks(this._context, this._scale, places);
    }
  }

  async _loadPhoto() {
    this._photo.src = "/background";
    try {
      await this._photo.decode();
    } catch (error) {
      this._photo.removeAttribute("src");
      throw error;
    }
  }

  async _openCamera() {
    if (!navigator.mediaDevices) throw new DOMException("", "SecurityError");
    const stream = await navigator.mediaDevices.getUserMedia({
      audio: false,
      video: { facingMode: { ideal: "environment" }, width: { ideal: 1280 } },
    });
    // Asked for twice, while the user was still to allow it, it may be open already.
    if (this.view !== "camera" || this._video.srcObject !== null) {
      for (const track of stream.getTracks()) track.stop();
      return;
    }
    this._video.srcObject = stream;
    await this._video.play();
  }

  _closeCamera() {
    for (const track of this._video.srcObject?.getTracks() ?? []) track.stop();
    this._video.srcObject = null;
  }
}

function reasonOf(view, error) {
  if (view === "panorama") return "No panorama: start posed ar with --panorama FILE. Showing the world.";
  if (view === "photo") return "No photograph: start posed ar with --photo FILE. Showing the world.";
  const reasons = {
    NotAllowedError: "The browser refused the camera: allow it for this page in the browser's site settings.",
    NotFoundError: "This device has no camera.",
    NotReadableError: "The camera is in use by another program.",
    SecurityError: "Browsers give a camera only to pages of this machine or over HTTPS.",
  };
  return `${reasons[error.name] ?? `The camera does not start: ${error.message}.`} Showing the world.`;
}
