// The keyboard.

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Whether a key is one of the browser's: with Ctrl, Alt or the like. */
export function isOfBrowser({ ctrlKey, metaKey, altKey }) {
  return ctrlKey || metaKey || altKey;
}

/** How many columns and rows an arrow key goes; nothing for other keys. */
export function stepOf(event) {
  return isOfBrowser(event) ? undefined : STEPS[event.key];
}
