// The histogram of the chosen pixel: its bins, the gate, and what the rule makes of it.

function takeHistogram(news) {
  if (news.pixel !== chosen.pixel) return;
  if (news.counts) {
    const bytes = bytesOf(news.counts);
    news.counts = Array.from({ length: bytes.byteLength / 4 }, (_, bin) => bytes.getUint32(4 * bin, true));
  }
  chosen.histogram = news;
}

function drawHistogram() {
  element("histogram").hidden = about?.kind === "recording";
  const { context: lines, width, height, ink, soft, line } = context(element("histogram"));
  const shot = chosen.histogram;
  element("histogram-note").textContent = histogramNote(shot);
  if (!shot?.counts) return;
  const box = { left: 46, right: width - 12, top: 18, bottom: height - 36 };
  const bins = shot.counts.length;
  const { peak = [0, 0], needed = null, background = null, quadrants = [] } = shot.look ?? {};
  // A threshold that no photons would reach is not to flatten the rest.
  const most = Math.max(1, ...shot.counts);
  const top = Math.max(4, most, needed !== null && needed < 8 * most + 16 ? needed : 0) * 1.1;
  const x = (bin) => box.left + ((box.right - box.left) * bin) / bins;
  const y = (count) => box.bottom - ((box.bottom - box.top) * count) / top;
  const gate = about?.settings?.gate ?? [0, bins - 1];

  // Outside of the gate.
  lines.fillStyle = line;
  lines.globalAlpha = 0.5;
  lines.fillRect(x(0), box.top, x(gate[0]) - x(0), box.bottom - box.top);
  lines.fillRect(x(gate[1] + 1), box.top, x(bins) - x(gate[1] + 1), box.bottom - box.top);
  lines.globalAlpha = 1;
  axisOf(lines, box, top, soft, line);
  lines.textAlign = "center";
  for (const bin of ticks(0, bins, (box.right - box.left) / 60, true)) {
    lines.fillText(number(bin), x(bin), box.bottom + 15);
  }
  lines.fillText("bin", (box.left + box.right) / 2, height - 5);

  // The window or the quadrants of the rule.
  if (shot.look?.window) {
    const [first, last] = shot.look.window;
    lines.fillStyle = colours[200];
    lines.globalAlpha = 0.35;
    lines.fillRect(x(first), box.top, x(last + 1) - x(first), box.bottom - box.top);
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
  if (needed !== null && needed < top) mark(lines, box, y(needed), ink, `${number(needed)} needed`, []);
  if (background !== null && background > 0) mark(lines, box, y(background), soft, "", [4, 4]);
}

/** A level line with its name. */
function mark(lines, box, at, colour, text, dash) {
  lines.strokeStyle = lines.fillStyle = colour;
  lines.lineWidth = 1.5;
  lines.setLineDash(dash);
  lines.beginPath();
  lines.moveTo(box.left, at);
  lines.lineTo(box.right, at);
  lines.stroke();
  lines.setLineDash([]);
  lines.textAlign = "right";
  lines.fillText(text, box.right, at - 4);
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

function histogramNote(shot) {
  if (about?.kind === "recording") return "A recording has no histograms.";
  if (!shot) return "No histogram yet; a device sends events first.";
  if (shot.none) return `No histogram: ${shot.none}.`;
  const { peak, needed, depends } = shot.look ?? {};
  const kind = shot.whole ? "A whole histogram of the sensor" : `An exposure of ${number(shot.exposure)} laser cycles so far`;
  let needs = `the rule needs ${number(needed)}`;
  if (depends) needs = "what the rule needs depends on the events before";
  else if (needed === null) needs = "no number is enough for the rule";
  const rest = peak ? ` Peak: ${number(peak[1])} photons in bin ${peak[0]}; ${needs}.` : "";
  return `${kind}.${rest}`;
}
