// The maps: a square for each pixel, the chosen one with a frame.

import { colours, palette } from "./colours.js";
import { contextOf, element } from "./dom.js";
import { level, number } from "./numbers.js";

const picture = document.createElement("canvas");

/** Draws values by pixel, NaN where there is none, and the scale below: from low to high, in a unit. */
export function drawMap(canvas, { columns, rows }, chosen, values, { low, high, unit, digits }) {
  canvas.style.aspectRatio = `${Math.max(1, columns)} / ${Math.max(1, Math.min(rows, columns * 2))}`;
  const { lines, width, height, ink, line } = contextOf(canvas);
  lines.imageSmoothingEnabled = false;
  lines.fillStyle = line;
  lines.fillRect(0, 0, width, height);
  if (values.length > 0) {
    picture.width = columns;
    picture.height = rows;
    const target = picture.getContext("2d");
    const image = target.createImageData(columns, rows);
    const places = new Uint32Array(image.data.buffer);
    values.forEach((value, pixel) => {
      if (!Number.isNaN(value)) places[pixel] = palette[Math.floor(level(value, low, high))];
    });
    target.putImageData(image, 0, 0);
    lines.drawImage(picture, 0, 0, width, height);
    const [wide, tall] = [width / columns, height / rows];
    const [column, row] = [chosen % columns, Math.floor(chosen / columns)];
    const size = [Math.max(6, wide), Math.max(6, tall)];
    const corner = [(column + 0.5) * wide - size[0] / 2, (row + 0.5) * tall - size[1] / 2];
    lines.lineWidth = 4;
    lines.strokeStyle = "#fff";
    lines.strokeRect(...corner, ...size);
    lines.lineWidth = 2;
    lines.strokeStyle = "#000";
    lines.strokeRect(...corner, ...size);
  } else {
    lines.fillStyle = ink;
    lines.fillText("no array yet", 12, 24);
  }
  const isAny = values.some((value) => !Number.isNaN(value));
  drawScaleOf(canvas.id, isAny ? [low, high] : null, unit, digits);
}

/** The colours from low to high, and what they mean. */
function drawScaleOf(id, ends, unit, digits) {
  const scale = element(`${id}-scale`);
  if (!scale.firstChild) {
    const bar = document.createElement("canvas");
    scale.append(document.createElement("span"), bar, document.createElement("span"));
    bar.setAttribute("aria-hidden", "true");
    [bar.width, bar.height] = [256, 1];
    const lines = bar.getContext("2d");
    colours.forEach((colour, at) => {
      lines.fillStyle = colour;
      lines.fillRect(at, 0, 1, 1);
    });
  }
  const [low, , high] = scale.children;
  low.textContent = ends ? number(ends[0], digits) : "";
  high.textContent = ends ? `${number(ends[1], digits)} ${unit}` : "";
}
