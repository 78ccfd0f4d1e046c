// The chosen pixel of a live source, and the maps.

import { pixelName } from "../../../run/src/report/shared/array.js";
import { element } from "../../../run/src/report/shared/dom.js";
import { drawHistogram } from "../../../run/src/report/shared/histogram.js";
import { drawMap } from "../../../run/src/report/shared/maps.js";
import { number } from "../../../run/src/report/shared/numbers.js";
import { drawRanges, fillEvents } from "../../../run/src/report/shared/ranges.js";
import { histogramNote, rangesNote } from "./notes.js";
import { span } from "./records.js";
import { chosen, live, scene } from "./state.js";

export function drawMaps() {
  const { pixels } = live;
  const map = (id, values, scale) => drawMap(element(id), scene, chosen.pixel, values, scale);
  map("range", pixels.range, { low: scene.low, high: scene.high, unit: "mm", digits: 0 });
  const fastest = pixels.rate.reduce((most, rate) => Math.max(most, rate), 0);
  map("rate", pixels.rate, { low: 0, high: fastest || 1, unit: "/s", digits: 1 });
  const isPeak = element("light-quantity").value === "peak";
  const light = isPeak ? pixels.peak : pixels.reflectivity;
  const [, high] = span(light.filter((value) => !Number.isNaN(value)));
  map("light", light, { low: 0, high, unit: isPeak ? "photons" : "photons × m²", digits: isPeak ? 0 : 3 });
  const range = pixels.range[chosen.pixel];
  const text = Number.isNaN(range) || range === undefined ? "no event yet" : `${number(range, 0)} mm`;
  const label = (id, text) => element(id).setAttribute("aria-label", text);
  label("range", `Range by pixel. Chosen: ${pixelName(scene, chosen.pixel)}, ${text}`);
  label("rate", `Events a second by pixel, up to ${number(fastest, 1)}`);
  label("light", `${isPeak ? "Photons of the peak" : "Relative reflectivity"} by pixel`);
}

export function drawChosen() {
  const { source, pixels } = live;
  element("histogram").hidden = source?.kind === "recording";
  element("histogram-note").textContent = histogramNote(source, chosen.histogram);
  drawHistogram(element("histogram"), chosen.histogram, source?.settings?.gate);
  element("ranges-note").textContent = rangesNote(chosen, Number.isNaN(pixels.range[chosen.pixel]));
  const [first, last] = [chosen.events[0]?.cycle ?? 0, chosen.events.at(-1)?.cycle ?? 0];
  drawRanges(element("ranges"), chosen.events, { laserHz: source?.laserHz, first, last });
  fillEvents(element("events"), chosen.events, (event) => number(event.cycle));
}
