// The chosen pixel: its range over time, and its last events.

const FLAGS = ["saturated", "clipped", "deferred", "pile-up", "tail"];

function drawRanges() {
  const { context: lines, width, height, soft, line, ink } = context(element("ranges"));
  const all = chosen.events;
  element("ranges-note").textContent = rangesNote();
  if (all.length === 0) return;
  const box = { left: 60, right: width - 12, top: 10, bottom: height - 36 };
  const [first, last] = [all[0].cycle, Math.max(all[0].cycle + 1, all.at(-1).cycle)];
  let [low, high] = [Infinity, -Infinity];
  for (const event of all) [low, high] = [Math.min(low, event.range), Math.max(high, event.range)];
  const room = Math.max(5, (high - low) * 0.1);
  [low, high] = [low - room, high + room];
  const x = (cycle) => box.left + (box.right - box.left) * share(cycle, first, last);
  const y = (range) => box.bottom - (box.bottom - box.top) * share(range, low, high);
  lines.fillStyle = soft;
  lines.strokeStyle = line;
  for (const range of ticks(low, high, (box.bottom - box.top) / 34, true)) {
    lines.textAlign = "right";
    lines.fillText(number(range), box.left - 6, y(range) + 4);
    lines.beginPath();
    lines.moveTo(box.left, y(range));
    lines.lineTo(box.right, y(range));
    lines.stroke();
  }
  const scale = about?.laserHz ? { per: about.laserHz, unit: "s" } : { per: 1, unit: "laser cycle" };
  const most = (box.right - box.left) / 90;
  for (const time of ticks(first / scale.per, last / scale.per, most, scale.per === 1)) {
    lines.textAlign = "center";
    lines.fillText(number(time, 4), x(time * scale.per), box.bottom + 15);
  }
  lines.textAlign = "center";
  lines.fillText(scale.unit, (box.left + box.right) / 2, height - 5);
  for (const event of all) {
    // What is flagged is hollow, a block or a later echo a square.
    const size = event.level > 0 || event.echo > 1 ? 5 : 3;
    lines.fillStyle = lines.strokeStyle = event.echo > 1 ? soft : ink;
    const place = [x(event.cycle) - size / 2, y(event.range) - size / 2, size, size];
    if (event.flags > 0) lines.strokeRect(...place);
    else lines.fillRect(...place);
  }
}

function rangesNote() {
  if (chosen.arrived === 0) return "No event yet.";
  const { drawn, arrived } = chosen;
  const of = drawn < arrived ? ` ${number(drawn)} of ${number(arrived)} events drawn.` : "";
  return `Range in millimetres: the last ${number(chosen.events.length)} events.${of}`;
}

/** Rows of the table, newest first. */
function drawEvents() {
  const body = element("events").tBodies[0];
  const rows = chosen.events.slice(-30).reverse().map((event) => {
    const row = document.createElement("tr");
    const flags = FLAGS.filter((_, bit) => event.flags & (1 << bit));
    if (event.level > 0) flags.push(`${1 << event.level}×${1 << event.level} block`);
    if (event.echo > 1) flags.push(`echo ${event.echo}`);
    const measured = (value) => (Number.isNaN(value) ? "–" : number(value));
    const cells = [number(event.cycle), number(event.range, 1), measured(event.peak),
      measured(event.background), measured(event.exposure), flags.join(", ")];
    row.append(...cells.map((cell) => {
      const part = document.createElement("td");
      part.textContent = cell;
      return part;
    }));
    return row;
  });
  body.replaceChildren(...rows);
}
