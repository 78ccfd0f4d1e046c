// The page's state: the array, the last event of each pixel, the events of the chosen pixel.

import { newView } from "../../../run/src/report/shared/turning.js";
import { cloudOf, countsFrom, emptyPixels, eventsFrom } from "./records.js";

/** Name, array and settings of the source, and values by pixel. */
export const live = { source: null, pixels: emptyPixels(0) };
export const chosen = { pixel: 0, events: [], drawn: 0, arrived: 0, histogram: null };
/** What the cloud draws: the array, and the pixels with an event. */
export const scene = { columns: 0, rows: 0, sides: ["column", "row"], view: newView(),
  shown: { start: 0, end: 1, first: 0, last: 0, far: Infinity }, ...cloudOf(live.pixels) };
/** Events of the chosen pixel that the page keeps. */
const MOST_KEPT = 2000;

/** Begins with another array or other settings. All pixels will be sent again. */
export function takeSource(source) {
  Object.assign(live, { source, pixels: emptyPixels(source.columns * source.rows) });
  Object.assign(scene, { columns: source.columns, rows: source.rows });
  // Laser cycles begin at 0 again.
  choosePixel(chosen.pixel);
}

/** Chooses a pixel, of which nothing is known yet. */
export function choosePixel(pixel) {
  Object.assign(chosen, { pixel, events: [], drawn: 0, arrived: 0, histogram: null });
}

/** Takes events of the chosen pixel. */
export function takeEvents({ events, drawn, arrived }) {
  chosen.events = [...chosen.events, ...eventsFrom(events)].slice(-MOST_KEPT);
  chosen.drawn += drawn;
  chosen.arrived += arrived;
}

/** Takes a histogram if it is of the chosen pixel. */
export function takeHistogram(news) {
  if (news.pixel !== chosen.pixel) return;
  chosen.histogram = news.counts ? { ...news, counts: countsFrom(news.counts) } : news;
}

/** Takes the pixels into the cloud. */
export function takeCloud() {
  Object.assign(scene, cloudOf(live.pixels));
  scene.shown.last = scene.events.count;
}
