// Elements and canvases of the document.

export function element(id) {
  return document.getElementById(id);
}

/** Whether the reader's colour scheme is dark. */
export const dark = matchMedia("(prefers-color-scheme: dark)");

/** The context of a canvas that has as many pixels as the screen shows of it. */
export function contextOf(canvas) {
  const ratio = Math.min(2, devicePixelRatio || 1);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = Math.max(1, Math.round(width * ratio));
  canvas.height = Math.max(1, Math.round(height * ratio));
  const lines = canvas.getContext("2d");
  lines.scale(ratio, ratio);
  const style = getComputedStyle(canvas);
  lines.font = `13px ${style.fontFamily}`;
  return { lines, width, height, ratio, ink: style.getPropertyValue("--ink"),
    soft: style.getPropertyValue("--soft"), line: style.getPropertyValue("--line") };
}

/** A function that calls `draw` once before the next repaint, however often it is called until then. */
export function redrawing(draw) {
  let isWaiting = false;
  return () => {
    if (isWaiting) return;
    isWaiting = true;
    requestAnimationFrame(() => {
      isWaiting = false;
      draw();
    });
  };
}
