// The page's state: the array, the last event of each pixel, the events of the chosen pixel.

const colours = HEX.match(/.{6}/g).map((hex) => `#${hex}`);
const data = { columns: 0, rows: 0, sides: ["column", "row"], events: "events", low: 0, high: 0 };
/** Name, array and settings of the source. */
let source = null;
/** Values by pixel. */
let pixels = emptyPixels(0);
/** Pixels with an event, for the cloud. */
let events = { count: 0, range: [], pixel: [], level: [], cycle: [] };
let levels = new Uint8Array(0);
let [nearest, farthest] = [0, 1];
const shown = { start: 0, end: 1, first: 0, last: 0, far: Infinity };
const chosen = { pixel: 0, events: [], drawn: 0, arrived: 0, histogram: null };
/** Events of the chosen pixel that the page keeps. */
const MOST_KEPT = 2000;

function emptyPixels(count) {
  return {
    count,
    range: new Float32Array(count).fill(NaN),
    /** Light: NaN if it is not measured. */
    reflectivity: new Float32Array(count).fill(NaN),
    peak: new Float32Array(count).fill(NaN),
    events: new Uint32Array(count),
    rate: new Float32Array(count),
    /** Events at the last measurement of rates. */
    before: new Uint32Array(count),
  };
}

function bytesOf(base64) {
  return new DataView(Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0)).buffer);
}

/** Decodes changed pixels, 20 bytes each. */
function takePixels(base64) {
  const bytes = bytesOf(base64);
  for (let at = 0; at < bytes.byteLength; at += 20) {
    const pixel = bytes.getUint16(at, true);
    if (pixel >= pixels.count) continue;
    pixels.events[pixel] = bytes.getUint32(at + 4, true);
    // Events before a pixel's first record do not count for its rate.
    if (Number.isNaN(pixels.range[pixel])) pixels.before[pixel] = pixels.events[pixel];
    pixels.range[pixel] = bytes.getFloat32(at + 8, true);
    pixels.reflectivity[pixel] = bytes.getFloat32(at + 12, true);
    pixels.peak[pixel] = bytes.getFloat32(at + 16, true);
  }
}

/** Decodes events of the chosen pixel, 24 bytes each. */
function takeEvents(base64) {
  const bytes = bytesOf(base64);
  for (let at = 0; at < bytes.byteLength; at += 24) {
    const levelAndEcho = bytes.getUint8(at + 18);
    const peak = bytes.getFloat32(at + 12, true);
    chosen.events.push({
      cycle: Number(bytes.getBigUint64(at, true)),
      range: bytes.getFloat32(at + 8, true),
      peak,
      // A change of depth has none of the three.
      exposure: Number.isNaN(peak) ? NaN : bytes.getUint16(at + 16, true),
      level: levelAndEcho >> 4,
      echo: levelAndEcho & 15,
      flags: bytes.getUint8(at + 19),
      background: bytes.getFloat32(at + 20, true),
    });
  }
  if (chosen.events.length > MOST_KEPT) chosen.events.splice(0, chosen.events.length - MOST_KEPT);
}

/** Begins with another array or other settings. All pixels will be sent again. */
function takeSource(news) {
  source = news;
  Object.assign(data, { columns: news.columns, rows: news.rows });
  pixels = emptyPixels(news.columns * news.rows);
  // Laser cycles begin at 0 again.
  chosen.events = [];
  chosen.histogram = null;
  [chosen.drawn, chosen.arrived] = [0, 0];
}

/** Measures the rate of each pixel over the last `seconds`. */
function takeRates(seconds) {
  for (let pixel = 0; pixel < pixels.count; pixel++) {
    const more = Math.max(0, pixels.events[pixel] - pixels.before[pixel]);
    pixels.rate[pixel] = more / seconds;
    pixels.before[pixel] = pixels.events[pixel];
  }
}

/** Collects the pixels with an event for the cloud, and the span of their colours. */
function takeCloud() {
  const withEvent = [];
  for (let pixel = 0; pixel < pixels.count; pixel++) {
    if (!Number.isNaN(pixels.range[pixel])) withEvent.push(pixel);
  }
  const range = Float32Array.from(withEvent, (pixel) => pixels.range[pixel]);
  const count = withEvent.length;
  events = { count, range, pixel: withEvent, level: new Uint8Array(count), cycle: range };
  shown.last = count;
  [data.low, data.high] = span(range);
  levels = Uint8Array.from(range, (range) => level(range, data.low, data.high));
  [nearest, farthest] = [Infinity, -Infinity];
  for (const one of range) {
    nearest = Math.min(nearest, one);
    farthest = Math.max(farthest, one);
  }
  if (count === 0) [nearest, farthest] = [0, 1000];
}

/** From the 2nd to the 98th percentile. */
function span(values) {
  if (values.length === 0) return [0, 0];
  const sorted = Float32Array.from(values).sort();
  const at = (share) => sorted[Math.round(share * (sorted.length - 1))];
  return [at(0.02), at(0.98)];
}
