import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { cloudOf, countsFrom, emptyPixels, eventsFrom, span, takePixels, takeRates } from "../src/page/records.js";
import { choosePixel, chosen, live, scene, takeCloud, takeEvents, takeHistogram, takeSource } from "../src/page/state.js";

/** Base64 of records, each written by `write` into so many bytes. */
function records(size, rows, write) {
  const bytes = new DataView(new ArrayBuffer(size * rows.length));
  rows.forEach((row, at) => write(bytes, size * at, row));
  return btoa(String.fromCharCode(...new Uint8Array(bytes.buffer)));
}

/** Pixels as `frame.rs` sends them. */
const pixelRecords = (rows) => records(20, rows, (bytes, at, { pixel, events, range, reflectivity = NaN, peak = NaN }) => {
  bytes.setUint16(at, pixel, true);
  bytes.setUint32(at + 4, events, true);
  bytes.setFloat32(at + 8, range, true);
  bytes.setFloat32(at + 12, reflectivity, true);
  bytes.setFloat32(at + 16, peak, true);
});

/** Events as `frame.rs` sends them. */
const eventRecords = (rows) => records(24, rows, (bytes, at, event) => {
  bytes.setBigUint64(at, BigInt(event.cycle), true);
  bytes.setFloat32(at + 8, event.range, true);
  bytes.setFloat32(at + 12, event.peak, true);
  bytes.setUint16(at + 16, event.exposure, true);
  bytes.setUint8(at + 18, (event.level << 4) | event.echo);
  bytes.setUint8(at + 19, event.flags);
  bytes.setFloat32(at + 20, event.background, true);
});

const event = { cycle: 2 ** 40, range: 512.5, peak: 30, exposure: 900, level: 2, echo: 3, flags: 33, background: 1.5 };

test("pixels are decoded, the last record of each counts", () => {
  const pixels = emptyPixels(4);
  assert.deepEqual([...pixels.range], [NaN, NaN, NaN, NaN]);
  takePixels(pixels, pixelRecords([
    { pixel: 3, events: 70_000, range: 250.5, reflectivity: 0.25, peak: 12 },
    { pixel: 0, events: 1, range: -1.5 },
    { pixel: 3, events: 70_001, range: 251.5, reflectivity: 0.5, peak: 13 },
    // Not of this array.
    { pixel: 4, events: 9, range: 9 },
  ]));
  assert.deepEqual([...pixels.range], [-1.5, NaN, NaN, 251.5]);
  assert.deepEqual([...pixels.events], [1, 0, 0, 70_001]);
  assert.deepEqual([...pixels.reflectivity], [NaN, NaN, NaN, 0.5]);
  assert.deepEqual([...pixels.peak], [NaN, NaN, NaN, 13]);
});

test("rates are of the events since the last measurement", () => {
  const pixels = emptyPixels(2);
  // The events before the first record do not count.
  takePixels(pixels, pixelRecords([{ pixel: 1, events: 100, range: 5 }]));
  takeRates(pixels, 2);
  assert.deepEqual([...pixels.rate], [0, 0]);
  takePixels(pixels, pixelRecords([{ pixel: 1, events: 110, range: 5 }]));
  takeRates(pixels, 2);
  assert.deepEqual([...pixels.rate], [0, 5]);
  takeRates(pixels, 2);
  assert.deepEqual([...pixels.rate], [0, 0]);
  // The device has begun again.
  takePixels(pixels, pixelRecords([{ pixel: 1, events: 3, range: 5 }]));
  takeRates(pixels, 1);
  assert.deepEqual([...pixels.rate], [0, 0]);
});

test("events are decoded with all that they have", () => {
  const second = { ...event, cycle: 7, level: 0, echo: 1, flags: 0 };
  assert.deepEqual(eventsFrom(eventRecords([event, second])), [event, second]);
  assert.deepEqual(eventsFrom(""), []);
  // A change of depth measures no light.
  const change = eventsFrom(eventRecords([{ ...event, peak: NaN, background: NaN }]))[0];
  assert.deepEqual([change.peak, change.exposure, change.background], [NaN, NaN, NaN]);
});

test("counts are decoded", () => {
  const base64 = records(4, [0, 1, 2 ** 32 - 1], (bytes, at, count) => bytes.setUint32(at, count, true));
  assert.deepEqual(countsFrom(base64), [0, 1, 2 ** 32 - 1]);
});

test("the cloud has the pixels with an event, and colours without outliers", () => {
  const pixels = emptyPixels(102);
  for (let pixel = 1; pixel < 102; pixel++) pixels.range[pixel] = 1000 + pixel;
  pixels.range[50] = 9000;
  const { events, levels, nearest, farthest, low, high } = cloudOf(pixels);
  assert.equal(events.count, 101);
  assert.deepEqual(events.pixel.slice(0, 2), [1, 2]);
  assert.deepEqual([nearest, farthest], [1001, 9000]);
  assert.deepEqual([low, high], [1003, 1100]);
  assert.deepEqual([levels[0], levels[49], levels[100]], [0, 255, 255]);
  // Before the first event.
  const empty = cloudOf(emptyPixels(3));
  assert.deepEqual([empty.events.count, empty.nearest, empty.farthest], [0, 0, 1000]);
});

test("a span goes from the 2nd to the 98th percentile", () => {
  assert.deepEqual(span(Array.from({ length: 101 }, (_, at) => 100 - at)), [2, 98]);
  assert.deepEqual(span([7]), [7, 7]);
  assert.deepEqual(span([]), [0, 0]);
});

beforeEach(() => {
  choosePixel(0);
  takeSource({ columns: 4, rows: 2 });
});

test("another source begins with no event, and keeps the chosen pixel", () => {
  choosePixel(5);
  takePixels(live.pixels, pixelRecords([{ pixel: 5, events: 1, range: 100 }]));
  takeEvents({ events: eventRecords([event]), drawn: 1, arrived: 4 });
  takeCloud();
  assert.deepEqual([scene.shown.last, scene.nearest, chosen.drawn, chosen.arrived], [1, 100, 1, 4]);
  takeSource({ columns: 3, rows: 3 });
  assert.deepEqual([scene.columns, scene.rows, live.pixels.count], [3, 3, 9]);
  assert.deepEqual(chosen, { pixel: 5, events: [], drawn: 0, arrived: 0, histogram: null });
  takeCloud();
  assert.equal(scene.shown.last, 0);
});

test("the chosen pixel keeps its last 2000 events, and counts all", () => {
  const rows = (from) => Array.from({ length: 1500 }, (_, at) => ({ ...event, cycle: from + at }));
  takeEvents({ events: eventRecords(rows(0)), drawn: 1500, arrived: 1600 });
  takeEvents({ events: eventRecords(rows(1500)), drawn: 1500, arrived: 1500 });
  assert.equal(chosen.events.length, 2000);
  assert.deepEqual([chosen.events[0].cycle, chosen.events.at(-1).cycle], [1000, 2999]);
  assert.deepEqual([chosen.drawn, chosen.arrived], [3000, 3100]);
});

test("a histogram is taken if it is of the chosen pixel", () => {
  choosePixel(2);
  takeHistogram({ pixel: 1, counts: "AQAAAA==" });
  assert.equal(chosen.histogram, null);
  takeHistogram({ pixel: 2, counts: "AQAAAAIBAAA=", exposure: 9 });
  assert.deepEqual(chosen.histogram, { pixel: 2, counts: [1, 258], exposure: 9 });
  takeHistogram({ pixel: 2, none: "it is masked" });
  assert.deepEqual(chosen.histogram, { pixel: 2, none: "it is masked" });
});
