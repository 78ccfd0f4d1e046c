// What the page says of a source, its events and its histograms.

import { needsOf } from "../../../run/src/report/shared/looks.js";
import { fixed, number } from "../../../run/src/report/shared/numbers.js";

const STATES = {
  live: ["live", "good"], playing: ["playing", "good"], opening: ["opening", "still"],
  gone: ["no device", "bad"], stopped: ["sensor stopped", "bad"], paused: ["paused", "still"],
  ended: ["at its end", "still"], failed: ["failed", "bad"], lost: ["no connection", "bad"],
};
const SPEEDS = [0.001, 0.01, 0.1, 0.25, 0.5, 1, 2, 4, 10, 100];

/** The text of a connection, whether it is good, bad or still, the reason, and what its button does. */
export function stateOf({ state, reason, returned }) {
  const [text, kind] = STATES[state];
  const again = returned > 0 ? `came back ${number(returned)} ${returned > 1 ? "times" : "time"}` : "";
  const isOver = state === "ended" || state === "failed";
  const play = state === "playing" ? "Pause recording" : isOver ? "Play again" : "Play";
  return { text, kind, reason: reason || again, play };
}

/** Names and values of the totals. */
export function totalsOf({ losses, recorded, playhead, events, rate, masked }, source, framesPerSecond) {
  const isRecording = source?.kind === "recording";
  const total = isRecording ? `${number(playhead.events)} of ${number(playhead.all)}` : number(events);
  const rows = [["events", total], ["events a second", number(rate)]];
  if (!isRecording) {
    rows.push(["photons a second", number(losses.photon_rate)], ["laser cycles", number(losses.cycles)]);
  }
  const [deadTime, isOfSensor] = source?.deadTime ?? [0];
  if (deadTime > 0) rows.push(["TDC dead time", `${number(deadTime)} bins, from the ${isOfSensor ? "sensor" : "settings"}`]);
  if (source?.ditherBins > 0) rows.push(["laser dither", `${number(source.ditherBins)} bins`]);
  if (masked > 0) rows.push(["events left out", number(masked)]);
  rows.push(["frames a second", number(framesPerSecond, 1)]);
  if (recorded.file) {
    rows.push([recorded.on ? "recording" : "recorded", `${number(recorded.events)} events, ${recorded.file}`]);
  }
  return rows;
}

/** The name of a loss, with the sensor's last fault. */
export function lossName(name, fault) {
  return fault && name === "sensor errors" ? `${name} (last: ${fault})` : name;
}

/** A place in a recording, in seconds, or in milliseconds if it is short. */
export function placeText(seconds, length) {
  if (length < 0.01) return `${fixed(1000 * seconds, 3)} of ${fixed(1000 * length, 3)} ms`;
  const digits = length < 10 ? 3 : 1;
  return `${fixed(seconds, digits)} of ${fixed(length, digits)} s`;
}

/** The speeds to choose from, the current one among them. */
export function speedsWith(speed) {
  return [...new Set([...SPEEDS, speed])].sort((one, other) => one - other);
}

/** Numbers of pixels and events that a frame draws. */
export function drawnText({ pixels: drawn, left, events: arrived }) {
  const rest = left > 0 ? `, ${number(left)} in the next frames` : "";
  const thinned = arrived > drawn ? `${number(drawn)} of ${number(arrived)} events drawn` : `${number(arrived)} events drawn`;
  return `${thinned} in this frame${rest}. All are counted; a recording holds all.`;
}

/** The text above the histogram of the chosen pixel. */
export function histogramNote(source, histogram) {
  if (source?.kind === "recording") return "A recording has no histograms.";
  if (!histogram) return "No histogram yet; a device sends events first.";
  const { none, whole, exposure, look } = histogram;
  if (none) return `No histogram: ${none}.`;
  const kind = whole ? "A complete histogram from the sensor" : `An exposure of ${number(exposure)} laser cycles so far`;
  const rest = look ? ` Peak: ${number(look.peak[1])} photons in bin ${look.peak[0]}; ${needsOf(look)}.` : "";
  return `${kind}.${rest}`;
}

/** The text above the ranges of the chosen pixel, which `isEmpty` if it had no event before it was chosen. */
export function rangesNote({ events, drawn, arrived }, isEmpty) {
  if (arrived === 0) return isEmpty ? "No event yet." : "No event since this pixel was chosen.";
  const of = drawn < arrived ? ` ${number(drawn)} of ${number(arrived)} events drawn.` : "";
  return `Range in millimetres: the last ${number(events.length)} events.${of}`;
}
