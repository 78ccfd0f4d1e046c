// Controls: choosing a pixel, pausing, recording, keys.

for (const id of ["range", "rate", "light"]) {
  element(id).addEventListener("click", (event) => {
    const pixel = pixelAt(event);
    if (pixel < pixels.count) choose(pixel);
  });
}

turnable(cloud, redraw, (x, y) => {
  const event = eventAt(x, y);
  if (event >= 0) choose(events.pixel[event]);
});

function pause() {
  paused = !paused;
  element("pause").setAttribute("aria-pressed", paused);
  element("pause").textContent = paused ? "Draw again" : "Pause drawing";
  redraw();
}

/** Sends a button's command; its data-on says whether it switches on or off. */
const press = (id) => command(`/${id}`, { on: element(id).dataset.on === "true" });
const KEYS = {
  " ": pause,
  r: () => source?.kind === "device" && element("record").click(),
  p: () => source?.kind === "recording" && element("play").click(),
  "?": () => element("keys").showModal(),
};
document.addEventListener("keydown", (event) => {
  const move = STEPS_OF[event.key];
  const key = move ? () => step(...move) : KEYS[event.key.toLowerCase()];
  const isTyped = event.target.closest("input, select, textarea, dialog, .scrolls") ||
    (event.key === " " && event.target.closest("button"));
  if (!key || isTyped || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  key();
});

element("record").addEventListener("click", () => press("record"));
element("play").addEventListener("click", () => press("play"));
element("position").addEventListener("input", () => { isMoving = true; });
element("position").addEventListener("change", async (event) => {
  await send("/seek", { seconds: Number(event.target.value) });
  isMoving = false;
});
element("speed").addEventListener("change", (event) => send("/speed", { speed: Number(event.target.value) }));
element("pause").addEventListener("click", pause);
element("help").addEventListener("click", () => element("keys").showModal());
element("light-quantity").addEventListener("input", redraw);
dark.addEventListener("change", redraw);
new ResizeObserver(redraw).observe(document.body);
openStream();
