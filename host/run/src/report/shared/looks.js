// What a rule makes of a histogram.

import { number } from "./numbers.js";

/**
 * What a plot of a histogram shows: bins from `first` to `last` of the gate, the photons at its `top`, the bins
 * left `out`, the `peak`, the `window` or `quadrants`, and the `levels` of the rule with the photons `at` a bin.
 */
export function planOf({ counts, look, leftOut, exposure }, gate) {
  const { peak = [0, 0], background, quadrants = [], window = null, dead_time: deadTime = 0 } = look ?? {};
  const needed = look?.needed ?? null;
  const bins = counts.length;
  const [first, last] = gate ?? [0, bins - 1];
  // A threshold that no photons would reach is not to flatten the rest.
  const most = Math.max(1, ...counts);
  const top = Math.max(4, most, needed !== null && needed < 8 * most + 16 ? needed : 0) * 1.1;
  const out = [[0, first - 1], [last + 1, bins - 1], ...(leftOut ?? [])];
  const levels = [];
  if (needed > 0 && needed < top) levels.push({ name: `${number(needed)} needed`, isNeeded: true, at: () => needed });
  if (background > 0 && deadTime > 0) {
    const live = liveOf(counts, exposure, deadTime);
    const at = (bin) => (background * live[bin]) / live[peak[0]];
    levels.push({ name: `background ${number(background, 1)} at the peak`, isNeeded: false, at });
  } else if (background > 0) {
    levels.push({ name: `background ${number(background, 1)}`, isNeeded: false, at: () => background });
  }
  return { bins, first, last, out, top, peak, window, quadrants, levels };
}

/** Laser cycles in which each bin was live: all but those with a photon in the bins of the dead time before it. */
export function liveOf(counts, cycles, deadTime) {
  return counts.map((_, bin) => {
    const before = counts.slice(Math.max(0, bin - deadTime), bin);
    return Math.max(0, cycles - before.reduce((sum, count) => sum + count, 0));
  });
}

/**
 * What the rule needs in the bin of the peak, all others as they are. Of a window the others may be enough.
 * With tracking, several echoes or neighbours the histogram alone does not tell the number.
 */
export function needsOf({ needed, depends, dead_time: deadTime }) {
  if (depends) return "the required number depends on earlier events or on neighbours";
  if (deadTime > 0) return "the rule weighs each bin by the laser cycles in which it was live";
  if (needed === null) return "no number is enough";
  return needed === 0 ? "the bins beside it are enough for the rule" : `the rule needs ${number(needed)}`;
}
