// The maps: a square for each pixel, the chosen one with a frame.

/** Draws values by pixel, NaN where there is none, and the scale below. */
function drawMap(canvas, values, low, high, unit, digits) {
  canvas.style.aspectRatio = `${Math.max(1, data.columns)} / ${Math.max(1, Math.min(data.rows, data.columns * 2))}`;
  const { context: lines, width, height, ink, line } = context(canvas);
  lines.imageSmoothingEnabled = false;
  lines.fillStyle = line;
  lines.fillRect(0, 0, width, height);
  if (values.length > 0) {
    mapPicture.width = data.columns;
    mapPicture.height = data.rows;
    const target = mapPicture.getContext("2d");
    const image = target.createImageData(data.columns, data.rows);
    const places = new Uint32Array(image.data.buffer);
    values.forEach((value, pixel) => {
      if (!Number.isNaN(value)) places[pixel] = palette[Math.floor(level(value, low, high))];
    });
    target.putImageData(image, 0, 0);
    lines.drawImage(mapPicture, 0, 0, width, height);
    const [wide, high2] = [width / data.columns, height / data.rows];
    const [column, row] = [chosen.pixel % data.columns, Math.floor(chosen.pixel / data.columns)];
    const size = [Math.max(6, wide), Math.max(6, high2)];
    const corner = [(column + 0.5) * wide - size[0] / 2, (row + 0.5) * high2 - size[1] / 2];
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
const mapPicture = document.createElement("canvas");

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

/** The pixel at the place of a pointer, -1 if there is none. */
function pixelAt(event) {
  const canvas = event.currentTarget;
  const at = (offset, size, count) => Math.min(count - 1, Math.max(0, Math.floor((offset / size) * count)));
  const column = at(event.offsetX, canvas.clientWidth, data.columns);
  const row = at(event.offsetY, canvas.clientHeight, data.rows);
  return data.columns * data.rows > 0 ? row * data.columns + column : -1;
}

/** Moves the chosen pixel by columns and rows. */
function step(columns, rows) {
  const column = (chosen.pixel % data.columns) + columns;
  const row = Math.floor(chosen.pixel / data.columns) + rows;
  const isThere = column >= 0 && column < data.columns && row >= 0 && row < data.rows;
  if (isThere) choose(row * data.columns + column);
}

const STEPS_OF = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
