// Controls: choosing a pixel, pausing, recording, keys.

import { neighbour, pixelAt } from "../../../run/src/report/shared/array.js";
import { dark, element } from "../../../run/src/report/shared/dom.js";
import { stepOf } from "../../../run/src/report/shared/keys.js";
import { eventAt } from "../../../run/src/report/shared/projection.js";
import { turnable } from "../../../run/src/report/shared/turn.js";
import { command, send } from "./command.js";
import { playback } from "./figures.js";
import { shortcutOf } from "./shortcuts.js";
import { chosen, live, scene } from "./state.js";
import { choose, openStream, pause, redraw } from "./stream.js";

for (const id of ["range", "rate", "light"]) {
  element(id).addEventListener("click", (event) => {
    const { clientWidth, clientHeight } = event.currentTarget;
    choose(pixelAt(scene, event.offsetX, event.offsetY, clientWidth, clientHeight));
  });
}

const cloud = element("cloud");
turnable(cloud, scene.view, redraw, (x, y) => {
  const event = eventAt(scene, x, y, cloud.clientWidth, cloud.clientHeight);
  if (event >= 0) choose(scene.events.pixel[event]);
});

function switchDrawing() {
  const paused = pause();
  element("pause").setAttribute("aria-pressed", paused);
  element("pause").textContent = paused ? "Draw again" : "Pause drawing";
}

/** Sends a button's command; its data-on says whether it switches on or off. */
const press = (id) => command(`/${id}`, { on: element(id).dataset.on === "true" });
const KEYS = {
  " ": switchDrawing,
  r: () => live.source?.kind === "device" && element("record").click(),
  p: () => live.source?.kind === "recording" && element("play").click(),
  "?": () => element("keys").showModal(),
};
document.addEventListener("keydown", (event) => {
  const shortcut = shortcutOf(event);
  if (shortcut === undefined) return;
  const move = stepOf(event);
  const key = move ? () => choose(neighbour(scene, chosen.pixel, move)) : KEYS[shortcut];
  if (!key) return;
  event.preventDefault();
  key();
});

element("record").addEventListener("click", () => press("record"));
element("play").addEventListener("click", () => press("play"));
element("position").addEventListener("input", () => { playback.isMoving = true; });
element("position").addEventListener("change", async (event) => {
  await send("/seek", { seconds: Number(event.target.value) });
  playback.isMoving = false;
});
element("speed").addEventListener("change", (event) => send("/speed", { speed: Number(event.target.value) }));
element("pause").addEventListener("click", switchDrawing);
element("help").addEventListener("click", () => element("keys").showModal());
element("light-quantity").addEventListener("input", redraw);
dark.addEventListener("change", redraw);
new ResizeObserver(redraw).observe(document.body);
openStream();
