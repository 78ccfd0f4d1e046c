// The stream of frames: taken in as they come, drawn when the screen is ready.

let paused = false;
let page = null;
let asked = false;
let last = null;
let times = [];
let isChosen = false;
let rated = performance.now();

/** Everything, before the next picture of the screen. */
function redraw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    takeCloud();
    drawMaps();
    drawCloud();
    drawHistogram();
    drawRanges();
    drawEvents();
  });
}

function takeFrame(frame) {
  const now = performance.now();
  times = [...times.filter((time) => now - time < 2000), now];
  if (frame.about) {
    takeAbout(frame.about);
    page = frame.about.page;
    element("name").textContent = `dtof view: ${about.name}`;
    document.title = `${about.name} · dtof view`;
    const isDevice = about.kind === "device";
    for (const part of document.querySelectorAll(".of-device")) part.hidden = !isDevice;
    for (const part of document.querySelectorAll(".of-recording")) part.hidden = isDevice;
    // At first the one in the middle.
    const middle = Math.floor(data.rows / 2) * data.columns + Math.floor(data.columns / 2);
    choose(chosen.pixel < pixels.count && isChosen ? chosen.pixel : Math.min(middle, pixels.count - 1));
    isChosen = pixels.count > 0;
    document.body.classList.toggle("filled", isChosen);
    fillSettings();
  }
  takePixels(frame.pixels);
  if (frame.pixel.number === chosen.pixel) {
    takeEvents(frame.pixel.events);
    chosen.drawn += frame.pixel.drawn;
    chosen.arrived += frame.pixel.arrived;
  }
  if (frame.histogram) takeHistogram(frame.histogram);
  if (now - rated > 1000) {
    takeRates((now - rated) / 1000);
    rated = now;
  }
  last = frame;
  showState(frame.connection);
  const seconds = Math.max(0.1, (now - times[0]) / 1000);
  showTotals(frame, times.length > 1 ? (times.length - 1) / seconds : 0);
  if (paused) return;
  showLosses(frame.losses);
  showDrawn(frame.drawn);
  if (frame.recorded.error) tell(`The recording has ended: ${frame.recorded.error}`, true);
  redraw();
}

/** Looks at another pixel. */
function choose(pixel) {
  if (pixel < 0) return;
  element("pixel-name").value = `${pixel}: ${pixelName(pixel)}`;
  if (pixel === chosen.pixel) return;
  Object.assign(chosen, { pixel, events: [], drawn: 0, arrived: 0, histogram: null });
  if (page !== null) void ask("/watch", JSON.stringify({ page, pixel }));
  redraw();
}

function open() {
  const source = new EventSource(`/stream?pixel=${chosen.pixel}`);
  source.addEventListener("message", (event) => takeFrame(JSON.parse(event.data)));
  source.addEventListener("error", () => {
    showState({ state: "lost", reason: "this page tries again every few seconds", returned: 0 });
    // One that was refused does not try again by itself; one that lost its way has another pixel.
    source.close();
    setTimeout(open, 2000);
  });
}
