// What the reader does: choose pixels, pause, record, keys.

for (const id of ["range", "rate", "light"]) {
  element(id).addEventListener("click", (event) => {
    if (pixels.count === 0) return;
    const canvas = event.currentTarget;
    const column = Math.floor((event.offsetX / canvas.clientWidth) * data.columns);
    const row = Math.floor((event.offsetY / canvas.clientHeight) * data.rows);
    const pixel = Math.max(0, row) * data.columns + Math.min(data.columns - 1, Math.max(0, column));
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

/** Moves the chosen pixel by columns and rows. */
function step(columns, rows) {
  const column = (chosen.pixel % data.columns) + columns;
  const row = Math.floor(chosen.pixel / data.columns) + rows;
  const isThere = column >= 0 && column < data.columns && row >= 0 && row < data.rows;
  if (isThere) choose(row * data.columns + column);
}

const isOn = (id) => element(id).dataset.on === "true";
const KEYS = {
  ArrowLeft: () => step(-1, 0),
  ArrowRight: () => step(1, 0),
  ArrowUp: () => step(0, -1),
  ArrowDown: () => step(0, 1),
  " ": pause,
  r: () => about?.kind === "device" && element("record").click(),
  p: () => about?.kind === "recording" && element("play").click(),
  "?": () => element("keys").showModal(),
};
document.addEventListener("keydown", (event) => {
  const key = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  const isTyped = event.target.closest("input, select, textarea, dialog, .scrolls") ||
    (event.key === " " && event.target.closest("button"));
  if (!key || isTyped || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  key();
});

element("record").addEventListener("click", () => command("/record", { on: isOn("record") }));
element("play").addEventListener("click", () => command("/play", { on: isOn("play") }));
element("pause").addEventListener("click", pause);
element("help").addEventListener("click", () => element("keys").showModal());
element("light-of").addEventListener("input", redraw);
dark.addEventListener("change", redraw);
new ResizeObserver(redraw).observe(document.body);
open();
