/** An equirectangular picture as a camera sees it, worked out pixel by pixel at as many pixels as the time allows. */

// Bearing and elevation are worked out at the corners of blocks this wide and followed straight between them.
const BLOCK = 8;
const LARGEST_SOURCE = 4096;
const LEAST_WIDTH = 160;
// Of the 4 ms a frame may take, the picture gets about half.
const TOO_LONG_MS = 2.4;
const SHORT_MS = 1.1;

export class Panorama {
  /** @param {import("./projector.js").Projector} projector */
  constructor(projector) {
    this._to = projector;
    this._source = null;
    this._picture = document.createElement("canvas");
    this._pixels = null;
    this._wanted = 480;
    this._taken = 0;
    this._corners = { u: new Float64Array(0), v: new Float64Array(0) };
    /** True bearing of the middle of the picture, rad. */
    this.middle = 0;
  }

  /** Load a picture; rejects if there is none. */
  async load(url) {
    const image = new Image();
    image.src = url;
    await image.decode();
    const width = Math.min(image.naturalWidth, LARGEST_SOURCE);
    const height = Math.round((image.naturalHeight * width) / image.naturalWidth);
    const canvas = document.createElement("canvas");
    canvas.width = width;
    canvas.height = height;
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0, width, height);
    this._source = new Uint32Array(context.getImageData(0, 0, width, height).data.buffer);
    this._sourceWidth = width;
    this._sourceHeight = height;
  }

  get isLoaded() {
    return this._source !== null;
  }

  /** Draw the picture over the whole canvas, as the aimed projector's camera sees it. */
  draw(context, scale) {
    const start = performance.now();
    const { width, height } = this._to.camera;
    this._resize(width, height);
    this._lookThroughCorners(width, height);
    this._fill();
    this._context.putImageData(this._image, 0, 0);
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.drawImage(this._picture, 0, 0, width, height);
    this._adapt(performance.now() - start, width);
  }

  _adapt(took, width) {
    this._taken += 0.1 * (took - this._taken);
    if (this._taken > TOO_LONG_MS) this._wanted = Math.max(LEAST_WIDTH, Math.round(this._wanted * 0.85));
    else if (this._taken < SHORT_MS && this._wanted < width) this._wanted = Math.round(this._wanted * 1.1);
    else return;
    this._taken = (TOO_LONG_MS + SHORT_MS) / 2;
  }

  _resize(width, height) {
    const across = BLOCK * Math.max(2, Math.round(Math.min(this._wanted, width) / BLOCK));
    const down = BLOCK * Math.max(2, Math.round((across * height) / width / BLOCK));
    if (this._picture.width === across && this._picture.height === down && this._pixels) return;
    this._picture.width = across;
    this._picture.height = down;
    this._context = this._picture.getContext("2d");
    this._image = this._context.createImageData(across, down);
    this._pixels = new Uint32Array(this._image.data.buffer);
    const corners = (across / BLOCK + 1) * (down / BLOCK + 1);
    this._corners = { u: new Float64Array(corners), v: new Float64Array(corners) };
  }

  /** Texture coordinates in source pixels at each corner of the blocks. */
  _lookThroughCorners(width, height) {
    const m = this._to.axes;
    const f = this._to.camera.f;
    const { u, v } = this._corners;
    const perTurn = this._sourceWidth / (2 * Math.PI);
    const perHalf = this._sourceHeight / Math.PI;
    const columns = this._picture.width / BLOCK;
    const rows = this._picture.height / BLOCK;
    let k = 0;
    for (let row = 0; row <= rows; row++) {
      const b = (height / 2 - (row * height) / rows) / f;
      for (let column = 0; column <= columns; column++, k++) {
        const a = ((column * width) / columns - width / 2) / f;
        const e = a * m[0] + b * m[3] + m[6];
        const n = a * m[1] + b * m[4] + m[7];
        const up = a * m[2] + b * m[5] + m[8];
        u[k] = (Math.atan2(e, n) - this.middle) * perTurn + this._sourceWidth / 2;
        v[k] = (Math.PI / 2 - Math.atan2(up, Math.hypot(e, n))) * perHalf;
      }
    }
  }

  _fill() {
    const { u, v } = this._corners;
    const across = this._picture.width;
    const columns = across / BLOCK;
    const rows = this._picture.height / BLOCK;
    const turn = this._sourceWidth;
    const lowest = this._sourceHeight - 1;
    const source = this._source;
    const pixels = this._pixels;
    for (let row = 0; row < rows; row++) {
      for (let column = 0; column < columns; column++) {
        const k = row * (columns + 1) + column;
        const u00 = u[k];
        // The others within half a turn of the first: a block may lie over the seam.
        const u10 = near(u[k + 1], u00, turn);
        const u01 = near(u[k + columns + 1], u00, turn);
        const u11 = near(u[k + columns + 2], u01, turn);
        const v00 = v[k];
        const v10 = v[k + 1];
        const v01 = v[k + columns + 1];
        const v11 = v[k + columns + 2];
        for (let y = 0; y < BLOCK; y++) {
          const part = (y + 0.5) / BLOCK;
          const left = u00 + part * (u01 - u00);
          const leftV = v00 + part * (v01 - v00);
          const du = (u10 + part * (u11 - u10) - left) / BLOCK;
          const dv = (v10 + part * (v11 - v10) - leftV) / BLOCK;
          let at = (row * BLOCK + y) * across + column * BLOCK;
          let s = left + du / 2 + 2 * turn;
          let t = leftV + dv / 2;
          for (let x = 0; x < BLOCK; x++, s += du, t += dv) {
            const line = t < 0 ? 0 : t > lowest ? lowest : t | 0;
            pixels[at++] = source[line * turn + ((s | 0) % turn)];
          }
        }
      }
    }
  }
}

function near(u, reference, turn) {
  return u - turn * Math.round((u - reference) / turn);
}
