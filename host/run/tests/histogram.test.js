import assert from "node:assert/strict";
import { test } from "node:test";

import { liveOf, needsOf, planOf } from "../src/report/shared/looks.js";
import { cellsOf, isDoubtful, remarks, spanOfRanges } from "../src/report/shared/pixel-events.js";

const counts = [1, 2, 30, 4, 0, 0, 5, 0];
const look = { peak: [2, 30], needed: 12, background: 1.5, quadrants: [0, 2, 4, 6, 8], window: null, dead_time: 0 };

test("the plot has room for the peak and for a number that photons may reach", () => {
  const top = (needed) => planOf({ counts, look: { ...look, needed } }).top;
  assert.equal(top(12), 33);
  assert.equal(top(100), 100 * 1.1);
  // Too far to be shown.
  assert.equal(top(8 * 30 + 16), 33);
  assert.equal(planOf({ counts: [0, 1], look: { ...look, needed: null } }).top, 4.4);
});

test("levels are what is needed and the background", () => {
  const { levels, peak, quadrants } = planOf({ counts, look });
  assert.deepEqual(levels.map(({ name, isNeeded, at }) => [name, isNeeded, at(5)]),
    [["12 needed", true, 12], ["background 1.5", false, 1.5]]);
  assert.deepEqual([peak, quadrants], [[2, 30], [0, 2, 4, 6, 8]]);
  const names = (more) => planOf({ counts, look: { ...look, ...more } }).levels.map(({ name }) => name);
  assert.deepEqual(names({ needed: 0, background: 0 }), []);
  assert.deepEqual(names({ needed: 1000 }), ["background 1.5"]);
  // A device that tracks gives neither.
  assert.deepEqual(names({ needed: null, background: null }), []);
});

test("outside of the gate and around echoes bins are left out", () => {
  const plan = planOf({ counts, look, leftOut: [[4, 5]] }, [1, 6]);
  assert.deepEqual(plan.out, [[0, 0], [7, 7], [4, 5]]);
  assert.deepEqual([plan.first, plan.last], [1, 6]);
  const whole = planOf({ counts, look });
  assert.deepEqual([whole.first, whole.last, whole.out], [0, 7, [[0, -1], [8, 7]]]);
});

test("a histogram without a look is drawn as well", () => {
  for (const none of [undefined, null]) {
    const { bins, levels, peak, window, quadrants } = planOf({ counts, look: none });
    assert.deepEqual([bins, levels, peak, window, quadrants], [8, [], [0, 0], null, []]);
  }
});

test("with a dead time a bin is live without photons before it", () => {
  assert.deepEqual(liveOf([3, 2, 0, 1], 10, 2), [10, 7, 5, 8]);
  assert.deepEqual(liveOf([9, 9, 0], 10, 2), [10, 1, 0]);
  const { levels: [{ name, at }] } = planOf({ counts: [3, 2, 0, 1], exposure: 10,
    look: { ...look, peak: [1, 2], needed: null, background: 1.4, dead_time: 2 } });
  assert.equal(name, "background 1.4 at the peak");
  assert.deepEqual([0, 1, 2, 3].map((bin) => Number(at(bin).toFixed(6))), [2, 1.4, 1, 1.6]);
});

test("it is said what the rule needs, whatever the settings", () => {
  const text = (more) => needsOf({ needed: null, dead_time: 0, depends: false, ...more });
  assert.equal(text({ needed: 1200 }), "the rule needs 1,200");
  assert.equal(text({ needed: 0 }), "the bins beside it are enough for the rule");
  assert.equal(text({}), "no number is enough");
  // Tracking, neighbours or several echoes, with a dead time or without.
  const depends = "the required number depends on earlier events or on neighbours";
  assert.equal(text({ depends: true }), depends);
  assert.equal(text({ depends: true, dead_time: 3 }), depends);
  assert.equal(text({ dead_time: 3 }), "the rule weighs each bin by the laser cycles in which it was live");
});

test("the span of ranges has some room", () => {
  assert.deepEqual(spanOfRanges([{ range: 100 }]), [95, 105]);
  assert.deepEqual(spanOfRanges([{ range: 300 }, { range: 100 }, { range: 200 }]), [80, 320]);
});

test("flags, block and echo are remarks", () => {
  const text = (flags, level = 0, echo = 1) => remarks({ flags, level, echo });
  assert.equal(text(0), "");
  assert.deepEqual([...Array(6).keys()].map((bit) => text(1 << bit)),
    ["saturated", "clipped", "deferred", "pile-up", "tail", "confirmed"]);
  assert.equal(text(0, 0, 2), "echo 2");
  assert.equal(text(0b10001, 2, 3), "saturated, tail, 4×4 block, echo 3");
  assert.deepEqual([0, 0b100000, 0b1, 0b100001].map((flags) => isDoubtful({ flags })), [false, false, true, true]);
});

test("a table has the last 30 events, the newest first", () => {
  const events = Array.from({ length: 40 }, (_, at) => ({ cycle: 1000 + at, range: at / 2, peak: NaN, background: 1.6,
    exposure: 20, flags: 2, level: 0, echo: 1 }));
  const cells = cellsOf(["time", "cycle", "range", "peak", "background", "exposure", "flags"], events, ({ cycle }) => `at ${cycle}`);
  assert.equal(cells.length, 30);
  assert.deepEqual(cells[0], ["at 1039", "1,039", "19.5", "–", "2", "20", "clipped"]);
  assert.equal(cells[29][1], "1,010");
  assert.deepEqual(cellsOf(["range"], events.slice(0, 1)), [["0.0"]]);
});
