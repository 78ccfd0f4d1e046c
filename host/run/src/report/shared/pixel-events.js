// The events of a pixel: their texts, and the span of their ranges.

import { fixed, number } from "./numbers.js";

const FLAGS = ["saturated", "clipped", "deferred", "pile-up", "tail", "confirmed"];
const CONFIRMED = 1 << FLAGS.indexOf("confirmed");

/** Whether an event has a flag that casts doubt on it: any but confirmed. */
export function isDoubtful({ flags }) {
  return (flags & ~CONFIRMED) !== 0;
}

/** The lowest and the highest range of events, with some room. */
export function spanOfRanges(events) {
  let [low, high] = [Infinity, -Infinity];
  for (const { range } of events) [low, high] = [Math.min(low, range), Math.max(high, range)];
  const room = Math.max(5, (high - low) * 0.1);
  return [low - room, high + room];
}

/** The flags of an event, and what it is of. */
export function remarks({ flags, level, echo }) {
  const all = FLAGS.filter((_, bit) => flags & (1 << bit));
  if (level > 0) all.push(`${1 << level}×${1 << level} block`);
  if (echo > 1) all.push(`echo ${echo}`);
  return all.join(", ");
}

/** The cells of a table with these columns, newest event first, of the last 30. */
export function cellsOf(columns, events, timeOf) {
  const measured = (value) => (Number.isNaN(value) ? "–" : number(value));
  const cell = {
    time: timeOf,
    cycle: (event) => number(event.cycle),
    range: (event) => fixed(event.range, 1),
    peak: (event) => measured(event.peak),
    background: (event) => measured(event.background),
    exposure: (event) => measured(event.exposure),
    flags: remarks,
  };
  return events.slice(-30).reverse().map((event) => columns.map((column) => cell[column](event)));
}
