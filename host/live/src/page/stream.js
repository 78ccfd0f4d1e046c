// The stream of frames: decoded as they come, drawn when the screen is ready.

import { closest, pixelName } from "../../../run/src/report/shared/array.js";
import { drawCloud } from "../../../run/src/report/shared/cloud.js";
import { element, redrawing } from "../../../run/src/report/shared/dom.js";
import { drawChosen, drawMaps } from "./chosen.js";
import { post, tell } from "./command.js";
import { showDrawn, showLosses, showPlayhead, showState, showTotals } from "./figures.js";
import { takePixels, takeRates } from "./records.js";
import { fillSettings } from "./settings.js";
import { choosePixel, chosen, live, scene, takeCloud, takeEvents, takeHistogram, takeSource } from "./state.js";

let paused = false;
let page = null;
let times = [];
/** A person has chosen the pixel. */
let isChosen = false;
let rated = performance.now();
/** A request to show the chosen pixel is open. */
let isWatching = false;
/** The failed recording that was shown last. */
let shownEnd = "";

/** Draws everything before the next repaint. */
export const redraw = redrawing(() => {
  takeCloud();
  drawMaps();
  drawCloud(element("cloud"), scene, -1);
  drawChosen();
});

/** Stops drawing, or draws again. Returns whether it has stopped. */
export function pause() {
  paused = !paused;
  redraw();
  return paused;
}

function takeFrame(frame) {
  const now = performance.now();
  times = [...times.filter((time) => now - time < 2000), now];
  if (frame.source) {
    const isFirst = frame.frame === 1;
    if (isFirst) rated = now;
    takeSource(frame.source);
    const { source } = live;
    page = source.page;
    element("name").textContent = `dtof view: ${source.name}`;
    document.title = `${source.name} · dtof view`;
    const isDevice = source.kind === "device";
    for (const part of document.querySelectorAll(".of-device")) part.hidden = !isDevice;
    for (const part of document.querySelectorAll(".of-recording")) part.hidden = isDevice;
    if (!isChosen || chosen.pixel >= live.pixels.count) showPixel(middlePixel(() => true));
    document.body.classList.toggle("filled", live.pixels.count > 0);
    fillSettings();
  }
  takePixels(live.pixels, frame.pixels);
  // The first choice is a pixel with an event.
  const hasEvent = (pixel) => !Number.isNaN(live.pixels.range[pixel]);
  if (!isChosen && !hasEvent(chosen.pixel)) showPixel(middlePixel(hasEvent));
  if (frame.pixel.number === chosen.pixel) {
    takeEvents(frame.pixel);
  } else {
    void watch();
  }
  if (frame.histogram) takeHistogram(frame.histogram);
  if (now - rated > 1000) {
    takeRates(live.pixels, (now - rated) / 1000);
    rated = now;
  }
  showState(frame.connection);
  const seconds = Math.max(0.1, (now - times[0]) / 1000);
  showTotals(frame, times.length > 1 ? (times.length - 1) / seconds : 0);
  if (live.source?.kind === "recording") showPlayhead(frame.playhead);
  showLosses(frame.losses);
  showEnd(frame.recorded);
  if (paused) return;
  showDrawn(frame.drawn);
  redraw();
}

/** Shows once why a recording has ended by itself. */
function showEnd({ file, events, error }) {
  const end = error && `${file} ${events} ${error}`;
  if (end && end !== shownEnd) tell(`The recording has ended: ${error}`, true);
  shownEnd = end;
}

/** Makes the server send the chosen pixel. Frames repeat the request until it does. */
async function watch() {
  if (isWatching || page === null) return;
  isWatching = true;
  await post("/watch", JSON.stringify({ page, pixel: chosen.pixel }));
  isWatching = false;
}

/** The pixel closest to the middle of those that suit, -1 without any. */
function middlePixel(suits) {
  return closest(scene, [scene.columns >> 1, scene.rows >> 1], suits);
}

/** Shows the pixel that a person has chosen. */
export function choose(pixel) {
  if (pixel < 0) return;
  isChosen = true;
  showPixel(pixel);
}

/** Shows another pixel. */
function showPixel(pixel) {
  if (pixel < 0) return;
  element("pixel-name").value = `${pixel}: ${pixelName(scene, pixel)}`;
  if (pixel === chosen.pixel) return;
  choosePixel(pixel);
  void watch();
  redraw();
}

export function openStream() {
  const stream = new EventSource(`/stream?pixel=${chosen.pixel}`);
  stream.addEventListener("message", (event) => takeFrame(JSON.parse(event.data)));
  stream.addEventListener("error", () => {
    // The browser does not give the cause: a refused page looks like one whose server is gone.
    const reason = "the program has ended, or too many pages are open; this page tries again every few seconds";
    showState({ state: "lost", reason, returned: 0 });
    // A refused stream does not reconnect by itself, and a reconnected one shows its first pixel.
    stream.close();
    setTimeout(openStream, 2000);
  });
}
