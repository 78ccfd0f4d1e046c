// What the reader does: turn, choose the window of time, play it, choose pixels.

import { neighbour, pixelAt } from "../shared/array.js";
import { drawCloud } from "../shared/cloud.js";
import { colours } from "../shared/colours.js";
import { dark, element, redrawing } from "../shared/dom.js";
import { stepOf } from "../shared/keys.js";
import { capital, number } from "../shared/numbers.js";
import { eventAt } from "../shared/projection.js";
import { turnable } from "../shared/turn.js";
import { firstPixel } from "./decisions.js";
import { countUntil, eventOf, kindName } from "./events.js";
import { addFew, chosen, drawPixel, drawRangeMap, lookAt } from "./pixel.js";
import { clock, data, decisions, events, isPart, manyEchoes, scene, showWindow, shown, timeOf } from "./run.js";
import { addLane, addScale, drawLanes } from "./spikes.js";

const cloud = element("cloud");
const start = element("start");
const width = element("width");
const play = element("play");
const status = element("status");
const STEPS = 200;
/** Seconds to play the whole run in. */
const PLAY_SECONDS = 10;

/** The event that was clicked, none at first. */
let picked = -1;

/** Everything, before the next picture of the screen. */
const redraw = redrawing(() => {
  if (!data.isFew) {
    drawCloud(cloud, scene, picked);
    drawRangeMap();
    drawLanes();
  }
  drawPixel();
});

/** Chooses another pixel. */
export function choose(pixel) {
  if (pixel < 0 || pixel === chosen.pixel) return;
  lookAt(pixel);
  redraw();
}

function chooseWindow() {
  const cycles = Number(width.value);
  const from = Math.round((Number(start.value) / STEPS) * (data.cycles - cycles));
  start.disabled = cycles === data.cycles;
  start.setAttribute("aria-valuetext", timeOf(from));
  showWindow(from, from + cycles);
  tell();
  redraw();
}

/** What is shown, what was clicked, and what else there is to say. */
function tell(news = "") {
  const span = isPart() ? `${timeOf(shown.start)} to ${timeOf(shown.end)}` : `0 to ${timeOf(data.cycles)}`;
  status.value = `${number(countUntil(events, shown))} ${data.events} from ${span}. ${pickedText()} ${news}`.trim();
}

/** Chooses a pixel, adds its spikes, and says so. */
function showSpikes(pixel) {
  choose(pixel);
  return `Spikes of ${addLane(pixel, true)} are shown first.`;
}

function pickedText() {
  if (picked < 0) return "";
  const event = eventOf(events, picked);
  return `Chosen: ${kindName(data, event, manyEchoes)}, ${number(event.range, 1)} mm at ${timeOf(event.cycle)}.`;
}

// The window of time.
const parts = [1, 2, 5, 10, 20, 50, 100].map((part) => Math.max(1, Math.round(data.cycles / part)));
for (const cycles of new Set(parts)) {
  const text = cycles === data.cycles ? "whole run" : timeOf(cycles);
  width.add(new Option(text, cycles));
}
start.max = STEPS;
start.addEventListener("input", chooseWindow);
width.addEventListener("input", chooseWindow);

// Playing it, in single steps for those who want no motion.
const still = matchMedia("(prefers-reduced-motion: reduce)");
let playing = 0;
function stop() {
  clearInterval(playing);
  playing = 0;
  play.textContent = "Play";
  status.setAttribute("aria-live", "polite");
}
play.addEventListener("click", () => {
  if (playing) return stop();
  if (Number(width.value) === data.cycles) width.selectedIndex = Math.min(3, width.length - 1);
  play.textContent = "Pause";
  // Twenty a second are not to be read out.
  status.setAttribute("aria-live", "off");
  const perSecond = still.matches ? 1 : 20;
  playing = setInterval(() => {
    const next = Number(start.value) + STEPS / PLAY_SECONDS / perSecond;
    start.value = next > STEPS ? 0 : next;
    chooseWindow();
  }, 1000 / perSecond);
  chooseWindow();
});
start.addEventListener("pointerdown", stop);

turnable(cloud, scene.view, redraw, (x, y) => {
  picked = eventAt(scene, x, y, cloud.clientWidth, cloud.clientHeight);
  tell(picked >= 0 ? showSpikes(events.pixel[picked]) : "");
});

const far = element("far");
function chooseFar() {
  const open = far.value === far.max;
  const range = data.low + (data.high - data.low) * (far.value / far.max);
  shown.far = open ? Infinity : range;
  element("far-mm").value = open ? "any range" : `${number(range)} mm`;
  far.setAttribute("aria-valuetext", element("far-mm").value);
  tell();
  redraw();
}
far.addEventListener("input", chooseFar);
function chooseThird() {
  scene.view.third = element("third").value;
  const third = scene.view.third === "range" ? "range" : "time";
  const by = `${data.sides.join(", ")} and ${third}`;
  cloud.setAttribute("aria-label", `${capital(data.events)} by ${by}, coloured by range`);
  redraw();
}
element("third").addEventListener("input", chooseThird);

// The chosen pixel.
element("map").addEventListener("click", (event) => {
  const { clientWidth, clientHeight } = event.currentTarget;
  choose(pixelAt(data, event.offsetX, event.offsetY, clientWidth, clientHeight));
});
for (const id of ["map", "few", "ranges"]) {
  element(id).addEventListener("keydown", (event) => {
    const move = stepOf(event);
    if (!move) return;
    event.preventDefault();
    choose(neighbour(data, chosen.pixel, move));
    if (id === "few") element("few").children[chosen.pixel].focus();
  });
}

// Pixels by their place.
for (const [at, id] of ["across", "down"].entries()) {
  const name = data.sides[at];
  element(id).textContent = capital(name);
}
element("column").max = data.columns - 1;
element("line").max = data.rows - 1;
element("add").addEventListener("submit", (event) => {
  event.preventDefault();
  tell(showSpikes(Number(element("line").value) * data.columns + Number(element("column").value)));
});

// The first look.
const stops = Array.from({ length: 18 }, (_, stop) => colours[stop * 15]);
element("bar").style.background = `linear-gradient(to right, ${stops.join(", ")})`;
element("low").textContent = `≤ ${number(data.low)}`;
element("high").textContent = `≥ ${number(data.high)}`;
element("unscripted").hidden = true;
element("interactive").hidden = false;
for (const part of document.querySelectorAll(".of-many")) part.hidden = data.isFew;
for (const part of document.querySelectorAll(".of-few")) part.hidden = !data.isFew || data.columns * data.rows === 1;
document.querySelector(".panels").classList.toggle("is-few", data.isFew);
element("events-thinned").value = data.oneOf > 1 ? `(1 of ${number(data.oneOf)})` : "";
element("time-unit").textContent = `time, ${clock.unit}`;
addScale();
if (data.isFew) addFew(choose);
else data.spikes.forEach((pixel) => addLane(pixel));
choose(firstPixel(data, decisions, data.spikes));
chooseWindow();
chooseFar();
chooseThird();
new ResizeObserver(redraw).observe(element("interactive"));
dark.addEventListener("change", redraw);
