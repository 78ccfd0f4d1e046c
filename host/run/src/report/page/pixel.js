// The range of each pixel at a time, and the chosen pixel: its events, and the histogram that the
// last of them was decided from.

import { pixelName } from "../shared/array.js";
import { element } from "../shared/dom.js";
import { drawHistogram } from "../shared/histogram.js";
import { drawMap } from "../shared/maps.js";
import { number } from "../shared/numbers.js";
import { spanOfRanges } from "../shared/pixel-events.js";
import { drawRanges, fillEvents } from "../shared/ranges.js";
import { decisionOf, histogramNote, rangesNote } from "./decisions.js";
import { eventOf, firstFrom, indicesOf } from "./events.js";
import { emptyMap, mapUntil } from "./history.js";
import { clock, data, decisions, events, isPart, manyEchoes, shown, timeOf } from "./run.js";

export const chosen = { pixel: -1, events: [], decision: null };
export const map = emptyMap(data);

// Which events the map is of, if not of all.
element("map-of").value =
  (data.oneOf > 1 ? ` among the 1 in ${number(data.oneOf)} that this report has` : "") +
  (manyEchoes && !data.isChosen ? "; of several echoes the first" : "");

/** Takes the events before a laser cycle into the map. */
export function showRangesUntil(cycle) {
  const end = cycle >= data.cycles ? events.count : firstFrom(events, cycle);
  mapUntil(map, data, events, end, data.isChosen);
}

export function drawRangeMap() {
  showRangesUntil(shown.end);
  drawMap(element("map"), data, chosen.pixel, map.range, { low: data.low, high: data.high, unit: "mm", digits: 0 });
  element("map-time").value = isPart() ? `at ${timeOf(shown.end)}` : "at the end";
  const range = map.range[chosen.pixel];
  const text = Number.isNaN(range) ? `no ${data.event} yet` : `${number(range)} mm`;
  element("map").setAttribute("aria-label", `Range by pixel. Chosen: ${pixelName(data, chosen.pixel)}, ${text}`);
}

/** All events of a pixel, those of its blocks as well. */
function eventsOf(pixel) {
  return indicesOf(events, data, pixel).map((index) => eventOf(events, index));
}

/** Looks at another pixel. */
export function lookAt(pixel) {
  const decision = decisionOf(data, decisions, pixel);
  Object.assign(chosen, { pixel, events: eventsOf(pixel), decision });
  // Of thinned events the last one is there all the same.
  const last = chosen.events.at(-1);
  if (data.oneOf > 1 && !data.isChosen && decision?.cycle > (last?.cycle ?? -1)) {
    chosen.events.push({ ...decision, peak: decision.look.peak[1] });
  }
  element("pixel-name").value = `${pixel}: ${pixelName(data, pixel)}`;
  const table = element("events");
  fillEvents(table, chosen.events, (event) => number(event.cycle / clock.per, 4));
  table.closest(".scrolls").hidden = chosen.events.length === 0;
  element("histogram-note").textContent = histogramNote(data, chosen, manyEchoes, timeOf);
}

export function drawPixel() {
  const { start: from, end } = shown;
  const now = isPart() ? end : undefined;
  const axes = { laserHz: data.laserHz, first: 0, last: data.cycles, from, now };
  element("ranges-note").textContent = rangesNote(data, chosen, now, timeOf);
  drawRanges(element("ranges"), chosen.events, axes);
  drawHistogram(element("histogram"), chosen.decision, data.histograms?.gate);
  for (const plot of element("few").children) {
    plot.setAttribute("aria-pressed", plot.pixel === chosen.pixel);
    drawRanges(plot.lastChild, plot.events, { ...axes, span: spanOfAll, isSmall: true });
  }
}

/** What all plots of few pixels have in common. */
const spanOfAll = data.isFew ? spanOfRanges(Array.from(events.range, (range) => ({ range }))) : null;

/** Adds a plot for each of few pixels, which calls `choose`. */
export function addFew(choose) {
  const count = data.columns * data.rows;
  for (let pixel = 0; pixel < count; pixel++) {
    const plot = document.createElement("button");
    plot.type = "button";
    const [name, canvas] = [document.createElement("span"), document.createElement("canvas")];
    canvas.setAttribute("aria-hidden", "true");
    Object.assign(plot, { pixel, events: eventsOf(pixel) });
    name.textContent = `${pixelName(data, pixel)}: ${number(plot.events.length)} ${data.events}`;
    plot.append(name, canvas);
    plot.addEventListener("click", () => choose(pixel));
    element("few").append(plot);
  }
  element("few").style.setProperty("--columns", data.columns);
  element("few").classList.toggle("as-array", data.columns <= 4);
}
