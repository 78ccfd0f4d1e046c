import assert from "node:assert/strict";
import { test } from "node:test";

import { palette } from "../src/report/shared/colours.js";
import { axes, camera, eachPlace, eventAt, pointSize } from "../src/report/shared/projection.js";
import { drawSquares } from "../src/report/shared/squares.js";
import { drag, enlarge, look, newView, press, turn } from "../src/report/shared/turning.js";

/** A scene of events: pixel, level, range, laser cycle. */
function sceneOf(columns, rows, rowsOfEvents, name = "front") {
  const column = (at) => rowsOfEvents.map((event) => event[at]);
  const events = { count: rowsOfEvents.length, pixel: column(0), level: column(1), range: column(2), cycle: column(3) };
  const view = newView();
  look(view, name);
  return { columns, rows, sides: ["column", "row"], events, view, clock: { unit: "ms", per: 10 },
    levels: rowsOfEvents.map((_, event) => 10 * event),
    nearest: Math.min(...events.range), farthest: Math.max(...events.range),
    shown: { start: 0, end: 100, first: 0, last: rowsOfEvents.length, far: Infinity } };
}

function placesOf(scene, width, height) {
  const sides = axes(scene);
  const eye = camera(sides, scene.view, width, height);
  const places = [];
  eachPlace(scene, sides, eye, (event, x, y, depth, wide, high) => places.push({ event, x, y, depth, wide, high }));
  return { sides, eye, places };
}

const near = (found, expected, limit = 1e-9) =>
  assert.ok(Math.abs(found - expected) <= limit, `${found}, not ${expected}`);

test("the third axis spans all ranges, and is linear", () => {
  const ranges = [500, 1000, 2000, 9000];
  const { sides, places } = placesOf(sceneOf(1, 1, ranges.map((range, at) => [0, 0, range, at]), "side"), 800, 600);
  assert.deepEqual([sides[2].low, sides[2].high], [500, 9000]);
  const [left, right] = [places[0].x, places[3].x];
  assert.ok(right - left > 100);
  ranges.forEach((range, at) => near(places[at].x, left + ((right - left) * (range - 500)) / 8500, 1e-6));
});

test("one range has room around it", () => {
  const [, , third] = axes(sceneOf(1, 1, [[0, 0, 700, 0]]));
  assert.deepEqual([third.low, third.high], [699.5, 700.5]);
});

test("the time can be the third axis", () => {
  const scene = sceneOf(1, 1, [[0, 0, 1, 25], [0, 0, 9, 75]], "side");
  scene.view.third = "cycle";
  const { sides, eye, places } = placesOf(scene, 800, 600);
  assert.equal(sides[2].name, "time, ms");
  assert.deepEqual([sides[2].low, sides[2].high, sides[2].per], [0, 100, 10]);
  near(places[1].x - places[0].x, 0.5 * 1.3 * eye.scale, 1e-6);
});

test("sides are as long as their pixels, the longest 1", () => {
  const lengths = (columns, rows) => axes(sceneOf(columns, rows, [[0, 0, 1, 0]])).map(({ length }) => length);
  assert.deepEqual(lengths(8, 4), [1, 0.5, 1]);
  assert.deepEqual(lengths(2, 100), [0.3, 1, 1]);
});

test("the point of a block lies in the middle of its pixels", () => {
  const blocks = [[7, 0], [2, 1], [0, 2], [0, 3], [14, 1]];
  const scene = sceneOf(5, 3, blocks.map(([pixel, level]) => [pixel, level, 1000, 0]));
  const { sides, eye, places } = placesOf(scene, 800, 600);
  const cell = (eye.scale * sides[0].length) / 5;
  const [left, top] = [400 - 2.5 * cell, 292 - 1.5 * cell];
  const expected = [[2.5, 1.5, 1, 1], [3, 1, 2, 2], [2, 1.5, 4, 3], [2.5, 1.5, 5, 3], [4.5, 2.5, 1, 1]];
  places.forEach(({ x, y, wide, high }, event) => {
    near((x - left) / cell, expected[event][0], 1e-6);
    near((y - top) / cell, expected[event][1], 1e-6);
    assert.deepEqual([wide, high], expected[event].slice(2));
  });
});

