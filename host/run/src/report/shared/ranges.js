// The events of a pixel: their ranges over time, and a table of them.

import { contextOf } from "./dom.js";
import { cellsOf, isDoubtful, spanOfRanges } from "./pixel-events.js";
import { number, share, ticks, timeUnit } from "./numbers.js";

/**
 * Draws ranges from the laser cycle first to last. Where `now` is given, the window of time from
 * `from` to it is marked, and events after it are faint. `span` is that of the upright axis, of
 * all its events without it; `isSmall` a plot among others.
 */
export function drawRanges(canvas, events, { laserHz, first, last, from, now, span, isSmall }) {
  const { lines, width, height, soft, line, ink } = contextOf(canvas);
  if (events.length === 0) return;
  const [low, high] = span ?? spanOfRanges(events);
  const box = { left: isSmall ? 46 : 60, right: width - 12, top: isSmall ? 6 : 24, bottom: height - (isSmall ? 20 : 36) };
  const end = Math.max(first + 1, last);
  const x = (cycle) => box.left + (box.right - box.left) * share(cycle, first, end);
  const y = (range) => box.bottom - (box.bottom - box.top) * share(range, low, high);
  if (now !== undefined) {
    lines.fillStyle = line;
    lines.globalAlpha = 0.5;
    lines.fillRect(x(from), box.top, x(now) - x(from), box.bottom - box.top);
    lines.globalAlpha = 1;
  }
  lines.fillStyle = soft;
  lines.strokeStyle = line;
  for (const range of ticks(low, high, (box.bottom - box.top) / 34, high - low > 4)) {
    lines.textAlign = "right";
    lines.fillText(number(range, 1), box.left - 6, y(range) + 4);
    lines.beginPath();
    lines.moveTo(box.left, y(range));
    lines.lineTo(box.right, y(range));
    lines.stroke();
  }
  const { unit, per, isWhole } = timeUnit(end, laserHz);
  for (const time of ticks(first / per, end / per, Math.max(2, (box.right - box.left) / (isSmall ? 60 : 90)), isWhole)) {
    const text = isSmall ? `${number(time, 4)} ${isWhole ? "" : unit}` : number(time, 4);
    const at = x(time * per);
    const half = lines.measureText(text).width / 2;
    lines.textAlign = "center";
    lines.fillText(text, Math.min(width - half - 3, at), box.bottom + 15);
  }
  if (!isSmall) {
    lines.textAlign = "center";
    lines.fillText(isWhole ? unit : `time, ${unit}`, (box.left + box.right) / 2, height - 5);
    lines.textAlign = "left";
    lines.fillText("range, mm", 16, 14);
  }
  for (const event of events) {
    // What is flagged is hollow, unless neighbours confirmed it; a block or a later echo a square.
    const size = (event.level > 0 || event.echo > 1 ? 5 : 3) + (isSmall ? 0 : 1);
    lines.fillStyle = lines.strokeStyle = event.echo > 1 ? soft : ink;
    lines.globalAlpha = event.cycle >= now ? 0.25 : 1;
    const place = [x(event.cycle) - size / 2, y(event.range) - size / 2, size, size];
    if (isDoubtful(event)) lines.strokeRect(...place);
    else lines.fillRect(...place);
  }
  lines.globalAlpha = 1;
  if (now !== undefined) drawNow(lines, box, x(now), y, events.findLast((event) => event.cycle < now), isSmall);
}

/** The cursor at a time, and the range that holds then. */
function drawNow(lines, box, at, y, event, isSmall) {
  const colour = getComputedStyle(lines.canvas).getPropertyValue("--focus");
  lines.strokeStyle = lines.fillStyle = colour;
  lines.lineWidth = 1.5;
  lines.beginPath();
  lines.moveTo(at, box.top);
  lines.lineTo(at, box.bottom);
  lines.stroke();
  if (!event) return;
  lines.beginPath();
  lines.arc(at, y(event.range), isSmall ? 3.5 : 5, 0, 2 * Math.PI);
  lines.fill();
  if (isSmall) return;
  const isLeft = at > (box.left + box.right) / 2;
  lines.textAlign = isLeft ? "right" : "left";
  lines.fillText(`${number(event.range)} mm`, at + (isLeft ? -9 : 9), box.top - 6);
}

/** Fills a table with the last events, newest first. Its head names the columns. */
export function fillEvents(table, events, timeOf) {
  const columns = [...table.tHead.rows[0].cells].map((head) => head.dataset.of);
  const rows = cellsOf(columns, events, timeOf).map((cells) => {
    const row = document.createElement("tr");
    for (const text of cells) row.insertCell().textContent = text;
    return row;
  });
  table.tBodies[0].replaceChildren(...rows);
}
