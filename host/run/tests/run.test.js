import assert from "node:assert/strict";
import { test } from "node:test";

import { decisionOf, firstPixel, histogramNote, isKept, rangesNote } from "../src/report/page/decisions.js";
import { decodeDecisions, decodeEvents, numbersOf } from "../src/report/page/decode.js";
import { countUntil, eventOf, firstFrom, indicesOf, kindName } from "../src/report/page/events.js";
import { emptyMap, mapUntil } from "../src/report/page/history.js";

/** Numbers as the report packs them: digits of three bits, the lowest first, two a byte. */
function packed(numbers) {
  const digits = numbers.flatMap((number) => {
    const own = [];
    for (let rest = number; own.length === 0 || rest > 0; rest = Math.floor(rest / 8)) own.push(rest % 8);
    return own.map((digit, at) => (at < own.length - 1 ? digit + 8 : digit));
  });
  if (digits.length % 2 === 1) digits.push(0);
  const bytes = digits.filter((_, at) => at % 2 === 0).map((low, at) => low + 16 * digits[2 * at + 1]);
  return btoa(String.fromCharCode(...bytes));
}

/** Of an event: laser cycles since the one before, pixel, level, echo, millimetres, flags, exposure, photons. */
function eventsOf(rows) {
  const numbers = rows.flatMap(([since, pixel, level, echo, range, flags = 0, exposure = 40, peak = 9]) =>
    [since, pixel, (flags << 4) | (level << 2) | (echo - 1), exposure, range < 0 ? -range * 512 - 1 : range * 512, peak]);
  return decodeEvents({ packed: packed(numbers), count: rows.length });
}

const array = { columns: 5, rows: 3, sides: ["column", "row"] };

test("numbers are unpacked", () => {
  // The bytes that the report's own test has: 0x70, 0x18, 0x7f.
  const next = numbersOf(btoa("\x70\x18\x7f"));
  assert.deepEqual([next(), next(), next(), next()], [0, 7, 8, 63]);
  // Beyond 32 bits.
  const large = [2 ** 31, 2 ** 40 + 5, Number.MAX_SAFE_INTEGER];
  const again = numbersOf(packed(large));
  assert.deepEqual(large.map(() => again()), large);
});

test("events are unpacked with all that they have", () => {
  const events = eventsOf([[3, 7, 0, 1, 1000], [4, 2, 1, 2, -1.5, 0b101, 60, 1234], [0, 0, 3, 4, 0.25, 63, 65535, 1]]);
  assert.equal(events.count, 3);
  assert.deepEqual([...events.cycle], [3, 7, 7]);
  assert.deepEqual(eventOf(events, 1),
    { cycle: 7, range: -1.5, pixel: 2, level: 1, echo: 2, flags: 5, exposure: 60, peak: 1234, background: NaN });
  assert.deepEqual(eventOf(events, 2),
    { cycle: 7, range: 0.25, pixel: 0, level: 3, echo: 4, flags: 63, exposure: 65535, peak: 1, background: NaN });
});

/** A decision: pixel, kind, cycle, exposure, range, peak bin, needed + 1, background, window, left out, counts. */
const DECISION = [6, (32 << 4) | 0, 90, 40, 1000 * 512, 1, 0, 0, 0, 0, 1, 9, 2, 0];

test("decisions are unpacked, with a window and without", () => {
  const whole = [3, (1 << 4) | (1 << 2) | 1, 80, 20, 512, 2, 6, 768, 2, 1, 1, 0, 0, 5, 6, 7, 8];
  const data = { packed: packed([...DECISION, ...whole]), count: 2, bins: 4, quadrants: [0, 1, 2, 3, 4], deadTime: 0 };
  const [confirmed, block] = decodeDecisions(data);
  assert.deepEqual(confirmed, { pixel: 6, cycle: 90, exposure: 40, range: 1000, counts: [1, 9, 2, 0], leftOut: [],
    look: { peak: [1, 9], needed: null, background: 0, quadrants: [0, 1, 2, 3, 4], window: null, dead_time: 0, depends: true },
    level: 0, echo: 1, flags: 32 });
  assert.deepEqual(block, { pixel: 3, cycle: 80, exposure: 20, range: 1, counts: [5, 6, 7, 8], leftOut: [[0, 0]],
    look: { peak: [2, 7], needed: 5, background: 1.5, quadrants: [0, 1, 2, 3, 4], window: [1, 2], dead_time: 0, depends: false },
    level: 1, echo: 2, flags: 1 });
  // Pixels are weighed by the dead time, blocks are not.
  const [pixel, other] = decodeDecisions({ ...data, deadTime: 3 });
  assert.deepEqual([pixel.look.dead_time, pixel.look.depends, other.look.dead_time], [3, false, 0]);
});

