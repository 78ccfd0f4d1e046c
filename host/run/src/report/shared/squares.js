// The picture of the cloud, pixel by pixel: a square for each event, nearer ones before others.

import { palette } from "./colours.js";
import { eachPlace, pointSize } from "./projection.js";

/**
 * Draws the events into an image of so many pixels a unit. Edges are drawn towards white on a dark page,
 * towards black on a light one.
 */
export function drawSquares(image, scene, sides, eye, ratio, isDark) {
  const { width, height } = image;
  const colour = new Uint32Array(image.data.buffer);
  const depths = new Float32Array(colour.length).fill(Infinity);
  const size = Math.max(1, Math.round(pointSize(scene, sides, eye) * ratio));
  eachPlace(scene, sides, eye, (event, x, y, depth, wide, high) => {
    const left = Math.round(x * ratio - (wide * size) / 2);
    const top = Math.round(y * ratio - (high * size) / 2);
    const right = Math.min(width, left + wide * size);
    const bottom = Math.min(height, top + high * size);
    for (let row = Math.max(0, top); row < bottom; row++) {
      for (let at = row * width + Math.max(0, left); at < row * width + right; at++) {
        if (depth < depths[at]) {
          depths[at] = depth;
          colour[at] = palette[scene.levels[event]];
        }
      }
    }
  });
  outline(image.data, depths, width, size, isDark ? 255 : 0);
}

/**
 * Draws edges: squares stand out from those behind them and, unless they are too small
 * for that, from the page.
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