test("the coefficients of the camera are its projection", () => {
  const scene = sceneOf(4, 4, [[1, 0, 100, 0], [14, 0, 300, 0]], "reset");
  const { sides, eye, places } = placesOf(scene, 640, 480);
  const x = (column) => ((column + 0.5) / 4 - 0.5) * sides[0].length;
  const expected = [eye.project(x(1), x(0), -0.5), eye.project(x(2), x(3), 0.5)];
  places.forEach((place, at) => {
    for (const part of ["x", "y", "depth"]) near(place[part], expected[at][part], 1e-6);
  });
});

test("the whole box is seen, whichever way it is turned", () => {
  const scene = sceneOf(8, 5, [[0, 0, 1, 0], [1, 0, 2, 0]]);
  const ends = [-0.5, 0.5];
  for (let yaw = -3; yaw < 3; yaw += 0.37) {
    for (let pitch = -1.5; pitch < 1.5; pitch += 0.31) {
      Object.assign(scene.view, { yaw, pitch });
      const sides = axes(scene);
      const eye = camera(sides, scene.view, 900, 700);
      for (const corner of ends.flatMap((a) => ends.flatMap((b) => ends.map((c) => [a, b, c])))) {
        const { x, y } = eye.project(...corner.map((end, side) => end * sides[side].length));
        assert.ok(x >= 64.9 && x <= 835.1 && y >= 36.9 && y <= 655.1, `${yaw} ${pitch}: ${x} ${y}`);
      }
    }
  }
});

test("what is too far or not in the window of time is not placed", () => {
  const scene = sceneOf(2, 2, [[0, 0, 100, 0], [1, 0, 200, 1], [2, 0, 300, 2]]);
  scene.shown.far = 250;
  assert.deepEqual(placesOf(scene, 400, 400).places.map(({ event }) => event), [0, 1]);
  scene.shown.first = 1;
  assert.deepEqual(placesOf(scene, 400, 400).places.map(({ event }) => event), [1]);
});

test("a click finds the event at its place, of two the nearer one", () => {
  const scene = sceneOf(4, 4, [[5, 0, 900, 0], [5, 0, 100, 1], [10, 0, 500, 2], [0, 1, 500, 3]]);
  const { places } = placesOf(scene, 600, 600);
  const at = (event, off = 0) => eventAt(scene, places[event].x + off, places[event].y, 600, 600);
  assert.equal(at(2), 2);
  assert.equal(at(0), 1);
  assert.equal(at(1), 1);
  assert.equal(at(2, 5), 2);
  assert.equal(eventAt(scene, 5, 5, 600, 600), -1);
  // Half of a block away from its middle.
  assert.equal(at(3, 9), 3);
});

test("squares are closed where the third axis is the range", () => {
  const scene = sceneOf(64, 64, [[0, 0, 1, 0]]);
  const eye = { scale: 640 };
  near(pointSize(scene, axes(scene), eye), 9);
  near(pointSize(scene, axes(scene), eye, 4), 36);
  scene.view.third = "cycle";
  near(pointSize(scene, axes(scene), eye), 5.5);
  // Neither too small to be seen nor larger than ten.
  assert.equal(pointSize(scene, axes(scene), { scale: 1 }), 2);
  assert.equal(pointSize(scene, axes(scene), { scale: 1e6 }), 10);
});

/** Draws a scene. Returns the colour at a place. */
function draw(scene, isDark, width = 300, height = 300) {
  const image = { width, height, data: new Uint8ClampedArray(4 * width * height) };
  const { sides, eye, places } = placesOf(scene, width, height);
  drawSquares(image, scene, sides, eye, 1, isDark);
  const colours = new Uint32Array(image.data.buffer);
  const at = (x, y) => colours[Math.round(y) * width + Math.round(x)];
  return { colours, places, at };
}

