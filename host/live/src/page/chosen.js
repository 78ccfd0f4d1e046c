// The chosen pixel of a live source, and the maps.

function takeHistogram(news) {
  if (news.pixel !== chosen.pixel) return;
  if (news.counts) {
    const bytes = bytesOf(news.counts);
    news.counts = Array.from({ length: bytes.byteLength / 4 }, (_, bin) => bytes.getUint32(4 * bin, true));
  }
  chosen.histogram = news;
}

function drawMaps() {
  drawMap(element("range"), pixels.range, data.low, data.high, "mm", 0);
  const fastest = pixels.rate.reduce((most, rate) => Math.max(most, rate), 0);
  drawMap(element("rate"), pixels.rate, 0, fastest || 1, "/s", 1);
  const isPeak = element("light-quantity").value === "peak";
  const light = isPeak ? pixels.peak : pixels.reflectivity;
  const [, brightest] = span(light.filter((value) => !Number.isNaN(value)));
  drawMap(element("light"), light, 0, brightest, isPeak ? "photons" : "photons × m²", isPeak ? 0 : 3);
  const range = pixels.range[chosen.pixel];
  const text = Number.isNaN(range) || range === undefined ? "no event yet" : `${number(range, 0)} mm`;
  element("range").setAttribute("aria-label", `Range by pixel. Chosen: ${pixelName(chosen.pixel)}, ${text}`);
  element("rate").setAttribute("aria-label", `Events a second by pixel, up to ${number(fastest, 1)}`);
  element("light").setAttribute("aria-label", `${isPeak ? "Photons of the peak" : "Relative reflectivity"} by pixel`);
}

function drawChosen() {
  element("histogram").hidden = source?.kind === "recording";
  element("histogram-note").textContent = histogramNote(chosen.histogram);
  drawHistogram(element("histogram"), chosen.histogram, source?.settings?.gate);
  element("ranges-note").textContent = rangesNote();
  const [first, last] = [chosen.events[0]?.cycle ?? 0, chosen.events.at(-1)?.cycle ?? 0];
  drawRanges(element("ranges"), chosen.events, { laserHz: source?.laserHz, first, last });
  fillEvents(element("events"), chosen.events, (event) => number(event.cycle));
}

function histogramNote(histogram) {
  if (source?.kind === "recording") return "A recording has no histograms.";
  if (!histogram) return "No histogram yet; a device sends events first.";
  const { none, whole, exposure, look } = histogram;
  if (none) return `No histogram: ${none}.`;
  const { peak, needed, depends, dead_time: deadTime } = look ?? {};
  const kind = whole ? "A complete histogram from the sensor" : `An exposure of ${number(exposure)} laser cycles so far`;
  let needs = needsOf(needed, deadTime);
  if (depends) needs = "the required number depends on earlier events";
  else if (needed === null && !deadTime) needs = "no number is enough";
  const rest = peak ? ` Peak: ${number(peak[1])} photons in bin ${peak[0]}; ${needs}.` : "";
  return `${kind}.${rest}`;
}

function rangesNote() {
  if (chosen.arrived === 0) {
    return Number.isNaN(pixels.range[chosen.pixel]) ? "No event yet." : "No event since this pixel was chosen.";
  }
  const { drawn, arrived } = chosen;
  const of = drawn < arrived ? ` ${number(drawn)} of ${number(arrived)} events drawn.` : "";
  return `Range in millimetres: the last ${number(chosen.events.length)} events.${of}`;
}
