/** The newest values from the server, over a WebSocket that comes back by itself. */

const FIRST_RETRY_MS = 200;
const LAST_RETRY_MS = 2000;
// The clocks of browser and server drift by some 10 ppm against each other: 0.05 ms in this time.
const CLOCK_EVERY_MS = 5000;
const CLOCK_TRIES_AT_OPEN = 5;
// Of so many round trips the shortest counts: what a reply was held up by is in its offset as well.
const CLOCK_KEPT = 8;
// Far more than the clocks drift apart while so many are kept.
const CLOCK_SLACK_MS = 1;

/**
 * @typedef {Object} Handlers
 * @property {Object<string, function(any): void>} on  by key of the frame: takes the key's value; called in this order
 * @property {function(): void} [opened]
 * @property {function(boolean): void} [closed]  told whether this socket had ever been open
 */

export class Live {
  /**
   * @param {string} url  of the WebSocket, absolute or relative to the page
   * @param {Handlers} handlers
   */
  constructor(url, handlers) {
    this._url = new URL(url, location.href);
    this._url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    this._handlers = handlers;
    this._retryMs = FIRST_RETRY_MS;
    this._trips = [];
    this._clockTriesLeft = 0;
    /** @type {"CONNECTING"|"OPEN"|"CLOSED"} */
    this.state = "CONNECTING";
    /** Milliseconds to add to performance.now() for the server's boot time; NaN until the first reply. */
    this.offsetMs = NaN;
    /** Half the shortest round trip, ms: the clock offset is not known better than that. */
    this.offsetErrorMs = NaN;
    this._connect();
    setInterval(() => this._askClock(), CLOCK_EVERY_MS);
  }

  /** Return the server's boot time now, ms; NaN while unknown. */
  bootMs() {
    return performance.now() + this.offsetMs;
  }

  /** Send a request, if there is anyone to send it to. */
  send(request) {
    if (this.state === "OPEN") this._socket.send(JSON.stringify(request));
  }

  _connect() {
    this.state = "CONNECTING";
    const socket = new WebSocket(this._url);
    this._socket = socket;
    let wasOpen = false;
    socket.onopen = () => {
      wasOpen = true;
      this.state = "OPEN";
      this._retryMs = FIRST_RETRY_MS;
      // Another server may have another clock: what an earlier one said counts no more.
      this._trips = [];
      this._clockTriesLeft = CLOCK_TRIES_AT_OPEN;
      this._askClock();
      this._handlers.opened?.();
    };
    socket.onmessage = (event) => this._take(JSON.parse(event.data));
    socket.onclose = () => {
      this.state = "CLOSED";
      this._handlers.closed?.(wasOpen);
      setTimeout(() => this._connect(), this._retryMs);
      this._retryMs = Math.min(2 * this._retryMs, LAST_RETRY_MS);
    };
  }

  _take(frame) {
    const at = performance.now();
    if (frame.i !== undefined) this.send({ a: frame.i });
    if ("c" in frame) this._takeClock(frame.c, at);
    for (const key in this._handlers.on) {
      if (key in frame) this._handlers.on[key](frame[key]);
    }
  }

  _askClock() {
    this.send({ c: performance.now() });
  }

  _takeClock(reply, at) {
    const trip = at - reply.c;
    const offset = reply.b - (reply.c + at) / 2;
    // Both cannot be true of one clock: the browser's stands still in suspend. What was before counts no more.
    if (Math.abs(offset - this.offsetMs) > trip / 2 + this.offsetErrorMs + CLOCK_SLACK_MS) this._trips = [];
    this._trips.push({ trip, offset });
    if (this._trips.length > CLOCK_KEPT) this._trips.shift();
    let best = this._trips[0];
    for (const other of this._trips) if (other.trip < best.trip) best = other;
    this.offsetMs = best.offset;
    this.offsetErrorMs = best.trip / 2;
    if (--this._clockTriesLeft > 0) setTimeout(() => this._askClock(), 40);
  }
}
