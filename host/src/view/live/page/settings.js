// The settings form: what of dtof.toml a device takes while it runs.

const number32 = (min, step) => ({ type: "number", min, step });
/** Section, key, name, input, and of which rule. */
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
  ["detection", "estimator", "estimator", ["", "centroid", "window"]],
  ["detection", "echoes", "echoes", number32(1, 1)],
  ["detection", "binning", "levels of blocks", number32(0, 1)],
  ["detection", "patience", "patience, laser cycles", number32(1, 1)],
];
/** Keys that the device takes, and that the form has no field for, go along as they are. */
const TAKEN = { sensor: ["gate", "masked", "sigma_bins", "one_hit_tdc"] };

function makeFields() {
  for (const [section, key, name, input, rules, at] of FIELDS) {
    const label = document.createElement("label");
    const field = document.createElement(Array.isArray(input) ? "select" : "input");
    if (Array.isArray(input)) input.forEach((text) => field.add(new Option(text || "as suits", text)));
    else Object.assign(field, input);
    label.append(name, field);
    Object.assign(label.dataset, { rules: rules ?? "" });
    Object.assign(field, { name: `${section}.${key}${at ?? ""}` });
    field.addEventListener("input", markChanged);
    element("fields").append(label);
  }
}

function inForce([section, key, , , , at]) {
  const value = key === "gate" ? about?.settings?.gate : about?.settings?.[section]?.[key];
  return (at === undefined ? value : value?.[at]) ?? "";
}

function fieldOf([section, key, , , , at]) {
  return element("settings").elements[`${section}.${key}${at ?? ""}`];
}

/** Fills the form with what is in force. */
function fillSettings() {
  for (const field of FIELDS) fieldOf(field).value = inForce(field);
  markChanged();
}

function markChanged() {
  const rule = element("settings").elements["detection.rule"].value;
  let changed = 0;
  for (const field of FIELDS) {
    const input = fieldOf(field);
    const label = input.closest("label");
    label.hidden = label.dataset.rules !== "" && !label.dataset.rules.split(",").includes(rule);
    const isChanged = String(inForce(field)) !== input.value;
    label.classList.toggle("changed", isChanged);
    changed += isChanged && !label.hidden;
  }
  return changed;
}

/** The settings as a TOML text; a value in JSON is the same in TOML. */
function settingsText() {
  const said = { sensor: {}, detection: { ...about?.settings?.detection } };
  for (const key of TAKEN.sensor) said.sensor[key] = about?.settings?.sensor?.[key];
  const rule = element("settings").elements["detection.rule"].value;
  // Half widths are those of a pulse and of an estimator, z and patience of a rule and of blocks.
  const isOther = (name) => fieldOf(FIELDS.find(([, key]) => key === name)).value !== String(inForce(FIELDS.find(([, key]) => key === name)));
  if (isOther("sigma_bins") || isOther("estimator")) delete said.detection.half_widths;
  if (rule !== "window") delete said.detection.tracking;
  for (const field of FIELDS) {
    const [section, key, , input, rules] = field;
    const { value } = fieldOf(field);
    const isOf = !rules || rules.includes(rule);
    if (key === "gate") continue;
    if (value === "" || !isOf) delete said[section][key];
    else said[section][key] = Array.isArray(input) ? value : Number(value);
  }
  const gate = ["sensor.gate0", "sensor.gate1"].map((name) => element("settings").elements[name].value);
  if (gate.every((end) => end !== "")) said.sensor.gate = gate.map(Number);
  if (!(said.detection.binning > 0)) delete said.detection.patience;
  if (!(said.detection.echoes > 1)) delete said.detection.echo_wait;
  const lines = (section) => Object.entries(said[section])
    .filter(([, value]) => value !== null && value !== undefined)
    .map(([key, value]) => `${key} = ${JSON.stringify(value)}`);
  return ["[sensor]", ...lines("sensor"), "[detection]", ...lines("detection"), ""].join("\n");
}

/** Shows what the device says of settings, on the form itself. */
function showAnswer(text, isBad) {
  const answer = element("answer");
  answer.textContent = text;
  answer.classList.toggle("bad", isBad);
  answer.hidden = text === "";
}

makeFields();
element("settings").addEventListener("submit", async (event) => {
  event.preventDefault();
  showAnswer("The device is asked …", false);
  const { done, text } = await ask("/settings", settingsText(), "application/toml");
  showAnswer(done ? text : `Refused: ${text}`, !done);
});
element("undo").addEventListener("click", () => {
  fillSettings();
  showAnswer("", false);
});
element("save").addEventListener("click", () => command("/save", {}));
