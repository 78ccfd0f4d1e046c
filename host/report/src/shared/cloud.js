// The point cloud: a box with axes, and a square for each event, nearer ones before others.

const cloud = element("cloud");
const points = document.createElement("canvas");
const palette = palette32();
const dark = matchMedia("(prefers-color-scheme: dark)");
/** The event that was clicked, none at first. */
let picked = -1;

function drawCloud() {
  const { context: lines, width, height, ratio, ink, soft, line } = context(cloud);
  const sides = axes();
  const eye = camera(sides, width, height);
  drawBox(lines, sides, eye, line);
  drawPoints(sides, eye, ratio);
  lines.drawImage(points, 0, 0, width, height);
  drawAxes(lines, sides, eye, { ink, soft });
  if (picked >= shown.first && picked < shown.last) {
    const mark = (event, x, y, depth, wide, high) => {
      lines.strokeStyle = ink;
      lines.lineWidth = 2;
      const [right, below] = [wide, high].map((count) =>
        count > 1 ? Math.max(7, pointSize(sides, eye, count) / 2 + 2) : 7);
      lines.strokeRect(x - right, y - below, 2 * right, 2 * below);
    };
    eachPlace(sides, eye, mark, picked, picked + 1);
  }
}

/** The side of an event's rectangle on the screen that stands for so many pixels. */
function pointSize(sides, eye, count = 1) {
  const cell = (eye.scale * sides[0].length) / data.columns;
  // Surfaces are closed where the third axis is the range.
  const part = view.third === "range" ? 0.9 : 0.55;
  return count * Math.min(10, Math.max(2, part * cell));
}

function drawPoints(sides, eye, ratio) {
  const { width, height } = Object.assign(points, { width: cloud.width, height: cloud.height });
  const target = points.getContext("2d");
  const image = target.createImageData(width, height);
  const colour = new Uint32Array(image.data.buffer);
  const depths = new Float32Array(colour.length).fill(Infinity);
  const size = Math.max(1, Math.round(pointSize(sides, eye) * ratio));
  eachPlace(sides, eye, (event, x, y, depth, wide, high) => {
    const left = Math.round(x * ratio - (wide * size) / 2);
    const top = Math.round(y * ratio - (high * size) / 2);
    const right = Math.min(width, left + wide * size);
    const bottom = Math.min(height, top + high * size);
    for (let row = Math.max(0, top); row < bottom; row++) {
      for (let at = row * width + Math.max(0, left); at < row * width + right; at++) {
        if (depth < depths[at]) {
          depths[at] = depth;
          colour[at] = palette[levels[event]];
        }
      }
    }
  });
  outline(image.data, depths, width, size, dark.matches ? 255 : 0);
  target.putImageData(image, 0, 0);
}

/**
 * Draws edges: squares stand out from those behind them and, unless they are too small
 * for that, from the page. Towards white on a dark page, black on a light one.
 */
function outline(bytes, depths, width, size, edge) {
  const step = 0.04;
  const alone = size > 3 ? 1 : Infinity;
  for (let at = width; at < depths.length - width; at++) {
    const depth = depths[at];
    if (depth === Infinity) continue;
    const [left, right, above, below] =
      [depths[at - 1], depths[at + 1], depths[at - width], depths[at + width]];
    const nearest = Math.min(left, right, above, below);
    const farthest = Math.max(left, right, above, below);
    if (nearest < depth - step || farthest > depth + alone) {
      for (let part = 4 * at; part < 4 * at + 3; part++) {
        bytes[part] += (edge - bytes[part]) * 0.4;
      }
    }
  }
}

