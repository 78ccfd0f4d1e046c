import assert from "node:assert/strict";
import { test } from "node:test";

import { planOf } from "../../run/src/report/shared/looks.js";
import { drawnText, histogramNote, lossName, placeText, rangesNote, speedsWith, stateOf, totalsOf } from "../src/page/notes.js";
import { shortcutOf } from "../src/page/shortcuts.js";

test("each state has a text and a kind", () => {
  const states = ["live", "playing", "opening", "gone", "stopped", "paused", "ended", "failed", "lost"];
  const kinds = states.map((state) => stateOf({ state, reason: "", returned: 0 }).kind);
  assert.deepEqual(kinds, ["good", "good", "still", "bad", "bad", "still", "still", "bad", "bad"]);
  assert.equal(stateOf({ state: "gone", reason: "unplugged", returned: 2 }).reason, "unplugged");
  assert.equal(stateOf({ state: "live", reason: "", returned: 2 }).reason, "came back 2 times");
  assert.equal(stateOf({ state: "live", reason: "", returned: 1 }).reason, "came back 1 time");
  assert.equal(stateOf({ state: "live", reason: "", returned: 0 }).reason, "");
  const play = (state) => stateOf({ state, reason: "", returned: 0 }).play;
  assert.deepEqual(["playing", "paused", "ended", "failed"].map(play), ["Pause recording", "Play", "Play again", "Play again"]);
});

const frame = { events: 12_345, rate: 99.6, masked: 0, losses: { photon_rate: 1e6, cycles: 5000 },
  recorded: { on: false, file: "", events: 0 }, playhead: { events: 10, all: 2000 } };

test("a device has photons and laser cycles, a recording its progress", () => {
  assert.deepEqual(totalsOf(frame, { kind: "device" }, 9.96), [["events", "12,345"], ["events a second", "100"],
    ["photons a second", "1,000,000"], ["laser cycles", "5,000"], ["frames a second", "10"]]);
  assert.deepEqual(totalsOf(frame, { kind: "recording" }, 10),
    [["events", "10 of 2,000"], ["events a second", "100"], ["frames a second", "10"]]);
});

test("totals have what is there", () => {
  const more = { ...frame, masked: 7, recorded: { on: true, file: "a.aer", events: 1000 } };
  const rows = Object.fromEntries(totalsOf(more, { kind: "device", deadTime: [12, true], ditherBins: 8 }, 10));
  assert.equal(rows["TDC dead time"], "12 bins, from the sensor");
  assert.equal(rows["laser dither"], "8 bins");
  assert.equal(rows["events left out"], "7");
  assert.equal(rows.recording, "1,000 events, a.aer");
  const ended = { ...more, recorded: { ...more.recorded, on: false } };
  const old = Object.fromEntries(totalsOf(ended, { kind: "device", deadTime: [12, false] }, 10));
  assert.equal(old["TDC dead time"], "12 bins, from the settings");
  assert.equal(old.recorded, "1,000 events, a.aer");
  // Before the source is known.
  assert.equal(totalsOf(frame, null, 0).length, 5);
});

test("only sensor errors have the last fault", () => {
  assert.equal(lossName("sensor errors", "timeout"), "sensor errors (last: timeout)");
  assert.equal(lossName("sensor errors", ""), "sensor errors");
  assert.equal(lossName("saturated", "timeout"), "saturated");
});

test("a place in a recording has digits as its length suits", () => {
  assert.equal(placeText(0.1, 0.2), "0.100 of 0.200 s");
  assert.equal(placeText(0.1, 10), "0.1 of 10.0 s");
  assert.equal(placeText(0.00005, 0.0001), "0.050 of 0.100 ms");
});

test("the current speed is among those to choose from", () => {
  assert.deepEqual(speedsWith(1), [0.001, 0.01, 0.1, 0.25, 0.5, 1, 2, 4, 10, 100]);
  assert.deepEqual(speedsWith(3).slice(6, 9), [2, 3, 4]);
});

test("it is said how many events a frame draws", () => {
  assert.equal(drawnText({ pixels: 5, left: 0, events: 5 }),
    "5 events drawn in this frame. All are counted; a recording holds all.");
  assert.equal(drawnText({ pixels: 4096, left: 3, events: 5000 }),
    "4,096 of 5,000 events drawn in this frame, 3 in the next frames. All are counted; a recording holds all.");
});

const device = { kind: "device" };

/** A histogram as `explain` describes it. */
const shot = (look) => ({ pixel: 1, exposure: 1200, whole: false, counts: [1, 40, 2, 0],
  look: { peak: [1, 40], needed: 9, depends: false, background: 2, quadrants: [0, 1, 2, 3, 4], window: null, dead_time: 0, ...look } });

test("the note on a histogram has its peak", () => {
  assert.equal(histogramNote(device, shot()),
    "An exposure of 1,200 laser cycles so far. Peak: 40 photons in bin 1; the rule needs 9.");
  assert.equal(histogramNote(device, { ...shot(), whole: true, look: null }), "A complete histogram from the sensor.");
  assert.equal(histogramNote(device, null), "No histogram yet; a device sends events first.");
  assert.equal(histogramNote(device, { pixel: 1, none: "it is masked" }), "No histogram: it is masked.");
  assert.equal(histogramNote({ kind: "recording" }, shot()), "A recording has no histograms.");
  assert.equal(histogramNote(null, null), "No histogram yet; a device sends events first.");
});

test("settings with tracking, neighbours or several echoes do not stop the drawing", () => {
  // Neither a number nor a background is known then, with a dead time or without.
  for (const deadTime of [0, 4]) {
    const histogram = shot({ needed: null, background: null, depends: true, dead_time: deadTime });
    assert.ok(histogramNote(device, histogram).endsWith("the required number depends on earlier events or on neighbours."));
    assert.deepEqual(planOf(histogram).levels, []);
  }
  // No counter holds as many as are needed.
  assert.ok(histogramNote(device, shot({ needed: null })).endsWith("; no number is enough."));
});

test("the note on ranges says how many events are drawn", () => {
  const events = Array(3);
  assert.equal(rangesNote({ events: [], drawn: 0, arrived: 0 }, true), "No event yet.");
  assert.equal(rangesNote({ events: [], drawn: 0, arrived: 0 }, false), "No event since this pixel was chosen.");
  assert.equal(rangesNote({ events, drawn: 3, arrived: 3 }, false), "Range in millimetres: the last 3 events.");
  assert.equal(rangesNote({ events, drawn: 3, arrived: 1003 }, false),
    "Range in millimetres: the last 3 events. 3 of 1,003 events drawn.");
});

test("a key is a shortcut unless it is typed into something or the browser's", () => {
  /** A key on an element that lies within these parts. */
  const press = (key, parts = [], more = {}) => shortcutOf({ key, ctrlKey: false, metaKey: false, altKey: false,
    target: { closest: (list) => (list.split(", ").some((part) => parts.includes(part)) ? {} : null) }, ...more });
  assert.equal(press("R"), "r");
  assert.equal(press("?"), "?");
  assert.equal(press("ArrowLeft"), "arrowleft");
  for (const part of ["input", "select", "textarea", "dialog", ".scrolls"]) assert.equal(press("r", [part]), undefined);
  // Space presses a button.
  assert.equal(press(" ", ["button"]), undefined);
  assert.equal(press("r", ["button"]), "r");
  assert.equal(press(" "), " ");
  assert.equal(press("r", [], { ctrlKey: true }), undefined);
});
