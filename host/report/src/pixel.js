// The range of each pixel at a time, and the chosen pixel: its events, and the histogram that the
// last of them was decided from.

const chosen = { pixel: -1, events: [], decision: null };
const pixels = { range: new Float32Array(data.columns * data.rows).fill(NaN) };
/** Which events are in the map so far, and when each pixel was reported last, by level. */
const mapped = { events: 0, ends: new Float64Array(4 * pixels.range.length) };

/** Takes events before a laser cycle into the map. */
function mapUntil(cycle) {
  const end = cycle >= data.cycles ? events.count : firstFrom(cycle);
  if (end < mapped.events) {
    mapped.events = 0;
    mapped.ends.fill(0);
    pixels.range.fill(NaN);
  }
  for (; mapped.events < end; mapped.events++) mapEvent(mapped.events);
}

/** An event holds for its pixel, one of a block for those that had no better one in its exposure. */
function mapEvent(event) {
  if (events.echo[event] > 1 && !data.isChosen) return;
  const [level, side] = [events.level[event], 1 << events.level[event]];
  const [left, top] = [events.pixel[event] % data.columns, Math.floor(events.pixel[event] / data.columns)];
  const end = events.cycle[event] + 1;
  for (let row = top; row < Math.min(data.rows, top + side); row++) {
    for (let column = left; column < Math.min(data.columns, left + side); column++) {
      const pixel = row * data.columns + column;
      const ends = mapped.ends.subarray(4 * pixel, 4 * pixel + 4);
      if (ends.subarray(0, level).some((finer) => finer > end - events.exposure[event])) continue;
      ends[level] = end;
      pixels.range[pixel] = events.range[event];
    }
  }
}

/** Whether a part of the run is shown. */
const isPart = () => shown.start > 0 || shown.end < data.cycles;

// Which events the map is of, if not of all.
element("map-of").value =
  (data.oneOf > 1 ? ` among the 1 in ${number(data.oneOf)} that this report has` : "") +
  (manyEchoes && !data.isChosen ? "; of several echoes the first" : "");

function drawRangeMap() {
  mapUntil(shown.end);
  drawMap(element("map"), pixels.range, data.low, data.high, "mm", 0);
  element("map-time").value = isPart() ? `at ${timeOf(shown.end)}` : "at the end";
  const range = pixels.range[chosen.pixel];
  const text = Number.isNaN(range) ? `no ${data.event} yet` : `${number(range)} mm`;
  element("map").setAttribute("aria-label", `Range by pixel. Chosen: ${pixelName(chosen.pixel)}, ${text}`);
}

/** All events of a pixel, those of its blocks as well. */
function eventsOf(pixel) {
  const found = [];
  for (let event = 0; event < events.count; event++) {
    if (isOf(event, pixel)) found.push(eventOf(event));
  }
  return found;
}

/** Looks at another pixel. */
function choose(pixel) {
  if (pixel < 0 || pixel === chosen.pixel) return;
  const all = decisions.filter(({ pixel: first, level }) => holds(first, level, pixel));
  // The latest; a smaller block says more than a larger one.
  const decision = all.reduce((best, one) => (!best || one.cycle > best.cycle ? one : best), null);
  Object.assign(chosen, { pixel, events: eventsOf(pixel), decision: isKept(pixel) ? decision : null });
  // Of thinned events the last one is there all the same.
  const last = chosen.events.at(-1);
  if (data.oneOf > 1 && !data.isChosen && chosen.decision?.cycle > (last?.cycle ?? -1)) {
    chosen.events.push({ ...chosen.decision, peak: chosen.decision.look.peak[1] });
  }
  element("pixel-name").value = `${pixel}: ${pixelName(pixel)}`;
  const table = element("events");
  fillEvents(table, chosen.events, (event) => number(event.cycle / clock.per, 4));
  table.closest(".scrolls").hidden = chosen.events.length === 0;
  element("histogram-note").textContent = histogramNote();
  redraw();
}

/** Whether the histograms of a pixel are in this report. */
function isKept(pixel) {
  const every = data.histograms?.every ?? 0;
  return (pixel % data.columns) % every === 0 && Math.floor(pixel / data.columns) % every === 0;
}

