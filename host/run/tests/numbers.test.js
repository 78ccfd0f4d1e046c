import assert from "node:assert/strict";
import { test } from "node:test";

import { colours, palette } from "../src/report/shared/colours.js";
import { capital, fixed, level, number, share, ticks, timeUnit } from "../src/report/shared/numbers.js";

test("a share lies between 0 and 1 within the ends", () => {
  assert.equal(share(10, 10, 30), 0);
  assert.equal(share(15, 10, 30), 0.25);
  assert.equal(share(40, 10, 30), 1.5);
});

test("levels end at the ends", () => {
  assert.deepEqual([-5, 0, 50, 100, 200].map((value) => Math.floor(level(value, 0, 100))), [0, 0, 128, 255, 255]);
  // Each of the 256 levels is as wide as the others, but for the two ends.
  assert.equal(Math.floor(level(0.49 / 255, 0, 1)), 0);
  assert.equal(Math.floor(level(0.51 / 255, 0, 1)), 1);
  assert.equal(level(7, 7, 7), 127);
});

test("a time has the largest unit of which there is one", () => {
  const unit = (cycles, hz) => timeUnit(cycles, hz);
  assert.deepEqual(unit(20_000, 20_000), { unit: "s", per: 20_000, isWhole: false });
  assert.deepEqual(unit(19_999, 20_000), { unit: "ms", per: 20, isWhole: false });
  assert.deepEqual(unit(5, 1e6), { unit: "µs", per: 1, isWhole: false });
  // Shorter than the shortest unit.
  assert.equal(unit(1, 1e7).unit, "µs");
  assert.deepEqual(unit(1000, 0), { unit: "laser cycle", per: 1, isWhole: true });
});

test("ticks are round, within the ends, and not too many", () => {
  assert.deepEqual(ticks(0, 10, 5), [0, 2, 4, 6, 8, 10]);
  assert.deepEqual(ticks(0, 20, 4), [0, 5, 10, 15, 20]);
  assert.deepEqual(ticks(3, 10, 5), [4, 6, 8, 10]);
  assert.deepEqual(ticks(-0.4, 0.4, 4).map((tick) => Number(tick.toFixed(6))), [-0.4, -0.2, 0, 0.2, 0.4]);
  assert.deepEqual(ticks(0, 3, 10, true), [0, 1, 2, 3]);
  assert.deepEqual(ticks(0, 1, 0), [0, 1]);
  for (const tick of ticks(-1, 1, 4)) assert.ok(!Object.is(tick, -0));
  for (let most = 1; most < 20; most++) {
    for (const [low, high] of [[0, 1], [-7, 1234], [1e6, 1e6 + 3]]) {
      const all = ticks(low, high, most);
      assert.ok(all.length <= most + 1, `${low} to ${high}: ${all}`);
      assert.ok(all.every((tick) => tick >= low && tick <= high));
    }
  }
});

test("numbers have commas, and as many digits as are asked for", () => {
  assert.equal(number(1234567.8), "1,234,568");
  assert.equal(number(1.25, 1), "1.3");
  assert.equal(number(2, 4), "2");
  assert.equal(fixed(2, 2), "2.00");
  assert.equal(fixed(1234.567, 1), "1,234.6");
  assert.equal(capital("events"), "Events");
});

test("the palette has the bytes of each colour", () => {
  assert.equal(colours.length, 256);
  assert.deepEqual([colours[0], colours[127], colours[255]], ["#440154", "#23908c", "#fee825"]);
  const bytes = new Uint8Array(palette.buffer, 4 * 127, 4);
  assert.deepEqual([...bytes], [0x23, 0x90, 0x8c, 255]);
});