/** The colours as an image's data has them, in either byte order. */
function palette32() {
  const bytes = new Uint8Array(4 * colours.length);
  colours.forEach((colour, level) => {
    const [, red, green, blue] = colour.match(/#(..)(..)(..)/);
    bytes.set([red, green, blue].map((hex) => parseInt(hex, 16)), 4 * level);
    bytes[4 * level + 3] = 255;
  });
  return new Uint32Array(bytes.buffer);
}

const ENDS = [-0.5, 0.5];

/** The four edges along one side, each with its two ends. */
function edges(sides, side, eye) {
  const [second, third] = [(side + 1) % 3, (side + 2) % 3];
  const corner = (a, b, c) => {
    const place = [];
    place[side] = a * sides[side].length;
    place[second] = b * sides[second].length;
    place[third] = c * sides[third].length;
    return eye.project(...place);
  };
  return ENDS.flatMap((b) => ENDS.map((c) => ({ from: corner(-0.5, b, c), to: corner(0.5, b, c) })));
}

function drawBox(lines, sides, eye, colour) {
  lines.strokeStyle = colour;
  lines.lineWidth = 1;
  lines.beginPath();
  for (const side of [0, 1, 2]) {
    for (const { from, to } of edges(sides, side, eye)) {
      lines.moveTo(from.x, from.y);
      lines.lineTo(to.x, to.y);
    }
  }
  lines.stroke();
}

/** Numbers and names along the outermost edge of each side, unless it is seen end on. */
function drawAxes(lines, sides, eye, { ink, soft }) {
  const middle = eye.project(0, 0, 0);
  sides.forEach((side, index) => {
    const outermost = (edge) => index === 1
      ? edge.from.x + edge.to.x
      : -(edge.from.y + edge.to.y);
    const { from, to } = edges(sides, index, eye).sort((a, b) =>
      outermost(a) - outermost(b) || b.from.depth - a.from.depth)[0];
    const [x, y] = [to.x - from.x, to.y - from.y];
    const length = Math.hypot(x, y);
    if (length < 30) return;
    // Away from the box, at a right angle.
    let [outX, outY] = [y / length, -x / length];
    const outwards = outX * ((from.x + to.x) / 2 - middle.x) + outY * ((from.y + to.y) / 2 - middle.y);
    if (outwards < 0) [outX, outY] = [-outX, -outY];
    // A text this far from the edge lies just beyond `gap`, whichever way is out.
    const beyond = (gap, wide) => gap + (Math.abs(outX) * wide) / 2 + Math.abs(outY) * 7;
    const write = (text, [atX, atY], gap) => {
      const wide = lines.measureText(text).width;
      const away = beyond(gap, wide);
      lines.fillText(text, atX + away * outX, atY + away * outY);
      return away + beyond(0, wide);
    };
    lines.textAlign = "center";
    lines.textBaseline = "middle";
    lines.strokeStyle = lines.fillStyle = soft;
    let widest = 0;
    // Numbers beside an upright edge need less of it than those below a level one.
    const most = length / (24 + 36 * Math.abs(outY));
    const per = side.per ?? 1;
    for (const value of ticks(side.low / per, side.high / per, most, side.whole)) {
      const at = share(value * per, side.low, side.high);
      const tick = [from.x + at * x, from.y + at * y];
      lines.beginPath();
      lines.moveTo(...tick);
      lines.lineTo(tick[0] + 5 * outX, tick[1] + 5 * outY);
      lines.stroke();
      widest = Math.max(widest, write(number(value, 4), tick, 8));
    }
    lines.fillStyle = ink;
    write(side.name, [(from.x + to.x) / 2, (from.y + to.y) / 2], widest + 5);
  });
}

/** The event that is seen at a place of the canvas, -1 if there is none. */
function eventAt(x, y) {
  const sides = axes();
  const eye = camera(sides, cloud.clientWidth, cloud.clientHeight);
  const reach = Math.max(6, pointSize(sides, eye));
  let [found, best] = [-1, Infinity];
  const size = pointSize(sides, eye);
  eachPlace(sides, eye, (event, atX, atY, depth, wide, high) => {
    // From the nearest pixel of a block.
    const beyond = (off, count) => Math.max(0, Math.abs(off) - ((count - 1) * size) / 2);
    const away = Math.max(beyond(atX - x, wide), beyond(atY - y, high));
    // The nearer of two, unless the pointer is closer to the other.
    const cost = away + 10 * depth;
    if (away <= reach && cost < best) [found, best] = [event, cost];
  });
  return found;
}
