// The events of the page, in order of laser cycle, and what is common to all that shows them.

const data = JSON.parse(element("data").textContent);
const events = decode(numbersOf(data.packed), data.count);
const decisions = data.histograms ? decodeDecisions(data.histograms) : [];
// Their places in the colours.
const levels = Uint8Array.from(events.range, (range) => level(range, data.low, data.high));
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

/** Gives one number after the other: digits of three bits, the lowest first, two a byte. */
function numbersOf(base64) {
  const text = atob(base64);
  let at = 0;
  return () => {
    for (let [number, weight] = [0, 1]; ; weight *= 8) {
      const digit = (text.charCodeAt(at >> 1) >> (at & 1 ? 4 : 0)) & 15;
      at += 1;
      number += (digit & 7) * weight;
      if (digit < 8) return number;
    }
  };
}

/** A number that may be less than zero, in 1/256. */
function signed(number) {
  return (number % 2 ? -(number + 1) / 2 : number / 2) / 256;
}

/** Columns of equal length. */
function decode(next, count) {
  const columns = {
    count,
    cycle: new Float64Array(count),
    range: new Float64Array(count),
    pixel: new Uint16Array(count),
    level: new Uint8Array(count), // a block of 2^level pixels a side begins at its pixel
    echo: new Uint8Array(count),
    flags: new Uint8Array(count),
    exposure: new Uint16Array(count),
    peak: new Uint32Array(count),
  };
  let cycle = 0;
  for (let index = 0; index < count; index++) {
    columns.cycle[index] = cycle += next();
    columns.pixel[index] = next();
    const kind = next();
    columns.echo[index] = (kind & 3) + 1;
    columns.level[index] = (kind >> 2) & 3;
    columns.flags[index] = kind >> 4;
    columns.exposure[index] = next();
    columns.range[index] = signed(next());
    columns.peak[index] = next();
  }
  return columns;
}

/** What the last event of each pixel and block was decided from. */
function decodeDecisions({ packed, count, bins, quadrants, deadTime }) {
  const next = numbersOf(packed);
  const ranges = (many) => Array.from({ length: many }, () => [next(), next()]);
  return Array.from({ length: count }, () => {
    const [pixel, kind, cycle, exposure] = [next(), next(), next(), next()];
    const [range, bin, needed, background, width] = [signed(next()), next(), next() - 1, signed(next()), next()];
    const first = width > 0 ? next() : 0;
    const leftOut = ranges(next());
    const counts = Array.from({ length: bins }, next);
    const level = (kind >> 2) & 3;
    const look = {
      peak: [bin, counts[bin]], needed: needed < 0 ? null : needed, background, quadrants,
      window: width > 0 ? [first, first + width - 1] : null,
      // Blocks are not weighed.
      dead_time: level === 0 ? deadTime : 0,
    };
    return { pixel, cycle, exposure, range, counts, leftOut, look,
      level, echo: (kind & 3) + 1, flags: kind >> 4 };
  });
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
  return holds(events.pixel[event], events.level[event], pixel);
}

/** Whether the block of a level that begins with `first` has the pixel. */
function holds(first, level, pixel) {
  const of = (address) => {
    const row = Math.floor(address / data.columns);
    return [(address - row * data.columns) >> level, row >> level];
  };
  const [[column, row], [x, y]] = [of(first), of(pixel)];
  return column === x && row === y;
}

/** Which block it is of, and which echo, as far as there is something to say. */
function kindName({ pixel, level, echo }) {
  const side = 1 << level;
  const block = side > 1 ? `${side}×${side} block from ` : "";
  return `${block}${pixelName(pixel)}${manyEchoes ? `, echo ${echo}` : ""}`;
}

/** One event with all that is known of it. */
function eventOf(index) {
  const { cycle, range, pixel, level, echo, flags, exposure, peak } = events;
  return { cycle: cycle[index], range: range[index], pixel: pixel[index], level: level[index], echo: echo[index],
    flags: flags[index], exposure: exposure[index], peak: peak[index], background: NaN };
}

/** A laser cycle as a time, in the unit of the run. */
const clock = timeUnit(data.cycles, data.laserHz);
function timeOf(cycle) {
  return `${number(cycle / clock.per, 4)} ${clock.unit}`;
}