test("the first event from a laser cycle on is found", () => {
  const events = eventsOf([[3, 0, 0, 1, 1], [0, 0, 0, 1, 1], [5, 0, 0, 1, 1]]);
  assert.deepEqual([0, 3, 4, 8, 9].map((cycle) => firstFrom(events, cycle)), [0, 0, 2, 2, 3]);
  assert.equal(firstFrom(eventsOf([]), 5), 0);
});

test("a pixel has its events and those of its blocks", () => {
  const events = eventsOf([[1, 7, 0, 1, 100], [1, 2, 1, 1, 200], [1, 8, 0, 1, 300], [1, 0, 3, 1, 400]]);
  assert.deepEqual(indicesOf(events, array, 7), [0, 1, 3]);
  assert.deepEqual(indicesOf(events, array, 0), [3]);
  const shown = (first, last, far) => countUntil(events, { first, last, far });
  assert.deepEqual([shown(0, 4, Infinity), shown(0, 4, 200), shown(1, 3, 300), shown(2, 2, 300)], [4, 2, 2, 0]);
});

test("an event is called by its block and its echo", () => {
  assert.equal(kindName(array, { pixel: 7, level: 0, echo: 1 }, false), "column 2, row 1");
  assert.equal(kindName(array, { pixel: 7, level: 0, echo: 1 }, true), "column 2, row 1, echo 1");
  assert.equal(kindName(array, { pixel: 2, level: 1, echo: 3 }, true), "2×2 block from column 2, row 0, echo 3");
});

test("the map has the last range of each pixel at a time", () => {
  const small = { columns: 2, rows: 2 };
  // A block at laser cycle 50; a pixel of it at 55; the block again at 60, and at 100.
  const events = eventsOf([[50, 0, 1, 1, 100], [5, 3, 0, 1, 200], [5, 0, 1, 1, 300], [40, 0, 1, 1, 400], [1, 1, 0, 2, 500]]);
  const map = emptyMap(small);
  const until = (end, everyEcho = false) => {
    mapUntil(map, small, events, end, everyEcho);
    return [...map.range];
  };
  assert.deepEqual(until(0), [NaN, NaN, NaN, NaN]);
  assert.deepEqual(until(1), [100, 100, 100, 100]);
  assert.deepEqual(until(2), [100, 100, 100, 200]);
  // Its own event was within the exposure of 40 laser cycles.
  assert.deepEqual(until(3), [300, 300, 300, 200]);
  assert.deepEqual(until(4), [400, 400, 400, 400]);
  assert.deepEqual(until(5), [400, 400, 400, 400]);
  // Back in time.
  assert.deepEqual(until(0), [NaN, NaN, NaN, NaN]);
  assert.deepEqual(until(2), [100, 100, 100, 200]);
  mapUntil(map, small, events, 0, true);
  assert.deepEqual(until(5, true), [400, 500, 400, 400]);
});

test("a block at the border of the array stays within it", () => {
  const map = emptyMap(array);
  mapUntil(map, array, eventsOf([[50, 4, 1, 1, 100]]), 1, false);
  assert.deepEqual([...map.range].flatMap((range, pixel) => (range === 100 ? [pixel] : [])), [4, 9]);
});

test("an event of a pixel before the exposure of a block does not hold against it", () => {
  const until = (cycle) => {
    const map = emptyMap({ columns: 2, rows: 2 });
    // An exposure of 40 laser cycles: from 61 to 100.
    mapUntil(map, { columns: 2, rows: 2 }, eventsOf([[cycle, 3, 0, 1, 200], [100 - cycle, 0, 1, 1, 300]]), 2, false);
    return map.range[3];
  };
  assert.deepEqual([60, 61].map(until), [300, 200]);
});

