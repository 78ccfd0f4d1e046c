// The settings form as text: keys of dtof.toml that can change while a device runs.

import { VALUES } from "./values.js";

/** Section, key, label, input, the rules that use it, and the index in a list. */
export const FIELDS = [
  ["detection", "rule", "rule"],
  ["detection", "alpha", "α, standard deviations", ["paper", "average"]],
  ["detection", "window", "window, bins", ["window"]],
  ["detection", "z", "z, standard deviations", ["window"]],
  ["detection", "min_count", "fewest photons"],
  ["detection", "x", "X, laser cycles"],
  ["detection", "l1", "L1, laser cycles"],
  ["detection", "l2", "L2, laser cycles"],
  ["sensor", "gate", "gate, first", null, 0],
  ["sensor", "gate", "gate, last", null, 1],
  ["sensor", "sigma_bins", "pulse σ, bins"],
  ["sensor", "dead_time", "TDC dead time, bins"],
  ["detection", "estimator", "estimator"],
  ["detection", "echoes", "echoes"],
  ["detection", "binning", "levels of blocks"],
  ["detection", "patience", "patience, laser cycles"],
].map(([section, key, label, rules, at]) => {
  // Without an estimator it is the one that suits the pulse.
  const values = key === "estimator" ? ["", ...VALUES[key]] : VALUES[key];
  return [section, key, label, values, rules, at];
});
/** Sensor keys that are sent unchanged if the form has no field for them. */
const KEPT = ["masked", "sigma_bins", "dead_time"];

/** The name of a field in the form. */
export function nameOf([section, key, , , , at]) {
  return `${section}.${key}${at ?? ""}`;
}

/** Whether a rule uses a field. */
export function isUsed([, , , , rules], rule) {
  return !rules || rules.includes(rule);
}

/** The value of a field in the device's settings, empty without. */
export function currentValue(settings, [section, key, , , , at]) {
  const value = key === "gate" ? settings?.gate : settings?.[section]?.[key];
  return (at === undefined ? value : value?.[at]) ?? "";
}

/** Whether a gate has one end only, in the texts of fields by name. */
export function isHalfGate(texts) {
  return (texts["sensor.gate0"] === "") !== (texts["sensor.gate1"] === "");
}

/**
 * The texts of the fields by name, and what of the device's settings they leave, as TOML; these values are
 * written alike in JSON and TOML.
 */
export function settingsText(current, texts) {
  const settings = { sensor: {}, detection: { ...current?.detection } };
  for (const key of KEPT) settings.sensor[key] = current?.sensor?.[key];
  const rule = texts["detection.rule"];
  // Half widths belong to a pulse and an estimator, tracking to the window rule.
  const isChanged = (name) => {
    const field = FIELDS.find(([, key]) => key === name);
    return texts[nameOf(field)] !== String(currentValue(current, field));
  };
  if (isChanged("sigma_bins") || isChanged("estimator")) delete settings.detection.half_widths;
  if (rule !== "window") delete settings.detection.tracking;
  for (const field of FIELDS) {
    const [section, key, , input] = field;
    const text = texts[nameOf(field)];
    if (key === "gate") continue;
    if (text === "" || !isUsed(field, rule)) delete settings[section][key];
    else settings[section][key] = Array.isArray(input) ? text : Number(text);
  }
  // A gate without ends has all bins.
  const gate = [texts["sensor.gate0"], texts["sensor.gate1"]];
  settings.sensor.gate = gate.includes("") ? null : gate.map(Number);
  if (!(settings.detection.binning > 0)) delete settings.detection.patience;
  if (!(settings.detection.echoes > 1)) delete settings.detection.echo_wait;
  const lines = (section) => Object.entries(settings[section])
    .filter(([, value]) => value !== null && value !== undefined)
    .map(([key, value]) => `${key} = ${JSON.stringify(value)}`);
  return ["[sensor]", ...lines("sensor"), "[detection]", ...lines("detection"), ""].join("\n");
}
