/** Angles as people write and read them: degrees; degrees, minutes and seconds; gon. */

const DEGREE = Math.PI / 180;
const GON = Math.PI / 200;

/** @typedef {"deg"|"dms"|"gon"} Unit */

/** An angle in rad as text; NaN is a dash. The digits are those of degrees, of seconds or of gon. */
export function format(rad, unit, digits) {
  if (!Number.isFinite(rad)) return "–";
  if (unit === "dms") return formatDms(rad / DEGREE, digits);
  const text = Math.abs(rad / (unit === "gon" ? GON : DEGREE)).toFixed(digits);
  // No sign on what rounds to zero.
  return `${rad < 0 && Number(text) !== 0 ? "−" : ""}${text}${unit === "gon" ? " gon" : "°"}`;
}

/** The same for a bearing: never a full circle, which rounding could make of what is just below it. */
export function formatBearing(rad, unit, digits) {
  if (!Number.isFinite(rad)) return "–";
  const full = 2 * Math.PI;
  const bearing = ((rad % full) + full) % full;
  const step = unit === "dms" ? DEGREE / 3600 : unit === "gon" ? GON : DEGREE;
  return format(bearing >= full - (0.5 * step) / 10 ** digits ? 0 : bearing, unit, digits);
}

/**
 * Read an angle and return it in rad, NaN if the text is none. What carries a unit counts by it (12.5°, 12° 30' 15",
 * 13.9 gon, 12 30 15), a plain number by `unit`. A trailing E or W, N or S gives the sign.
 */
export function parse(text, unit) {
  const plain = text.trim().replaceAll("−", "-").replaceAll(",", ".");
  const [, side = ""] = /[\d°'′"″\s]([ewns])$/iu.exec(plain) ?? [];
  const body = plain.slice(0, plain.length - side.length).trim();
  const gon = /^([-+]?\d+(?:\.\d+)?)\s*(?:gon|g|grad)$/iu.exec(body);
  const single = /^([-+]?\d+(?:\.\d+)?)\s*(?:°|deg)?$/iu.exec(body);
  const parts = /^([-+]?)(\d+)(?:°|\s|:)\s*(\d+(?:\.\d+)?)(?:['′:]|\s|$)\s*(?:(\d+(?:\.\d+)?)\s*(?:"|″|'')?)?$/u.exec(body);
  let rad = NaN;
  if (gon) rad = Number(gon[1]) * GON;
  else if (single) rad = Number(single[1]) * (unit === "gon" && !/[°d]/iu.test(body) ? GON : DEGREE);
  else if (parts) {
    const [, minus, degrees, minutes, seconds = "0"] = parts;
    if (Number(minutes) < 60 && Number(seconds) < 60) {
      rad = (minus === "-" ? -1 : 1) * (Number(degrees) + Number(minutes) / 60 + Number(seconds) / 3600) * DEGREE;
    }
  }
  if (side && rad < 0) return NaN;
  return /^[ws]$/iu.test(side) ? -rad : rad;
}

/** Turn an angle to the nearest of its equals to 0: -pi to pi. */
export function wrap(rad) {
  return Math.atan2(Math.sin(rad), Math.cos(rad));
}

function formatDms(degrees, digits) {
  const scale = 10 ** digits;
  // Rounded as a whole: seconds that round to 60 have to carry.
  const total = Math.round(Math.abs(degrees) * 3600 * scale);
  const seconds = (total % (60 * scale)) / scale;
  const minutes = Math.floor(total / (60 * scale)) % 60;
  const two = (value) => `${value}`.padStart(2, "0");
  const shownSeconds = seconds.toFixed(digits).padStart(digits ? 3 + digits : 2, "0");
  return `${degrees < 0 && total ? "−" : ""}${Math.floor(total / (3600 * scale))}° ${two(minutes)}′ ${shownSeconds}″`;
}
