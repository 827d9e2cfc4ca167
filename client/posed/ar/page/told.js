/** What is drawn, told to tests and to users at the browser's console. */

const DEGREE = Math.PI / 180;

/**
 * Return what becomes `window.posedAr`; all of it is read-only, and of the frame drawn last:
 *
 * labels        [{id, name, x, y, visible, truth: {x, y, visible} | null}], nearest first: where the corrected pose
 *               puts each place on the screen (CSS pixels; NaN behind the camera), and where the truth does
 * pose          {sequence, rateMode, headingAccuracyDeg, status, missed, isStale, hz} | null
 * camera        {width, height, fovDeg, rotation, f}; pixels, degrees
 * attitude      {heading, pitch, roll} of the camera by the corrected pose, degrees, true north
 * registration  {deg, px} at the target if it is on the screen, else in the middle; NaN without a truth
 * delay         {publishedToDrawnMs, ageWhenDrawnMs, clockErrorMs} of the newest pose
 * script        {p50, p95, frames}: ms a frame took, of the last 240; frames drawn since the page was opened
 * link          {state, reason} of the way to the daemon
 * target        {id, name, held, bearing, elevation, distance} | null; degrees, m
 * declination   {deg, source}
 * correction    {name, headingOffsetDeg, position}
 * view          "world", "panorama", "photo" or "camera"
 */
export function told({ scene, target, frame, live, pace, delay }) {
  const getters = {
    labels: () =>
      frame.overlay.drawn.map((dot, i) => ({
        ...dot,
        truth: frame.truthNote === null ? whereTruly(scene.places.all[i], frame.background.projector) : null,
      })),
    pose: () =>
      scene.pose && {
        sequence: scene.pose.n,
        rateMode: scene.pose.m,
        headingAccuracyDeg: scene.pose.a,
        status: scene.pose.s,
        missed: scene.pose.x,
        isStale: scene.isStale(performance.now()),
        hz: scene.measuredHz(performance.now()),
      },
    camera: () => {
      const { width, height, fovDeg, rotation, f } = scene.camera;
      return { width, height, fovDeg, rotation, f };
    },
    attitude: () => Object.fromEntries(Object.entries(frame.attitude).map(([key, rad]) => [key, rad / DEGREE])),
    registration: () => ({ ...frame.registration }),
    delay: () => ({
      publishedToDrawnMs: delay.publishedToDrawn,
      ageWhenDrawnMs: delay.ageWhenDrawn,
      clockErrorMs: live.offsetErrorMs,
    }),
    script: () => ({ ...pace.script(), frames: pace.frames }),
    link: () => ({ ...scene.link }),
    target: () => {
      const { bearing, elevation, distance } = frame.sight;
      const { place, isHeld: held } = target;
      return place && { id: place.id, name: place.name, held, bearing: bearing / DEGREE, elevation: elevation / DEGREE, distance };
    },
    declination: () => ({ deg: scene.declination.angle / DEGREE, source: scene.declination.source }),
    correction: () => {
      const { name, headingOffset, position } = scene.correction;
      return { name, headingOffsetDeg: headingOffset / DEGREE, position };
    },
    view: () => frame.background.view,
  };
  const properties = Object.entries(getters).map(([key, get]) => [key, { get, enumerable: true }]);
  return Object.freeze(Object.defineProperties({}, Object.fromEntries(properties)));
}

function whereTruly({ anchor: [e, n, u] }, to) {
  const isAhead = to.point(e, n, u);
  return { x: isAhead ? to.x : NaN, y: isAhead ? to.y : NaN, visible: isAhead && to.isOnScreen() };
}
