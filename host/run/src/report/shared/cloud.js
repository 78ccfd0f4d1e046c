// The point cloud: a box with axes, and the events in it.

import { contextOf, dark } from "./dom.js";
import { number, share, ticks } from "./numbers.js";
import { axes, camera, eachPlace, pointSize } from "./projection.js";
import { drawSquares } from "./squares.js";

const points = document.createElement("canvas");

/** Draws the scene with a frame around the event `picked`, which may be -1. */
export function drawCloud(canvas, scene, picked) {
  const { lines, width, height, ratio, ink, soft, line } = contextOf(canvas);
  const sides = axes(scene);
  const eye = camera(sides, scene.view, width, height);
  drawBox(lines, sides, eye, line);
  Object.assign(points, { width: canvas.width, height: canvas.height });
  const target = points.getContext("2d");
  const image = target.createImageData(points.width, points.height);
  drawSquares(image, scene, sides, eye, ratio, dark.matches);
  target.putImageData(image, 0, 0);
  lines.drawImage(points, 0, 0, width, height);
  drawAxes(lines, sides, eye, { ink, soft });
  if (picked >= scene.shown.first && picked < scene.shown.last) {
    const mark = (event, x, y, depth, wide, high) => {
      lines.strokeStyle = ink;
      lines.lineWidth = 2;
      const [right, below] = [wide, high].map((count) =>
        count > 1 ? Math.max(7, pointSize(scene, sides, eye, count) / 2 + 2) : 7);
      lines.strokeRect(x - right, y - below, 2 * right, 2 * below);
    };
    eachPlace(scene, sides, eye, mark, picked, picked + 1);
  }
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
