// The stream of frames: taken in as they come, drawn when the screen is ready.

let paused = false;
let page = null;
let asked = false;
let last = null;
let times = [];
let isChosen = false;
let rated = performance.now();
/** Whether the server is being told of the chosen pixel. */
let isWatching = false;
/** The end of a recording that was told. */
let toldEnd = "";

/** Everything, before the next picture of the screen. */
function redraw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    takeCloud();
    drawMaps();
    drawCloud();
    drawChosen();
  });
}

function takeFrame(frame) {
  const now = performance.now();
  times = [...times.filter((time) => now - time < 2000), now];
  if (frame.about) {
    const isFirst = frame.frame === 1;
    if (isFirst) rated = now;
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
  } else {
    void watch();
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
  showLosses(frame.losses);
  tellEnd(frame.recorded);
  if (paused) return;
  showDrawn(frame.drawn);
  redraw();
}

/** Tells once why a recording has ended. */
function tellEnd({ file, events, error }) {
  const end = error && `${file} ${events} ${error}`;
  if (end && end !== toldEnd) tell(`The recording has ended: ${error}`, true);
  toldEnd = end;
}

/** Has the server look at the chosen pixel. Frames ask again until it does. */
async function watch() {
  if (isWatching || page === null) return;
  isWatching = true;
  await ask("/watch", JSON.stringify({ page, pixel: chosen.pixel }));
  isWatching = false;
}

/** Looks at another pixel. */
function choose(pixel) {
  if (pixel < 0) return;
  element("pixel-name").value = `${pixel}: ${pixelName(pixel)}`;
  if (pixel === chosen.pixel) return;
  Object.assign(chosen, { pixel, events: [], drawn: 0, arrived: 0, histogram: null });
  void watch();
  redraw();
}

function open() {
  const source = new EventSource(`/stream?pixel=${chosen.pixel}`);
  source.addEventListener("message", (event) => takeFrame(JSON.parse(event.data)));
  source.addEventListener("error", () => {
    // Why is not said here: a refused page looks like one whose server is gone.
    const reason = "the program has ended, or too many pages are open; this page tries again every few seconds";
    showState({ state: "lost", reason, returned: 0 });
    // One that was refused does not try again by itself; one that lost its way has another pixel.
    source.close();
    setTimeout(open, 2000);
  });
}
