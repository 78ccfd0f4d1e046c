// What every page needs: elements, numbers, canvases.

function element(id) {
  return document.getElementById(id);
}

/** Where a value lies between low and high: 0 to 1. */
function share(value, low, high) {
  return (value - low) / (high - low);
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
