// A histogram: its bins, the gate, and what the rule makes of it.

import { colours } from "./colours.js";
import { contextOf } from "./dom.js";
import { planOf } from "./looks.js";
import { number, ticks } from "./numbers.js";

/**
 * Draws a histogram: counts by bin, the look of the rule at them, and the ranges of bins that are
 * left out. The gate is its first and its last bin.
 */
export function drawHistogram(canvas, shot, gate) {
  const { lines, width, height, ink, soft, line } = contextOf(canvas);
  if (!shot?.counts) return;
  const box = { left: 46, right: width - 12, top: 44, bottom: height - 36 };
  const { bins, first, last, out, top, peak, window, quadrants, levels } = planOf(shot, gate);
  const x = (bin) => box.left + ((box.right - box.left) * bin) / bins;
  const y = (count) => box.bottom - ((box.bottom - box.top) * count) / top;

  // Outside of the gate, and around earlier echoes.
  lines.fillStyle = line;
  lines.globalAlpha = 0.5;
  for (const [from, to] of out) lines.fillRect(x(from), box.top, x(to + 1) - x(from), box.bottom - box.top);
  lines.globalAlpha = 1;
  drawCounts(lines, box, top, soft, line);
  lines.textAlign = "center";
  for (const bin of ticks(0, bins, (box.right - box.left) / 60, true)) {
    lines.fillText(number(bin), x(bin), box.bottom + 15);
  }
  lines.fillText("bin", (box.left + box.right) / 2, height - 5);
  lines.textAlign = "left";
  lines.fillText("photons", 16, box.top - 8);

  // The window or the quadrants of the rule.
  if (window) {
    const [from, to] = window;
    lines.fillStyle = colours[200];
    lines.globalAlpha = 0.35;
    lines.fillRect(x(from), box.top, x(to + 1) - x(from), box.bottom - box.top);
    lines.globalAlpha = 1;
  } else {
    lines.strokeStyle = soft;
    lines.setLineDash([2, 4]);
    for (const bin of quadrants.slice(1, -1)) {
      lines.beginPath();
      lines.moveTo(x(bin), box.top);
      lines.lineTo(x(bin), box.bottom);
      lines.stroke();
    }
    lines.setLineDash([]);
  }
  shot.counts.forEach((count, bin) => {
    lines.fillStyle = bin === peak[0] && peak[1] > 0 ? ink : colours[110];
    const wide = Math.max(1, x(1) - x(0) - 0.6);
    lines.fillRect(x(bin), y(count), wide, box.bottom - y(count));
  });
  const at = x(peak[0] + 0.5);
  const isLeft = at < (box.left + box.right) / 2;
  if (peak[1] > 0) {
    lines.fillStyle = ink;
    const text = `▾ peak: ${number(peak[1])} in bin ${peak[0]}`;
    const arrow = lines.measureText("▾").width / 2;
    // Above all bars, its arrow over the bin.
    lines.textAlign = isLeft ? "left" : "right";
    const mirrored = `peak: ${number(peak[1])} in bin ${peak[0]} ▾`;
    lines.fillText(isLeft ? text : mirrored, Math.max(isLeft ? 74 : 0, at + (isLeft ? -arrow : arrow)), box.top - 8);
  }
  // Levels, and their names above the bars.
  let next = 16;
  for (const { name, isNeeded, at } of levels) {
    lines.strokeStyle = lines.fillStyle = isNeeded ? ink : soft;
    lines.lineWidth = 1.5;
    lines.setLineDash(isNeeded ? [] : [4, 4]);
    lines.beginPath();
    for (let bin = first; bin <= last; bin++) {
      lines.lineTo(x(bin), y(at(bin)));
      lines.lineTo(x(bin + 1), y(at(bin)));
    }
    lines.moveTo(next, 10);
    lines.lineTo(next + 20, 10);
    lines.stroke();
    lines.setLineDash([]);
    lines.textAlign = "left";
    lines.fillText(name, next + 26, 14);
    next += 42 + lines.measureText(name).width;
  }
}

/** The numbers of an upright axis from 0 to top. */
function drawCounts(lines, box, top, soft, line) {
  lines.fillStyle = soft;
  lines.strokeStyle = line;
  lines.textAlign = "right";
  lines.textBaseline = "alphabetic";
  for (const count of ticks(0, top, (box.bottom - box.top) / 34, true)) {
    const at = box.bottom - ((box.bottom - box.top) * count) / top;
    lines.fillText(number(count), box.left - 6, at + 4);
    lines.beginPath();
    lines.moveTo(box.left, at);
    lines.lineTo(box.right, at);
    lines.stroke();
  }
}
