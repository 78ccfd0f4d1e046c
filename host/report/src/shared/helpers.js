// What every page needs: elements, numbers, canvases.

function element(id) {
  return document.getElementById(id);
}

/** Where a value lies between low and high: 0 to 1. */
function share(value, low, high) {
  return (value - low) / (high - low);
}

/** The place of a value in the colours: 0 at low and below, 255 at high and above. */
function level(value, low, high) {
  return high > low ? 255 * Math.min(1, Math.max(0, share(value, low, high))) + 0.5 : 127;
}

/** The unit that suits so many laser cycles, and how many it has; laser cycles if the rate is unknown. */
function timeUnit(cycles, laserHz) {
  if (!laserHz) return { unit: "laser cycle", per: 1, isWhole: true };
  const units = [["s", 1], ["ms", 1e-3], ["µs", 1e-6]];
  const [unit, seconds] = units.find(([, seconds]) => cycles / laserHz >= seconds) ?? units.at(-1);
  return { unit, per: seconds * laserHz, isWhole: false };
}

/** Round values from low to high, at most `most` of them. */
function ticks(low, high, most, whole) {
  const least = (high - low) / Math.max(1, most);
  const power = 10 ** Math.floor(Math.log10(least));
  let step = power * [1, 2, 5, 10].find((factor) => factor * power >= least * 0.999);
  if (whole) step = Math.max(1, Math.round(step));
  const values = [];
  for (let at = Math.ceil(low / step) + 0; at * step <= high; at++) values.push(at * step + 0); // never −0
  return values;
}

function number(value, digits = 0) {
  return value.toLocaleString("en", { maximumFractionDigits: digits });
}

/** With so many digits, so that a column of them is in line. */
function fixed(value, digits) {
  return value.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
}

function capital(word) {
  return word[0].toUpperCase() + word.slice(1);
}

function pixelName(pixel) {
  const [column, row] = data.sides;
  return `${column} ${pixel % data.columns}, ${row} ${Math.floor(pixel / data.columns)}`;
}

/** The context of a canvas that has as many pixels as the screen shows of it. */
function context(canvas) {
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = Math.max(1, Math.round(width * ratio));
  canvas.height = Math.max(1, Math.round(height * ratio));
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  const style = getComputedStyle(canvas);
  context.font = `13px ${style.fontFamily}`;
  return { context, width, height, ratio, ink: style.getPropertyValue("--ink"),
    soft: style.getPropertyValue("--soft"), line: style.getPropertyValue("--line") };
}