const data = { ...array, event: "event", events: "events", oneOf: 1, isChosen: false, histograms: { every: 2 } };
const look = { peak: [3, 40], needed: 12, background: 1.25, dead_time: 0, depends: false };
const decision = { pixel: 2, level: 0, echo: 1, cycle: 90, exposure: 1000, range: 512.04, look };
const timeOf = (cycle) => `${cycle / 10} ms`;

test("a thinned report keeps the histograms of every second column and row", () => {
  assert.deepEqual([...Array(15).keys()].filter((pixel) => isKept(data, pixel)), [0, 2, 4, 10, 12, 14]);
  assert.ok(!isKept({ ...data, histograms: null }, 0));
});

test("the latest decision of a pixel or its blocks counts", () => {
  const decisions = [{ ...decision, cycle: 50 }, decision, { ...decision, pixel: 0, level: 2, cycle: 80 }, { ...decision, pixel: 4, cycle: 99 }];
  assert.equal(decisionOf(data, decisions, 2), decisions[1]);
  assert.equal(decisionOf(data, decisions, 0), decisions[2]);
  assert.equal(decisionOf(data, decisions, 14), null);
  assert.equal(decisionOf(data, decisions, 3), null);
});

test("the report opens on a pixel with a histogram", () => {
  const decisions = [{ ...decision, pixel: 14 }, { ...decision, pixel: 2 }];
  assert.equal(firstPixel(data, decisions, [9, 2, 14]), 2);
  // None of them has one: the next to the first.
  assert.equal(firstPixel(data, decisions, [9, 13]), 14);
  assert.equal(firstPixel(data, [], [9, 13]), 9);
});

test("the note on a histogram says what the last event was decided from", () => {
  const note = (more, look) => histogramNote(data,
    { pixel: 2, events: [decision], decision: { ...decision, ...more, look: { ...decision.look, ...look } } }, false, timeOf);
  assert.equal(note(), "Histogram of the last event, at 9 ms, of 1,000 laser cycles: 512.0 mm. " +
    "Peak: 40 photons in bin 3; the rule needs 12, with 1.25 of background a bin.");
  assert.ok(note({ level: 1, pixel: 2 }).startsWith("Histogram of the last event (2×2 block from column 2, row 0), at"));
  assert.ok(note({}, { dead_time: 4, needed: null }).endsWith("in which it was live, with 1.25 of background there."));
  // Confirmed by neighbours: neither number nor background.
  assert.ok(note({}, { needed: null, background: 0, depends: true })
    .endsWith("in bin 3; the required number depends on earlier events or on neighbours."));
});

test("the note on a histogram says why there is none", () => {
  const note = (data, pixel) => histogramNote(data, { pixel, events: [], decision: null }, false, timeOf);
  assert.equal(note({ ...data, histograms: null }, 0), "No histograms: these events were decided on a device.");
  assert.equal(note(data, 2), "No histogram: the pixel has no event.");
  assert.equal(note(data, 8), "No histogram: to stay small, the report has those of every 2 columns and rows. " +
    "The next is that of column 2, row 0.");
});

test("a histogram of an echo that is not shown says so", () => {
  const chosen = { pixel: 2, events: [{ cycle: 90, echo: 1 }], decision: { ...decision, echo: 2 } };
  const note = (more) => histogramNote({ ...data, ...more }, chosen, true, timeOf);
  assert.ok(note({ isChosen: true }).includes(", echo 2, which is not shown, at 9 ms"));
  assert.ok(!note({ isChosen: false }).includes("not shown"));
});

test("the note on ranges has the range at the time", () => {
  const events = [{ cycle: 10, range: 100 }, { cycle: 20, range: 200.06 }];
  const note = (now, more, of = events) => rangesNote({ ...data, ...more }, { events: of }, now, timeOf);
  assert.equal(note(), "Range against time: 2 events. Hollow ones have a flag other than confirmed.");
  assert.equal(note(20), "Range against time: 2 events. At 2 ms: 100.0 mm, reported at 1 ms.");
  assert.equal(note(21), "Range against time: 2 events. At 2.1 ms: 200.1 mm, reported at 2 ms.");
  assert.equal(note(5), "Range against time: 2 events. At 0.5 ms: no event yet.");
  assert.ok(note(5, { oneOf: 8 }).startsWith("Range against time: 2 events (1 of 8). "));
  assert.equal(note(5, {}, []), "The pixel has no event.");
  assert.equal(note(5, { oneOf: 8 }, []), "The pixel has no event among those shown.");
});