/** The pixel of the first look: the first of these with a histogram, or the next to them. */
function firstPixel(preferred) {
  const hasHistogram = (pixel) => isKept(pixel) && decisions.some(({ pixel: first, level }) => holds(first, level, pixel));
  const [column, row] = [preferred[0] % data.columns, Math.floor(preferred[0] / data.columns)];
  const distance = (pixel) => Math.hypot((pixel % data.columns) - column, Math.floor(pixel / data.columns) - row);
  const kept = decisions.map(({ pixel }) => pixel).filter(isKept);
  return preferred.find(hasHistogram) ??
    kept.reduce((best, one) => (distance(one) < distance(best) ? one : best), kept[0] ?? preferred[0]);
}

function histogramNote() {
  if (!data.histograms) return `No histograms: these ${data.events} were decided on a device.`;
  const { every } = data.histograms;
  if (!isKept(chosen.pixel)) {
    const nearest = (place) => place - (place % every);
    const row = nearest(Math.floor(chosen.pixel / data.columns));
    const near = pixelName(row * data.columns + nearest(chosen.pixel % data.columns));
    return `No histogram: to stay small, the report has those of every ${every} columns and rows. The next is that of ${near}.`;
  }
  const { decision } = chosen;
  if (!decision) return `No histogram: the pixel has no ${data.event}.`;
  const { peak: [bin, photons], needed, background, dead_time: deadTime } = decision.look;
  const where = deadTime > 0 ? "there" : "a bin";
  const whose = decision.level > 0 || decision.echo > 1 ? ` (${kindName(decision)})` : "";
  // A report of one echo of an exposure has the histogram of whichever came last.
  const isOfIt = (event) => event.cycle === decision.cycle && event.echo === decision.echo;
  const isShown = !data.isChosen || data.oneOf > 1 || chosen.events.some(isOfIt);
  const hidden = isShown ? "," : `, echo ${decision.echo}, which is not shown,`;
  return `Histogram of the last ${data.event}${whose}${hidden} at ${timeOf(decision.cycle)}, of ${number(decision.exposure)} ` +
    `laser cycles: ${fixed(decision.range, 1)} mm. Peak: ${number(photons)} photons in bin ${bin}; ` +
    `${needsOf(needed, deadTime)}, with ${number(background, 2)} of background ${where}.`;
}

function drawPixel() {
  const { start: from, end } = shown;
  const now = isPart() ? end : undefined;
  const axes = { laserHz: data.laserHz, first: 0, last: data.cycles, from, now };
  element("ranges-note").textContent = rangesNote(now);
  drawRanges(element("ranges"), chosen.events, axes);
  drawHistogram(element("histogram"), chosen.decision, data.histograms?.gate);
  for (const plot of element("few").children) {
    plot.setAttribute("aria-pressed", plot.pixel === chosen.pixel);
    drawRanges(plot.lastChild, plot.events, { ...axes, span: few.span, isSmall: true });
  }
}

function rangesNote(now) {
  const count = chosen.events.length;
  if (count === 0) return `The pixel has no ${data.event}${data.oneOf > 1 ? " among those shown" : ""}.`;
  const thinned = data.oneOf > 1 ? ` (1 of ${number(data.oneOf)})` : "";
  const all = `${number(count)} ${count > 1 ? data.events : data.event}${thinned}`;
  if (now === undefined) return `Range against time: ${all}. Hollow ones have a flag other than confirmed.`;
  const last = chosen.events.findLast((event) => event.cycle < now);
  const text = last ? `${fixed(last.range, 1)} mm, reported at ${timeOf(last.cycle)}` : `no ${data.event} yet`;
  return `Range against time: ${all}. At ${timeOf(now)}: ${text}.`;
}

/** A plot for each of few pixels, and what all have in common. */
const few = { span: data.isFew ? spanOfRanges(events.range.length ? eventsOfAll() : []) : null };
function eventsOfAll() {
  return Array.from(events.range, (range) => ({ range }));
}

function addFew() {
  const count = data.columns * data.rows;
  for (let pixel = 0; pixel < count; pixel++) {
    const plot = document.createElement("button");
    plot.type = "button";
    const [name, canvas] = [document.createElement("span"), document.createElement("canvas")];
    canvas.setAttribute("aria-hidden", "true");
    Object.assign(plot, { pixel, events: eventsOf(pixel) });
    name.textContent = `${pixelName(pixel)}: ${number(plot.events.length)} ${data.events}`;
    plot.append(name, canvas);
    plot.addEventListener("click", () => choose(pixel));
    element("few").append(plot);
  }
  element("few").style.setProperty("--columns", data.columns);
  element("few").classList.toggle("as-array", data.columns <= 4);
}
