// Turning the cloud: one finger or button turns, two fingers change the size; keys do the same.

const TURNS = {
  ArrowLeft: () => turn(0.1, 0),
  ArrowRight: () => turn(-0.1, 0),
  ArrowUp: () => turn(0, -0.1),
  ArrowDown: () => turn(0, 0.1),
  "+": () => enlarge(1.2),
  "=": () => enlarge(1.2),
  "-": () => enlarge(1 / 1.2),
  0: () => Object.assign(view, VIEWS.reset),
};

/** Calls redraw() when the view has changed, and click(x, y) for a click. */
function turnable(canvas, redraw, click) {
  const fingers = new Map();
  let moved = 0;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event);
    moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const [x, y] = [event.clientX - before.clientX, event.clientY - before.clientY];
    moved += Math.hypot(x, y);
    if (fingers.size === 1) {
      turn(-x / 150, y / 150);
    } else {
      const other = [...fingers.values()].find((finger) => finger.pointerId !== event.pointerId);
      const away = (finger) =>
        Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY) + 1;
      enlarge(away(event) / away(before));
    }
    fingers.set(event.pointerId, event);
    redraw();
  });
  for (const type of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(type, (event) => {
      const isClick = type === "pointerup" && moved < 5 && fingers.size === 1;
      fingers.delete(event.pointerId);
      if (!isClick) return;
      click(event.offsetX, event.offsetY);
      redraw();
    });
  }
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return; // The page scrolls.
    event.preventDefault();
    enlarge(Math.exp(-event.deltaY / 200));
    redraw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !TURNS[event.key]) return;
    event.preventDefault();
    event.stopPropagation();
    TURNS[event.key]();
    redraw();
  });
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => {
      Object.assign(view, VIEWS[button.dataset.view]);
      redraw();
    });
  }
}
