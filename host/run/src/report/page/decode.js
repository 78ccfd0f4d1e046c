// The packed data of the page.

/** Gives one number after the other: digits of three bits, the lowest first, two a byte. */
export function numbersOf(base64) {
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

/** The events in order of laser cycle, as columns of equal length. */
export function decodeEvents({ packed, count }) {
  const next = numbersOf(packed);
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
export function decodeDecisions({ packed, count, bins, quadrants, deadTime }) {
  const next = numbersOf(packed);
  const ranges = (many) => Array.from({ length: many }, () => [next(), next()]);
  return Array.from({ length: count }, () => {
    const [pixel, kind, cycle, exposure] = [next(), next(), next(), next()];
    const [range, bin, needed, background, width] = [signed(next()), next(), next() - 1, signed(next()), next()];
    const first = width > 0 ? next() : 0;
    const leftOut = ranges(next());
    const counts = Array.from({ length: bins }, next);
    const level = (kind >> 2) & 3;
    // Blocks are not weighed.
    const weighed = level === 0 ? deadTime : 0;
    const look = {
      peak: [bin, counts[bin]], needed: needed < 0 ? null : needed, background, quadrants,
      window: width > 0 ? [first, first + width - 1] : null,
      dead_time: weighed,
      depends: needed < 0 && weighed === 0,
    };
    return { pixel, cycle, exposure, range, counts, leftOut, look,
      level, echo: (kind & 3) + 1, flags: kind >> 4 };
  });
}
