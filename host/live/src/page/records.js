// The records of frames: little-endian numbers in base64, and the values by pixel that they change.

import { level } from "../../../run/src/report/shared/numbers.js";

/** Values by pixel, before the first event. */
export function emptyPixels(count) {
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
export function takePixels(pixels, base64) {
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

/** Measures the rate of each pixel over the last `seconds`. */
export function takeRates(pixels, seconds) {
  for (let pixel = 0; pixel < pixels.count; pixel++) {
    const more = Math.max(0, pixels.events[pixel] - pixels.before[pixel]);
    pixels.rate[pixel] = more / seconds;
    pixels.before[pixel] = pixels.events[pixel];
  }
}

/** Decodes events of a pixel, 24 bytes each. */
export function eventsFrom(base64) {
  const bytes = bytesOf(base64);
  return Array.from({ length: bytes.byteLength / 24 }, (_, event) => {
    const at = 24 * event;
    const levelAndEcho = bytes.getUint8(at + 18);
    const peak = bytes.getFloat32(at + 12, true);
    return {
      cycle: Number(bytes.getBigUint64(at, true)),
      range: bytes.getFloat32(at + 8, true),
      peak,
      // A change of depth has none of the three.
      exposure: Number.isNaN(peak) ? NaN : bytes.getUint16(at + 16, true),
      level: levelAndEcho >> 4,
      echo: levelAndEcho & 15,
      flags: bytes.getUint8(at + 19),
      background: bytes.getFloat32(at + 20, true),
    };
  });
}

/** Decodes the counts of a histogram, 4 bytes each. */
export function countsFrom(base64) {
  const bytes = bytesOf(base64);
  return Array.from({ length: bytes.byteLength / 4 }, (_, bin) => bytes.getUint32(4 * bin, true));
}

/** The pixels with an event, for the cloud, and the span of their ranges and colours. */
export function cloudOf(pixels) {
  const pixel = [];
  for (let number = 0; number < pixels.count; number++) {
    if (!Number.isNaN(pixels.range[number])) pixel.push(number);
  }
  const range = Float32Array.from(pixel, (number) => pixels.range[number]);
  const [count, [low, high]] = [pixel.length, span(range)];
  const events = { count, range, pixel, level: new Uint8Array(count), cycle: range };
  const levels = Uint8Array.from(range, (one) => level(one, low, high));
  let [nearest, farthest] = count > 0 ? [Infinity, -Infinity] : [0, 1000];
  for (const one of range) [nearest, farthest] = [Math.min(nearest, one), Math.max(farthest, one)];
  return { events, levels, nearest, farthest, low, high };
}

/** From the 2nd to the 98th percentile. */
export function span(values) {
  if (values.length === 0) return [0, 0];
  const sorted = Float32Array.from(values).sort();
  const at = (share) => sorted[Math.round(share * (sorted.length - 1))];
  return [at(0.02), at(0.98)];
}
