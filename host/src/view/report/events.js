// The events of the page, in order of laser cycle, and what is common to all that shows them.

const data = JSON.parse(element("data").textContent);
const events = decode(data.records, data.unit);
// Their places in the colours: 0 at data.low and below, 255 at data.high and above.
const levels = Uint8Array.from(events.range, (range) =>
  data.high > data.low ? (255 * Math.min(1, Math.max(0, share(range, data.low, data.high)))) + 0.5 : 127,
);
const manyEchoes = events.echo.some((echo) => echo > 1);
// All ranges, beyond the colours too.
const [nearest, farthest] = events.range.reduce(
  ([low, high], range) => [Math.min(low, range), Math.max(high, range)], [Infinity, -Infinity]);
const colours = data.colours.match(/.{6}/g).map((hex) => `#${hex}`);

/**
 * What is shown: laser cycles from start to before end, which are the events from first to
 * before last, and of these the ones no farther than far, in millimetres.
 */
const shown = { start: 0, end: data.cycles, first: 0, last: events.count, far: Infinity };

/** Columns of equal length, from records of eleven little-endian bytes in base64. */
function decode(base64, unit) {
  const text = atob(base64);
  const bytes = new DataView(new ArrayBuffer(text.length));
  for (let at = 0; at < text.length; at++) bytes.setUint8(at, text.charCodeAt(at));
  const record = 11;
  const count = text.length / record;
  const columns = {
    count,
    cycle: new Float64Array(count),
    range: new Float32Array(count),
    pixel: new Uint16Array(count),
    level: new Uint8Array(count), // a block of 2^level pixels a side begins at its pixel
    echo: new Uint8Array(count),
  };
  for (let index = 0; index < count; index++) {
    columns.cycle[index] = bytes.getUint32(record * index, true) * unit;
    columns.range[index] = bytes.getFloat32(record * index + 4, true);
    columns.pixel[index] = bytes.getUint16(record * index + 8, true);
    const levelAndEcho = bytes.getUint8(record * index + 10);
    columns.level[index] = levelAndEcho >> 4;
    columns.echo[index] = levelAndEcho & 15;
  }
  return columns;
}

/** Shows laser cycles from start to before end. */
function showWindow(start, end) {
  const first = firstFrom(start);
  Object.assign(shown, { start, end, first, last: firstFrom(end) });
}

/** The first event at laser cycle `cycle` or after it. */
function firstFrom(cycle) {
  let [low, high] = [0, events.count];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (events.cycle[middle] < cycle) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Whether an event is of the pixel, or of a block with it. */
function isOf(event, pixel) {
  const level = events.level[event];
  const of = (address) => {
    const row = Math.floor(address / data.columns);
    return [(address - row * data.columns) >> level, row >> level];
  };
  const [[column, row], [x, y]] = [of(events.pixel[event]), of(pixel)];
  return column === x && row === y;
}

/** Which block it is of, and which echo, as far as there is something to say. */
function kindName(event) {
  const side = 1 << events.level[event];
  const block = side > 1 ? `${side}x${side} block from ` : "";
  const echo = manyEchoes ? `, echo ${events.echo[event]}` : "";
  return `${block}${pixelName(events.pixel[event])}${echo}`;
}
