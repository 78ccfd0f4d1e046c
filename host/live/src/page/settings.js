// The settings form.

import { element } from "../../../run/src/report/shared/dom.js";
import { command, post } from "./command.js";
import { FIELDS, currentValue, isHalfGate, isUsed, nameOf, settingsText } from "./form.js";
import { live } from "./state.js";

/** Names of the fields with edits that are not applied yet. */
const edited = new Set();
const inputOf = (field) => element("settings").elements[nameOf(field)];

function makeFields() {
  for (const field of FIELDS) {
    const [, , name, input] = field;
    const label = document.createElement("label");
    const part = document.createElement(Array.isArray(input) ? "select" : "input");
    if (Array.isArray(input)) input.forEach((text) => part.add(new Option(text || "as suits", text)));
    else Object.assign(part, input);
    part.name = nameOf(field);
    part.addEventListener("input", () => {
      edited.add(part.name);
      markChanged();
    });
    label.append(name, part);
    element("fields").append(label);
  }
}

/** Fills the form with the current settings, except edited fields. */
export function fillSettings() {
  for (const field of FIELDS) {
    const input = inputOf(field);
    if (!edited.has(input.name)) input.value = currentValue(live.source?.settings, field);
  }
  markChanged();
}

function markChanged() {
  const rule = element("settings").elements["detection.rule"].value;
  for (const field of FIELDS) {
    const input = inputOf(field);
    const label = input.closest("label");
    label.hidden = !isUsed(field, rule);
    const isChanged = String(currentValue(live.source?.settings, field)) !== input.value;
    label.classList.toggle("changed", isChanged);
    if (!isChanged) edited.delete(input.name);
  }
}

/** The texts of the fields by name. */
function texts() {
  return Object.fromEntries(FIELDS.map((field) => [nameOf(field), inputOf(field).value]));
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
  const [before, sent] = [live.source, texts()];
  if (isHalfGate(sent)) {
    showAnswer("Refused: a gate needs both ends, or none for all bins", true);
    return;
  }
  showAnswer("Waiting for the device …", false);
  const { done, text } = await post("/settings", settingsText(before?.settings, sent), "application/toml");
  showAnswer(done ? text : `Refused: ${text}`, !done);
  if (!done) return;
  // The sent settings are applied, perhaps rounded. Later edits are not.
  for (const [name, text] of Object.entries(texts())) if (text === sent[name]) edited.delete(name);
  if (live.source !== before) fillSettings();
});
element("undo").addEventListener("click", () => {
  edited.clear();
  fillSettings();
  showAnswer("", false);
});
element("save").addEventListener("click", () => command("/save", {}));
