// The settings form: keys of dtof.toml that can change while a device runs.

const number32 = (min, step) => ({ type: "number", min, step });
/** Section, key, label, input, the rules that use it, and the index in a list. */
const FIELDS = [
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
/** Names of the fields with edits that are not applied yet. */
const edited = new Set();
/** Sensor keys that are sent unchanged if the form has no field for them. */
const KEPT = ["masked", "sigma_bins", "dead_time"];

function makeFields() {
  for (const [section, key, name, input, rules, at] of FIELDS) {
    const label = document.createElement("label");
    const field = document.createElement(Array.isArray(input) ? "select" : "input");
    if (Array.isArray(input)) input.forEach((text) => field.add(new Option(text || "as suits", text)));
    else Object.assign(field, input);
    label.append(name, field);
    Object.assign(label.dataset, { rules: rules ?? "" });
    Object.assign(field, { name: `${section}.${key}${at ?? ""}` });
    field.addEventListener("input", () => {
      edited.add(field.name);
      markChanged();
    });
    element("fields").append(label);
  }
}

function currentValue([section, key, , , , at]) {
  const value = key === "gate" ? source?.settings?.gate : source?.settings?.[section]?.[key];
  return (at === undefined ? value : value?.[at]) ?? "";
}

function fieldOf([section, key, , , , at]) {
  return element("settings").elements[`${section}.${key}${at ?? ""}`];
}

/** Fills the form with the current settings, except edited fields. */
function fillSettings() {
  for (const field of FIELDS) {
    const input = fieldOf(field);
    if (!edited.has(input.name)) input.value = currentValue(field);
  }
  markChanged();
}

function markChanged() {
  const rule = element("settings").elements["detection.rule"].value;
  for (const field of FIELDS) {
    const input = fieldOf(field);
    const label = input.closest("label");
    label.hidden = label.dataset.rules !== "" && !label.dataset.rules.split(",").includes(rule);
    const isChanged = String(currentValue(field)) !== input.value;
    label.classList.toggle("changed", isChanged);
    if (!isChanged) edited.delete(input.name);
  }
}

/** The ends of the gate as typed. */
function gateEnds() {
  return ["sensor.gate0", "sensor.gate1"].map((name) => element("settings").elements[name].value);
}

/** The settings as TOML; these values are written alike in JSON and TOML. */
function settingsText() {
  const settings = { sensor: {}, detection: { ...source?.settings?.detection } };
  for (const key of KEPT) settings.sensor[key] = source?.settings?.sensor?.[key];
  const rule = element("settings").elements["detection.rule"].value;
  // Half widths belong to a pulse and an estimator, tracking to the window rule.
  const isChanged = (name) => {
    const field = FIELDS.find(([, key]) => key === name);
    return fieldOf(field).value !== String(currentValue(field));
  };
  if (isChanged("sigma_bins") || isChanged("estimator")) delete settings.detection.half_widths;
  if (rule !== "window") delete settings.detection.tracking;
  for (const field of FIELDS) {
    const [section, key, , input, rules] = field;
    const { value } = fieldOf(field);
    const isUsed = !rules || rules.includes(rule);
    if (key === "gate") continue;
    if (value === "" || !isUsed) delete settings[section][key];
    else settings[section][key] = Array.isArray(input) ? value : Number(value);
  }
  // A gate without ends has all bins.
  const gate = gateEnds();
  settings.sensor.gate = gate.includes("") ? null : gate.map(Number);
  if (!(settings.detection.binning > 0)) delete settings.detection.patience;
  if (!(settings.detection.echoes > 1)) delete settings.detection.echo_wait;
  const lines = (section) => Object.entries(settings[section])
    .filter(([, value]) => value !== null && value !== undefined)
    .map(([key, value]) => `${key} = ${JSON.stringify(value)}`);
  return ["[sensor]", ...lines("sensor"), "[detection]", ...lines("detection"), ""].join("\n");
}

/** Shows the device's answer on the form. */
function showAnswer(text, isBad) {
  const answer = element("answer");
  answer.textContent = text;
  answer.classList.toggle("bad", isBad);
  answer.hidden = text === "";
}

makeFields();
element("settings").addEventListener("submit", async (event) => {
  event.preventDefault();
  if (gateEnds().filter((end) => end === "").length === 1) {
    showAnswer("Refused: a gate needs both ends, or none for all bins", true);
    return;
  }
  showAnswer("Waiting for the device …", false);
  const [before, sent] = [source, FIELDS.map((field) => fieldOf(field).value)];
  const { done, text } = await post("/settings", settingsText(), "application/toml");
  showAnswer(done ? text : `Refused: ${text}`, !done);
  if (!done) return;
  // The sent settings are applied, perhaps rounded. Later edits are not.
  FIELDS.map(fieldOf).forEach((input, at) => input.value === sent[at] && edited.delete(input.name));
  if (source !== before) fillSettings();
});
element("undo").addEventListener("click", () => {
  edited.clear();
  fillSettings();
  showAnswer("", false);
});
element("save").addEventListener("click", () => command("/save", {}));
