// Turning the cloud: one finger or button turns, two fingers change the size; keys do the same.

import { isOfBrowser } from "./keys.js";
import { drag, enlarge, look, press } from "./turning.js";

/** Calls redraw() when the view has changed, and click(x, y) for a click. */
export function turnable(canvas, view, redraw, click) {
  const fingers = new Map();
  let moved = 0;
  const place = (event) => [event.clientX, event.clientY];
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, place(event));
    moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    moved += drag(view, fingers, event.pointerId, place(event));
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
    enlarge(view, Math.exp(-event.deltaY / 200));
    redraw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    if (isOfBrowser(event) || !press(view, event.key)) return;
    event.preventDefault();
    event.stopPropagation();
    redraw();
  });
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => {
      look(view, button.dataset.view);
      redraw();
    });
  }
}
