import assert from "node:assert/strict";
import { test } from "node:test";

import { closest, holds, neighbour, pixelAt, pixelName } from "../src/report/shared/array.js";
import { isOfBrowser, stepOf } from "../src/report/shared/keys.js";

const array = { columns: 5, rows: 3, sides: ["column", "row"] };
const all = [...Array(15).keys()];

test("a pixel is called by its column and row", () => {
  assert.equal(pixelName(array, 7), "column 2, row 1");
  assert.equal(pixelName({ columns: 2, sides: ["zone", "capture"] }, 5), "zone 1, capture 2");
});

test("a place of a map is that of a pixel", () => {
  // 100 by 60 of 5 by 3 pixels: 20 each.
  assert.equal(pixelAt(array, 0, 0, 100, 60), 0);
  assert.equal(pixelAt(array, 19.9, 19.9, 100, 60), 0);
  assert.equal(pixelAt(array, 20, 19.9, 100, 60), 1);
  assert.equal(pixelAt(array, 20, 20, 100, 60), 6);
  // The border, and beyond.
  assert.equal(pixelAt(array, 100, 60, 100, 60), 14);
  assert.equal(pixelAt(array, -1, 61, 100, 60), 10);
  assert.equal(pixelAt({ columns: 0, rows: 0 }, 1, 1, 100, 60), -1);
});

test("a neighbour is within the array", () => {
  assert.equal(neighbour(array, 7, [1, 0]), 8);
  assert.equal(neighbour(array, 7, [0, 1]), 12);
  assert.equal(neighbour(array, 7, [-1, -1]), 1);
  // Not the pixel of the next row.
  assert.equal(neighbour(array, 4, [1, 0]), -1);
  assert.equal(neighbour(array, 5, [-1, 0]), -1);
  assert.equal(neighbour(array, 2, [0, -1]), -1);
  assert.equal(neighbour(array, 12, [0, 1]), -1);
});

test("a block has its pixels, also where the array cuts it", () => {
  const of = (first, level) => all.filter((pixel) => holds(array, first, level, pixel));
  assert.deepEqual(of(7, 0), [7]);
  assert.deepEqual(of(2, 1), [2, 3, 7, 8]);
  assert.deepEqual(of(0, 2), [0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13]);
  assert.deepEqual(of(0, 3), all);
  assert.deepEqual(of(14, 1), [14]);
});

test("the closest pixel of those that suit", () => {
  assert.equal(closest(array, [2, 1], () => true), 7);
  assert.equal(closest(array, [2, 1], (pixel) => pixel === 14 || pixel === 9), 9);
  assert.equal(closest(array, [2, 1], () => false), -1);
});

test("arrow keys step, unless they are the browser's", () => {
  const press = (key, more) => stepOf({ key, ctrlKey: false, metaKey: false, altKey: false, ...more });
  assert.deepEqual(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"].map((key) => press(key)),
    [[-1, 0], [1, 0], [0, -1], [0, 1]]);
  assert.equal(press("a"), undefined);
  for (const key of ["ctrlKey", "metaKey", "altKey"]) {
    assert.equal(press("ArrowLeft", { [key]: true }), undefined);
    assert.ok(isOfBrowser({ [key]: true }));
  }
  assert.ok(!isOfBrowser({ ctrlKey: false, metaKey: false, altKey: false, shiftKey: true }));
});