test("nearer squares hide those behind them, in either order", () => {
  for (const order of [[900, 100], [100, 900]]) {
    const { places, at } = draw(sceneOf(1, 1, order.map((range, cycle) => [0, 0, range, cycle])), false);
    assert.equal(at(places[0].x, places[0].y), palette[10 * order.indexOf(100)]);
  }
});

test("a square has an edge, dark on a light page and light on a dark one", () => {
  const bytes = (colour) => [...new Uint8Array(Uint32Array.of(colour).buffer)].slice(0, 3);
  for (const [isDark, edge] of [[false, 0], [true, 255]]) {
    const { places, at } = draw(sceneOf(1, 1, [[0, 0, 100, 0]]), isDark);
    const [{ x, y }] = places;
    const inner = bytes(palette[0]);
    assert.deepEqual(bytes(at(x, y)), inner);
    bytes(at(x - 5, y)).forEach((byte, part) => near(byte, inner[part] + (edge - inner[part]) * 0.4, 0.5));
    assert.equal(at(x - 6, y), 0);
  }
});

test("squares beyond the border are cut", () => {
  const scene = sceneOf(3, 3, [[0, 0, 1, 0], [8, 0, 2, 0]]);
  scene.view.zoom = 20;
  assert.ok(draw(scene, false, 60, 60).colours.every((colour) => colour === 0));
  // A square on the left border does not go on at the right.
  for (const [pixel, columns] of [[0, [0, 1, 2, 3, 4]], [1, [15, 16, 17, 18, 19]]]) {
    const { colours: drawn, places: [{ x }] } = draw(sceneOf(2, 1, [[pixel, 0, 1, 0]]), false, 20, 100);
    near(x, 20 * pixel);
    const found = new Set([...drawn].flatMap((colour, at) => (colour > 0 ? [at % 20] : [])));
    assert.deepEqual([...found].sort((one, other) => one - other), columns);
  }
});

test("the view turns until it stands on its head, and has limits of size", () => {
  const view = newView();
  turn(view, 0.5, 9);
  assert.deepEqual([view.yaw, view.pitch], [1.25, Math.PI / 2]);
  turn(view, 0, -9);
  assert.equal(view.pitch, -Math.PI / 2);
  enlarge(view, 100);
  assert.equal(view.zoom, 20);
  enlarge(view, 0.001);
  assert.equal(view.zoom, 0.5);
});

test("keys turn, and 0 gives back the first view", () => {
  const view = newView();
  for (const [key, part, by] of [["ArrowLeft", "yaw", 0.1], ["ArrowRight", "yaw", -0.1],
    ["ArrowUp", "pitch", -0.1], ["ArrowDown", "pitch", 0.1]]) {
    const before = view[part];
    assert.ok(press(view, key));
    near(view[part] - before, by);
  }
  assert.ok(press(view, "+"));
  near(view.zoom, 1.2);
  assert.ok(press(view, "-"));
  near(view.zoom, 1);
  assert.ok(press(view, "="));
  view.third = "cycle";
  assert.ok(press(view, "0"));
  assert.deepEqual(view, { ...newView(), third: "cycle" });
  assert.ok(!press(view, "x") && !press(view, "constructor"));
  assert.deepEqual(view, { ...newView(), third: "cycle" });
});

test("a finger turns, two change the size", () => {
  const view = newView();
  const fingers = new Map([[1, [100, 100]]]);
  near(drag(view, fingers, 1, [130, 140]), 50);
  near(view.yaw, 0.75 - 30 / 150);
  near(view.pitch, 0.4 + 40 / 150);
  assert.deepEqual(fingers.get(1), [130, 140]);
  fingers.set(2, [130, 239]);
  const { yaw, pitch } = view;
  drag(view, fingers, 2, [130, 339]);
  near(view.zoom, 2);
  drag(view, fingers, 1, [130, 240]);
  near(view.zoom, 1);
  assert.deepEqual([view.yaw, view.pitch], [yaw, pitch]);
});
