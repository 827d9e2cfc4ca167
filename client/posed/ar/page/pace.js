/** What a frame's script costs and when frames are drawn: one when there is something new, the next while it moves. */

const KEPT = 240;

export class Pace {
  /** @param {function(number): boolean} draw  draws a frame; returns whether the next will differ by itself */
  constructor(draw) {
    this._draw = draw;
    this._isAsked = false;
    this._took = new Float64Array(KEPT);
    this._frames = 0;
    this._tick = (at) => this._run(at);
  }

  /** Have a frame drawn when the screen takes the next one. */
  wake() {
    if (this._isAsked) return;
    this._isAsked = true;
    requestAnimationFrame(this._tick);
  }

  get frames() {
    return this._frames;
  }

  /** Script time of the last 240 frames, ms: median and 95th percentile; NaN before the first. */
  script() {
    const sorted = this._took.slice(0, Math.min(this._frames, KEPT)).sort();
    const part = (share) => sorted[Math.min(Math.floor(share * sorted.length), sorted.length - 1)] ?? NaN;
    return { p50: part(0.5), p95: part(0.95) };
  }

  _run() {
    const start = performance.now();
    this._isAsked = false;
    if (this._draw()) this.wake();
    this._took[this._frames++ % KEPT] = performance.now() - start;
  }
}
