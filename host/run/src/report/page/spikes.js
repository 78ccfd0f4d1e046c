// The spikes: for some pixels a line for each event, at its laser cycle.

import { pixelName } from "../shared/array.js";
import { contextOf, element } from "../shared/dom.js";
import { number, share, ticks } from "../shared/numbers.js";
import { indicesOf } from "./events.js";
import { clock, data, events, shown } from "./run.js";

const lanes = element("lanes");
const MOST_LANES = 12;

/** Adds a pixel, and gives its label; the oldest one goes if there are too many. */
export function addLane(pixel, prepend = false) {
  removeLane(pixel);
  const lane = document.createElement("li");
  const spikes = indicesOf(events, data, pixel);
  const name = pixelName(data, pixel);
  const label = document.createElement("span");
  const thinned = data.oneOf > 1 ? ` (1 of ${number(data.oneOf)})` : "";
  const ofBlocks = spikes.filter((event) => events.level[event] > 0).length;
  const blocks = ofBlocks > 0 ? ` (${number(ofBlocks)} of blocks)` : "";
  label.textContent = `${name}: ${number(spikes.length)} ${data.events}${thinned}${blocks}`;
  const canvas = document.createElement("canvas");
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", label.textContent);
  const remove = document.createElement("button");
  remove.type = "button";
  remove.textContent = "×";
  remove.setAttribute("aria-label", `Remove ${name}`);
  remove.addEventListener("click", () => {
    lane.remove();
    element("column").focus();
  });
  lane.append(label, canvas, remove);
  Object.assign(lane, { pixel, draw: () => drawLane(canvas, spikes) });
  if (prepend) lanes.prepend(lane);
  else lanes.insertBefore(lane, lanes.querySelector(".scale"));
  const all = [...lanes.querySelectorAll("li:not(.scale)")];
  if (all.length > MOST_LANES) all.at(-1).remove();
  lane.draw();
  return label.textContent;
}

function removeLane(pixel) {
  [...lanes.children].find((lane) => lane.pixel === pixel)?.remove();
}

/** The last line: laser cycles. */
export function addScale() {
  const scale = document.createElement("li");
  scale.className = "scale";
  const canvas = document.createElement("canvas");
  const label = document.createElement("span");
  label.textContent = `time, ${clock.unit}`;
  canvas.setAttribute("aria-hidden", "true");
  // As wide as a line's button.
  const room = document.createElement("button");
  room.textContent = "×";
  room.disabled = true;
  room.style.visibility = "hidden";
  scale.append(label, canvas, room);
  scale.draw = () => drawScale(canvas);
  lanes.append(scale);
}

export function drawLanes() {
  for (const lane of lanes.children) lane.draw();
}

/** A line for each event of the part of the run that is shown, a shorter one for a block's. */
function drawLane(canvas, spikes) {
  const { lines, width, height, ink } = contextOf(canvas);
  lines.fillStyle = ink;
  for (const event of spikes) {
    if (event < shown.first || event >= shown.last) continue;
    const at = width * share(events.cycle[event], shown.start, shown.end);
    const gap = events.level[event] > 0 ? height / 3 : 3;
    lines.fillRect(at - 0.6, gap, 1.2, height - 2 * gap);
  }
}

function drawScale(canvas) {
  const { lines, width, soft } = contextOf(canvas);
  lines.fillStyle = soft;
  const { per } = clock;
  for (const time of ticks(shown.start / per, shown.end / per, width / 90)) {
    const at = width * share(time * per, shown.start, shown.end);
    lines.fillRect(Math.min(width - 1, at), 0, 1, 5);
    lines.textAlign = at < 20 ? "left" : at > width - 30 ? "right" : "center";
    lines.fillText(number(time, 4), at, 19);
  }
}
