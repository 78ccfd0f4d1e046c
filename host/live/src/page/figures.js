// Numbers: totals, losses and the state of the source.

const STATES = {
  live: ["live", "good"], playing: ["playing", "good"], opening: ["opening", "still"],
  gone: ["no device", "bad"], stopped: ["sensor stopped", "bad"], paused: ["paused", "still"],
  ended: ["at its end", "still"], failed: ["failed", "bad"], lost: ["no connection", "bad"],
};

/** Sets a text if it has changed: screen readers read every set text. */
function put(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

function showState({ state, reason, returned }) {
  const [text, kind] = STATES[state];
  const badge = element("state");
  put(badge, text);
  badge.className = `badge ${kind}`;
  const again = returned > 0 ? `came back ${number(returned)} ${returned > 1 ? "times" : "time"}` : "";
  put(element("reason"), reason || again);
  const isOver = state === "ended" || state === "failed";
  put(element("play"), state === "playing" ? "Pause recording" : isOver ? "Play again" : "Play");
  element("play").dataset.on = state !== "playing";
}

function showTotals(frame, framesPerSecond) {
  const { losses, recorded } = frame;
  const isRecording = source?.kind === "recording";
  const { events: played, all } = frame.playhead;
  const total = isRecording ? `${number(played)} of ${number(all)}` : number(frame.events);
  const rows = [["events", total], ["events a second", number(frame.rate)]];
  if (!isRecording) {
    rows.push(["photons a second", number(losses.photon_rate)], ["laser cycles", number(losses.cycles)]);
  }
  const [deadTime, isOfSensor] = source?.deadTime ?? [0];
  if (deadTime > 0) rows.push(["TDC dead time", `${number(deadTime)} bins, from the ${isOfSensor ? "sensor" : "settings"}`]);
  if (source?.ditherBins > 0) rows.push(["laser dither", `${number(source.ditherBins)} bins`]);
  if (frame.masked > 0) rows.push(["events left out", number(frame.masked)]);
  rows.push(["frames a second", number(framesPerSecond, 1)]);
  if (recorded.file) {
    rows.push([recorded.on ? "recording" : "recorded", `${number(recorded.events)} events, ${recorded.file}`]);
  }
  const totals = element("totals");
  while (totals.children.length > rows.length) totals.lastChild.remove();
  rows.forEach(([name, value], at) => {
    const part = totals.children[at] ?? totals.appendChild(document.createElement("div"));
    if (!part.firstChild) part.append(document.createElement("dt"), document.createElement("dd"));
    put(part.firstChild, name);
    put(part.lastChild, value);
  });
  const button = element("record");
  put(button, recorded.on ? "Stop recording" : "Record");
  button.classList.toggle("recording-now", recorded.on);
  button.dataset.on = !recorded.on;
}

/** The position is moved and not sent yet, so frames leave it alone. */
let isMoving = false;

/** A place in a recording, in seconds, or in milliseconds if it is short. */
function placeText(seconds, length) {
  if (length < 0.01) return `${fixed(1000 * seconds, 3)} of ${fixed(1000 * length, 3)} ms`;
  const digits = length < 10 ? 3 : 1;
  return `${fixed(seconds, digits)} of ${fixed(length, digits)} s`;
}

/** Shows where playback is, and how fast. */
function showPlayhead({ seconds, length, speed }) {
  const [position, speeds] = [element("position"), element("speed")];
  position.max = length;
  if (!isMoving) position.value = seconds;
  const text = placeText(Number(position.value), length);
  put(element("place"), text);
  position.setAttribute("aria-valuetext", text);
  if (speed === shownSpeed) return;
  shownSpeed = speed;
  const all = [...new Set([...SPEEDS, speed])].sort((one, other) => one - other);
  speeds.replaceChildren(...all.map((one) => new Option(`${one}×`, one, false, one === speed)));
}
const SPEEDS = [0.001, 0.01, 0.1, 0.25, 0.5, 1, 2, 4, 10, 100];
let shownSpeed = 0;

function showLosses({ counts, last_fault: fault }) {
  const body = element("losses");
  counts.forEach(([name, count], at) => {
    const row = body.children[at] ?? body.appendChild(document.createElement("tr"));
    if (!row.firstChild) {
      const title = document.createElement("th");
      title.scope = "row";
      row.append(title, document.createElement("td"));
    }
    row.classList.toggle("some", count > 0);
    put(row.firstChild, fault && name === "sensor errors" ? `${name} (last: ${fault})` : name);
    put(row.lastChild, number(count));
  });
}

/** Numbers of pixels and events that this frame draws. */
function showDrawn({ pixels: drawn, left, events: arrived }) {
  const rest = left > 0 ? `, ${number(left)} in the next frames` : "";
  const thinned = arrived > drawn ? `${number(drawn)} of ${number(arrived)} events drawn` : `${number(arrived)} events drawn`;
  element("drawn").value = `${thinned} in this frame${rest}. All are counted; a recording holds all.`;
}

let newsTimer = 0;
/** Shows a line: what was done, or why not. */
function tell(text, isBad = false) {
  const news = element("news");
  news.textContent = text;
  news.classList.toggle("bad", isBad);
  news.hidden = !text;
  clearTimeout(newsTimer);
  if (!isBad) newsTimer = setTimeout(() => { news.hidden = true; }, 8000);
}

/** Posts a command; returns whether it was done, and the server's answer. */
async function post(path, body, kind = "application/json") {
  try {
    const answer = await fetch(path, { method: "POST", headers: { "content-type": kind }, body });
    return { done: answer.ok, text: (await answer.text()).trim() };
  } catch {
    return { done: false, text: "the program does not answer" };
  }
}

/** Posts a command whose effect the page shows; says only why it was not done. */
async function send(path, body) {
  const { done, text } = await post(path, JSON.stringify(body));
  if (!done) tell(text, true);
}

async function command(path, body) {
  const { done, text } = await post(path, JSON.stringify(body));
  tell(text, !done);
}
