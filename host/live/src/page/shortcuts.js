// Keys of the whole page.

import { isOfBrowser } from "../../../run/src/report/shared/keys.js";

/** The key as a shortcut, in lower case; nothing if it is the browser's, or is typed into a part of the page. */
export function shortcutOf(event) {
  const isTyped = event.target.closest("input, select, textarea, dialog, .scrolls") ||
    (event.key === " " && event.target.closest("button"));
  return isTyped || isOfBrowser(event) ? undefined : event.key.toLowerCase();
}
