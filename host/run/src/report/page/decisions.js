// The histograms of the page: which pixels have one, and what is said of it.

import { holds, pixelName } from "../shared/array.js";
import { needsOf } from "../shared/looks.js";
import { fixed, number } from "../shared/numbers.js";
import { kindName } from "./events.js";

/** Whether the histograms of a pixel are in this report. */
export function isKept({ columns, histograms }, pixel) {
  const every = histograms?.every ?? 0;
  return (pixel % columns) % every === 0 && Math.floor(pixel / columns) % every === 0;
}

/** The latest decision of a pixel or a block with it, null without. */
export function decisionOf(data, decisions, pixel) {
  if (!isKept(data, pixel)) return null;
  const all = decisions.filter(({ pixel: first, level }) => holds(data, first, level, pixel));
  // A smaller block says more than a larger one.
  return all.reduce((best, one) => (!best || one.cycle > best.cycle ? one : best), null);
}

/** The pixel of the first look: the first of these with a histogram, or the next to them. */
export function firstPixel(data, decisions, preferred) {
  const { columns } = data;
  const [column, row] = [preferred[0] % columns, Math.floor(preferred[0] / columns)];
  const distance = (pixel) => Math.hypot((pixel % columns) - column, Math.floor(pixel / columns) - row);
  const kept = decisions.map(({ pixel }) => pixel).filter((pixel) => isKept(data, pixel));
  return preferred.find((pixel) => decisionOf(data, decisions, pixel)) ??
    kept.reduce((best, one) => (distance(one) < distance(best) ? one : best), kept[0] ?? preferred[0]);
}

/** The text above the histogram of the chosen pixel. */
export function histogramNote(data, { pixel, events, decision }, manyEchoes, timeOf) {
  if (!data.histograms) return `No histograms: these ${data.events} were decided on a device.`;
  if (!isKept(data, pixel)) {
    const { every } = data.histograms;
    const nearest = (place) => place - (place % every);
    const row = nearest(Math.floor(pixel / data.columns));
    const near = pixelName(data, row * data.columns + nearest(pixel % data.columns));
    return `No histogram: to stay small, the report has those of every ${every} columns and rows. The next is that of ${near}.`;
  }
  if (!decision) return `No histogram: the pixel has no ${data.event}.`;
  const { peak: [bin, photons], background, dead_time: deadTime, depends } = decision.look;
  const where = deadTime > 0 ? "there" : "a bin";
  const whose = decision.level > 0 || decision.echo > 1 ? ` (${kindName(data, decision, manyEchoes)})` : "";
  // A report of one echo of an exposure has the histogram of whichever came last.
  const isOfIt = (event) => event.cycle === decision.cycle && event.echo === decision.echo;
  const isShown = !data.isChosen || data.oneOf > 1 || events.some(isOfIt);
  const hidden = isShown ? "," : `, echo ${decision.echo}, which is not shown,`;
  const above = depends ? "" : `, with ${number(background, 2)} of background ${where}`;
  return `Histogram of the last ${data.event}${whose}${hidden} at ${timeOf(decision.cycle)}, of ${number(decision.exposure)} ` +
    `laser cycles: ${fixed(decision.range, 1)} mm. Peak: ${number(photons)} photons in bin ${bin}; ` +
    `${needsOf(decision.look)}${above}.`;
}

/** The text above the ranges of the chosen pixel; until `now` if a part of the run is shown. */
export function rangesNote(data, { events }, now, timeOf) {
  const count = events.length;
  if (count === 0) return `The pixel has no ${data.event}${data.oneOf > 1 ? " among those shown" : ""}.`;
  const thinned = data.oneOf > 1 ? ` (1 of ${number(data.oneOf)})` : "";
  const all = `${number(count)} ${count > 1 ? data.events : data.event}${thinned}`;
  if (now === undefined) return `Range against time: ${all}. Hollow ones have a flag other than confirmed.`;
  const last = events.findLast((event) => event.cycle < now);
  const text = last ? `${fixed(last.range, 1)} mm, reported at ${timeOf(last.cycle)}` : `no ${data.event} yet`;
  return `Range against time: ${all}. At ${timeOf(now)}: ${text}.`;
}
