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

function drawMaps() {
  drawMap(element("range"), pixels.range, data.low, data.high, "mm", 0);
  const fastest = pixels.rate.reduce((most, rate) => Math.max(most, rate), 0);
  drawMap(element("rate"), pixels.rate, 0, fastest || 1, "/s", 1);
  const isPeak = element("light-of").value === "peak";
  const light = isPeak ? pixels.peak : pixels.reflectivity;
  const [, brightest] = span(light.filter((value) => !Number.isNaN(value)));
  drawMap(element("light"), light, 0, brightest, isPeak ? "photons" : "photons × m²", isPeak ? 0 : 3);
  const range = pixels.range[chosen.pixel];
  const text = Number.isNaN(range) || range === undefined ? "no event yet" : `${number(range, 0)} mm`;
  element("range").setAttribute("aria-label", `Range by pixel. Chosen: ${pixelName(chosen.pixel)}, ${text}`);
  element("rate").setAttribute("aria-label", `Events a second by pixel, up to ${number(fastest, 1)}`);
  element("light").setAttribute("aria-label", `${isPeak ? "Photons of the peak" : "Relative reflectivity"} by pixel`);
}
