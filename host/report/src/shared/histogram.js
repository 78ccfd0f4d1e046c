// A histogram: its bins, the gate, and what the rule makes of it.

/**
 * Draws a histogram: counts by bin, the look of the rule at them, and the ranges of bins that are
 * left out. The gate is its first and its last bin.
 */
function drawHistogram(canvas, shot, gate) {
  const { context: lines, width, height, ink, soft, line } = context(canvas);
  if (!shot?.counts) return;
  const box = { left: 46, right: width - 12, top: 44, bottom: height - 36 };
  const bins = shot.counts.length;
  const { peak = [0, 0], needed = null, background = null, quadrants = [], dead_time: deadTime = 0 } = shot.look ?? {};
  // A threshold that no photons would reach is not to flatten the rest.
  const most = Math.max(1, ...shot.counts);
  const top = Math.max(4, most, needed !== null && needed < 8 * most + 16 ? needed : 0) * 1.1;
  const x = (bin) => box.left + ((box.right - box.left) * bin) / bins;
  const y = (count) => box.bottom - ((box.bottom - box.top) * count) / top;
  const [first, last] = gate ?? [0, bins - 1];

  // Outside of the gate, and around earlier echoes.
  lines.fillStyle = line;
  lines.globalAlpha = 0.5;
  for (const [from, to] of [[0, first - 1], [last + 1, bins - 1], ...(shot.leftOut ?? [])]) {
    lines.fillRect(x(from), box.top, x(to + 1) - x(from), box.bottom - box.top);
  }
  lines.globalAlpha = 1;
  axisOf(lines, box, top, soft, line);
  lines.textAlign = "center";
  for (const bin of ticks(0, bins, (box.right - box.left) / 60, true)) {
    lines.fillText(number(bin), x(bin), box.bottom + 15);
  }
  lines.fillText("bin", (box.left + box.right) / 2, height - 5);
  lines.textAlign = "left";
  lines.fillText("photons", 16, box.top - 8);

  // The window or the quadrants of the rule.
  if (shot.look?.window) {
    const [from, to] = shot.look.window;
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
  const levels = [];
  const isSeen = needed !== null && needed > 0 && needed < top;
  if (isSeen) levels.push({ name: `${number(needed)} needed`, colour: ink, dash: [], at: () => y(needed) });
  if (background > 0 && deadTime > 0) {
    const live = liveOf(shot.counts, shot.exposure, deadTime);
    const at = (bin) => y((background * live[bin]) / live[peak[0]]);
    levels.push({ name: `background ${number(background, 1)} at the peak`, colour: soft, dash: [4, 4], at });
  } else if (background > 0) {
    levels.push({ name: `background ${number(background, 1)}`, colour: soft, dash: [4, 4], at: () => y(background) });
  }
  let next = 16;
  for (const { name, colour, dash, at } of levels) {
    lines.strokeStyle = lines.fillStyle = colour;
    lines.lineWidth = 1.5;
    lines.setLineDash(dash);
    lines.beginPath();
    for (let bin = first; bin <= last; bin++) {
      lines.lineTo(x(bin), at(bin));
      lines.lineTo(x(bin + 1), at(bin));
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

/** Laser cycles in which each bin was live: all but those with a photon in the bins of the dead time before it. */
function liveOf(counts, cycles, deadTime) {
  return counts.map((_, bin) => {
    const before = counts.slice(Math.max(0, bin - deadTime), bin);
    return Math.max(0, cycles - before.reduce((sum, count) => sum + count, 0));
  });
}

/** The numbers of an upright axis from 0 to top. */
function axisOf(lines, box, top, soft, line) {
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

/** What the rule needs in the bin of the peak, all others as they are. Of a window the others may be enough. */
function needsOf(needed, deadTime) {
  if (deadTime > 0) return "the rule weighs each bin by the laser cycles in which it was live";
  return needed === 0 ? "the bins beside it are enough for the rule" : `the rule needs ${number(needed)}`;
}
