/** What mouse, touch and pen do on the view: tap a place, drag a dot. */

const TAP_PX = 8;
const GRAB_PX = 30;

/**
 * @typedef {Object} Gestures
 * @property {function(number, number): void} tapped
 * @property {function(number, number, number): boolean} grabbed  x, y and reach: whether there is something to drag
 * @property {function(number, number): void} dragged
 * @property {function(?number, ?number): void} dropped  nulls if the drag was broken off
 */

/** @param {HTMLElement} stage  @param {Gestures} gestures */
export function listenTo(stage, gestures) {
  let pointer = null;
  let startX = 0;
  let startY = 0;
  let isDrag = false;
  let isTap = false;

  stage.addEventListener("pointerdown", (event) => {
    if (pointer !== null || event.button !== 0) return;
    pointer = event.pointerId;
    startX = event.clientX;
    startY = event.clientY;
    isTap = true;
    isDrag = gestures.grabbed(startX, startY, GRAB_PX);
    stage.setPointerCapture(pointer);
  });
  stage.addEventListener("pointermove", (event) => {
    if (event.pointerId !== pointer) return;
    if (Math.hypot(event.clientX - startX, event.clientY - startY) > TAP_PX) isTap = false;
    if (isDrag && !isTap) gestures.dragged(event.clientX, event.clientY);
  });
  const end = (event) => {
    if (event.pointerId !== pointer) return;
    pointer = null;
    const isBroken = event.type === "pointercancel";
    if (isDrag) gestures.dropped(isBroken || isTap ? null : event.clientX, isBroken || isTap ? null : event.clientY);
    if (isTap && !isBroken) gestures.tapped(event.clientX, event.clientY);
  };
  stage.addEventListener("pointerup", end);
  stage.addEventListener("pointercancel", end);
}
