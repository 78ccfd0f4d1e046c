// Searching the events of the page, which are columns in order of laser cycle.

import { holds, pixelName } from "../shared/array.js";

/** The first event at laser cycle `cycle` or after it. */
export function firstFrom(events, cycle) {
  let [low, high] = [0, events.count];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (events.cycle[middle] < cycle) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** The events of a pixel, and of blocks with it, by their index. */
export function indicesOf(events, array, pixel) {
  const found = [];
  for (let event = 0; event < events.count; event++) {
    if (holds(array, events.pixel[event], events.level[event], pixel)) found.push(event);
  }
  return found;
}

/** One event with all that is known of it. */
export function eventOf(events, index) {
  const { cycle, range, pixel, level, echo, flags, exposure, peak } = events;
  return { cycle: cycle[index], range: range[index], pixel: pixel[index], level: level[index], echo: echo[index],
    flags: flags[index], exposure: exposure[index], peak: peak[index], background: NaN };
}

/** How many of the events from first to before last are not farther than `far`. */
export function countUntil(events, { first, last, far }) {
  let count = 0;
  for (let event = first; event < last; event++) {
    if (events.range[event] <= far) count++;
  }
  return count;
}

/** Which block an event is of, and which echo, as far as there is something to say. */
export function kindName(array, { pixel, level, echo }, manyEchoes) {
  const side = 1 << level;
  const block = side > 1 ? `${side}×${side} block from ` : "";
  return `${block}${pixelName(array, pixel)}${manyEchoes ? `, echo ${echo}` : ""}`;
}
