// Commands to the server, and what comes of them.

import { element } from "../../../run/src/report/shared/dom.js";

let newsTimer = 0;
/** Shows a line: what was done, or why not. */
export function tell(text, isBad = false) {
  const news = element("news");
  news.textContent = text;
  news.classList.toggle("bad", isBad);
  news.hidden = !text;
  clearTimeout(newsTimer);
  if (!isBad) newsTimer = setTimeout(() => { news.hidden = true; }, 8000);
}

/** Posts a command; returns whether it was done, and the server's answer. */
export async function post(path, body, kind = "application/json") {
  try {
    const answer = await fetch(path, { method: "POST", headers: { "content-type": kind }, body });
    return { done: answer.ok, text: (await answer.text()).trim() };
  } catch {
    return { done: false, text: "the program does not answer" };
  }
}

/** Posts a command whose effect the page shows; says only why it was not done. */
export async function send(path, body) {
  const { done, text } = await post(path, JSON.stringify(body));
  if (!done) tell(text, true);
}

export async function command(path, body) {
  const { done, text } = await post(path, JSON.stringify(body));
  tell(text, !done);
}
