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
/** Names of the fields that hold what is not in force yet. */
const edited = new Set();
/** Keys that the device takes, and that the form has no field for, go along as they are. */
const TAKEN = { sensor: ["masked", "sigma_bins", "one_hit_tdc"] };

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

function inForce([section, key, , , , at]) {
  const value = key === "gate" ? about?.settings?.gate : about?.settings?.[section]?.[key];
  return (at === undefined ? value : value?.[at]) ?? "";
}

function fieldOf([section, key, , , , at]) {
  return element("settings").elements[`${section}.${key}${at ?? ""}`];
}

/** Fills the form with what is in force, and leaves alone what the reader has edited. */
function fillSettings() {
  for (const field of FIELDS) {
    const input = fieldOf(field);
    if (!edited.has(input.name)) input.value = inForce(field);
  }
  markChanged();
}

function markChanged() {
  const rule = element("settings").elements["detection.rule"].value;
  for (const field of FIELDS) {
    const input = fieldOf(field);
    const label = input.closest("label");
    label.hidden = label.dataset.rules !== "" && !label.dataset.rules.split(",").includes(rule);
    const isChanged = String(inForce(field)) !== input.value;
    label.classList.toggle("changed", isChanged);
    if (!isChanged) edited.delete(input.name);
  }
}

/** The ends of the gate as they are typed. */
function gateEnds() {
  return ["sensor.gate0", "sensor.gate1"].map((name) => element("settings").elements[name].value);
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
  // Without ends it is all bins.
  const gate = gateEnds();
  said.sensor.gate = gate.includes("") ? null : gate.map(Number);
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
  if (gateEnds().filter((end) => end === "").length === 1) {
    showAnswer("Refused: a gate has both ends, or none for all bins", true);
    return;
  }
  showAnswer("The device is asked …", false);
  const [before, sent] = [about, FIELDS.map((field) => fieldOf(field).value)];
  const { done, text } = await ask("/settings", settingsText(), "application/toml");
  showAnswer(done ? text : `Refused: ${text}`, !done);
  if (!done) return;
  // What was sent is in force, perhaps rounded; what was edited meanwhile is not.
  FIELDS.map(fieldOf).forEach((input, at) => input.value === sent[at] && edited.delete(input.name));
  if (about !== before) fillSettings();
});
element("undo").addEventListener("click", () => {
  edited.clear();
  fillSettings();
  showAnswer("", false);
});
element("save").addEventListener("click", () => command("/save", {}));
