// Numbers: totals, losses and the state of the source.

import { element } from "../../../run/src/report/shared/dom.js";
import { number } from "../../../run/src/report/shared/numbers.js";
import { drawnText, lossName, placeText, speedsWith, stateOf, totalsOf } from "./notes.js";
import { live } from "./state.js";

/** Sets a text if it has changed: screen readers read every set text. */
function put(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export function showState(connection) {
  const { text, kind, reason, play } = stateOf(connection);
  const badge = element("state");
  put(badge, text);
  badge.className = `badge ${kind}`;
  put(element("reason"), reason);
  put(element("play"), play);
  element("play").dataset.on = connection.state !== "playing";
}

export function showTotals(frame, framesPerSecond) {
  const rows = totalsOf(frame, live.source, framesPerSecond);
  const totals = element("totals");
  while (totals.children.length > rows.length) totals.lastChild.remove();
  rows.forEach(([name, value], at) => {
    const part = totals.children[at] ?? totals.appendChild(document.createElement("div"));
    if (!part.firstChild) part.append(document.createElement("dt"), document.createElement("dd"));
    put(part.firstChild, name);
    put(part.lastChild, value);
  });
  const { on } = frame.recorded;
  const button = element("record");
  put(button, on ? "Stop recording" : "Record");
  button.classList.toggle("recording-now", on);
  button.dataset.on = !on;
}

/** Whether the position is moved and not sent yet, so that frames leave it alone; the speed that is shown. */
export const playback = { isMoving: false, speed: 0 };

/** Shows where playback is, and how fast. */
export function showPlayhead({ seconds, length, speed }) {
  const [position, speeds] = [element("position"), element("speed")];
  position.max = length;
  if (!playback.isMoving) position.value = seconds;
  const text = placeText(Number(position.value), length);
  put(element("place"), text);
  position.setAttribute("aria-valuetext", text);
  if (speed === playback.speed) return;
  playback.speed = speed;
  speeds.replaceChildren(...speedsWith(speed).map((one) => new Option(`${one}×`, one, false, one === speed)));
}

export function showLosses({ counts, last_fault: fault }) {
  const body = element("losses");
  counts.forEach(([name, count], at) => {
    const row = body.children[at] ?? body.appendChild(document.createElement("tr"));
    if (!row.firstChild) {
      const title = document.createElement("th");
      title.scope = "row";
      row.append(title, document.createElement("td"));
    }
    row.classList.toggle("some", count > 0);
    put(row.firstChild, lossName(name, fault));
    put(row.lastChild, number(count));
  });
}

/** Numbers of pixels and events that this frame draws. */
export function showDrawn(drawn) {
  element("drawn").value = drawnText(drawn);
}
