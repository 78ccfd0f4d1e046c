// The settings form as text: keys of dtof.toml that can change while a device runs.

const number32 = (min, step) => ({ type: "number", min, step });
/** Section, key, label, input, the rules that use it, and the index in a list. */
export const FIELDS = [
  ["detection", "rule", "rule", ["paper", "average", "window"]],
  ["detection", "alpha", "α, standard deviations", number32(0, "any"), ["paper", "average"]],
  ["detection", "window", "window, bins", number32(1, 1), ["window"]],
  ["detection", "z", "z, standard deviations", number32(0, "any"), ["window"]],
  ["detection", "min_count", "fewest photons", number32(1, 1)],
  ["detection", "x", "X, laser cycles", number32(0, 1)],
  ["detection", "l1", "L1, laser cycles", number32(0, 1)],
  ["detection", "l2", "L2, laser cycles", number32(0, 1)],
  ["sensor", "gate", "gate, first", { type: "number", min: 0, step: 1 }, null, 0],
  ["sensor", "gate", "gate, last", { type: "number", min: 0, step: 1 }, null, 1],
  ["sensor", "sigma_bins", "pulse σ, bins", number32(0, "any")],
  ["sensor", "dead_time", "TDC dead time, bins", number32(0, 1)],
  ["detection", "estimator", "estimator", ["", "centroid", "window"]],
  ["detection", "echoes", "echoes", number32(1, 1)],
  ["detection", "binning", "levels of blocks", number32(0, 1)],
  ["detection", "patience", "patience, laser cycles", number32(1, 1)],
];
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
