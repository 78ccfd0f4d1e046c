// The run of the page, and what of it is shown.

import { element } from "../shared/dom.js";
import { level, number, timeUnit } from "../shared/numbers.js";
import { newView } from "../shared/turning.js";
import { decodeDecisions, decodeEvents } from "./decode.js";
import { firstFrom } from "./events.js";

/** The array, the settings and the packed events. */
export const data = JSON.parse(element("data").textContent);
export const events = decodeEvents(data);
export const decisions = data.histograms ? decodeDecisions(data.histograms) : [];
export const manyEchoes = events.echo.some((echo) => echo > 1);

/** A laser cycle as a time, in the unit of the run. */
export const clock = timeUnit(data.cycles, data.laserHz);
export function timeOf(cycle) {
  return `${number(cycle / clock.per, 4)} ${clock.unit}`;
}

/**
 * What is shown: laser cycles from start to before end, which are the events from first to
 * before last, and of these the ones no farther than far, in millimetres.
 */
export const shown = { start: 0, end: data.cycles, first: 0, last: events.count, far: Infinity };

/** Shows laser cycles from start to before end. */
export function showWindow(start, end) {
  Object.assign(shown, { start, end, first: firstFrom(events, start), last: firstFrom(events, end) });
}

/** Whether a part of the run is shown. */
export function isPart() {
  return shown.start > 0 || shown.end < data.cycles;
}

// All ranges, beyond the colours too.
const [nearest, farthest] = events.range.reduce(
  ([low, high], range) => [Math.min(low, range), Math.max(high, range)], [Infinity, -Infinity]);
// Their places in the colours.
const levels = Uint8Array.from(events.range, (range) => level(range, data.low, data.high));

/** What the cloud draws. */
export const scene = { columns: data.columns, rows: data.rows, sides: data.sides, events, levels, nearest, farthest,
  shown, clock, view: newView() };
