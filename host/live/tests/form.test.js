import assert from "node:assert/strict";
import { test } from "node:test";

import { FIELDS, currentValue, isHalfGate, isUsed, nameOf, settingsText } from "../src/page/form.js";

const settings = { gate: [3, 90],
  sensor: { sigma_bins: 1.5, dead_time: 0, masked: [7], bins: 128 },
  detection: { rule: "window", window: 5, z: 5.5, alpha: 4, min_count: 3, x: 10, l1: 40, l2: 1000, estimator: "centroid",
    echoes: 2, echo_wait: 7, binning: 1, patience: 50, tracking: true, half_widths: [1, 2] } };

/** The texts of the form, as the page shows the settings. */
function textsOf(settings, more) {
  return { ...Object.fromEntries(FIELDS.map((field) => [nameOf(field), String(currentValue(settings, field))])), ...more };
}

/** The lines of the text by section. */
function linesOf(text) {
  const [, sensor, detection] = text.match(/^\[sensor\]\n([^]*)\[detection\]\n([^]*)$/);
  return { sensor: sensor.split("\n").slice(0, -1), detection: detection.split("\n").slice(0, -1) };
}

test("every field has its own name and its current value", () => {
  const names = FIELDS.map(nameOf);
  assert.equal(new Set(names).size, names.length);
  const texts = textsOf(settings);
  assert.deepEqual([texts["sensor.gate0"], texts["sensor.gate1"], texts["sensor.dead_time"], texts["detection.rule"]],
    ["3", "90", "0", "window"]);
  // Before the settings are known.
  assert.ok(Object.values(textsOf(null)).every((text) => text === ""));
});

test("a rule uses its own fields", () => {
  const of = (rule) => FIELDS.filter((field) => field[4] && isUsed(field, rule)).map(([, key]) => key);
  assert.deepEqual(of("paper"), ["alpha"]);
  assert.deepEqual(of("average"), ["alpha"]);
  assert.deepEqual(of("window"), ["window", "z"]);
});

test("unchanged settings are sent as they are", () => {
  const { sensor, detection } = linesOf(settingsText(settings, textsOf(settings)));
  assert.deepEqual(sensor.sort(), ["dead_time = 0", "gate = [3,90]", "masked = [7]", "sigma_bins = 1.5"]);
  // Alpha is of the other rules.
  const expected = ["rule = \"window\"", "window = 5", "z = 5.5", "min_count = 3", "x = 10", "l1 = 40", "l2 = 1000",
    "estimator = \"centroid\"", "echoes = 2", "echo_wait = 7", "binning = 1", "patience = 50", "tracking = true", "half_widths = [1,2]"];
  assert.deepEqual(detection.sort(), expected.sort());
});

test("what belongs to another setting goes with it", () => {
  const keys = (more) => linesOf(settingsText(settings, textsOf(settings, more))).detection.map((line) => line.split(" ")[0]);
  const left = (more) => ["tracking", "half_widths", "patience", "echo_wait", "window", "z", "alpha"]
    .filter((key) => !keys(more).includes(key));
  assert.deepEqual(left({}), ["alpha"]);
  assert.deepEqual(left({ "detection.rule": "paper", "detection.alpha": "5" }), ["tracking", "window", "z"]);
  assert.deepEqual(left({ "sensor.sigma_bins": "2" }), ["half_widths", "alpha"]);
  assert.deepEqual(left({ "detection.estimator": "" }), ["half_widths", "alpha"]);
  assert.deepEqual(left({ "detection.binning": "0" }), ["patience", "alpha"]);
  assert.deepEqual(left({ "detection.echoes": "1" }), ["echo_wait", "alpha"]);
});

test("edits are sent as numbers or texts, and empty fields are not", () => {
  const { sensor, detection } = linesOf(settingsText(settings, textsOf(settings,
    { "detection.z": "6.25", "detection.x": "", "sensor.sigma_bins": "", "detection.estimator": "window" })));
  assert.ok(detection.includes("z = 6.25") && detection.includes("estimator = \"window\""));
  assert.ok(!detection.some((line) => line.startsWith("x = ")));
  assert.ok(!sensor.some((line) => line.startsWith("sigma_bins")));
});

test("a gate has two ends or none", () => {
  const gate = (first, last) => ({ "sensor.gate0": first, "sensor.gate1": last });
  assert.deepEqual([gate("", ""), gate("3", ""), gate("", "9"), gate("3", "9")].map(isHalfGate), [false, true, true, false]);
  const lines = (more) => linesOf(settingsText(settings, textsOf(settings, more))).sensor;
  assert.ok(lines(gate("4", "9")).includes("gate = [4,9]"));
  assert.ok(!lines(gate("", "")).some((line) => line.startsWith("gate")));
});
