"""The live page in a real browser: position, speed and first pixel of a recording; a device that tracks."""

import json
import shutil
import subprocess
import sys
import time

from browser import check
from playwright.sync_api import sync_playwright

MOVE = """(share) => {
    const position = document.getElementById("position");
    position.value = share * position.max;
    for (const name of ["input", "change"]) position.dispatchEvent(new Event(name));
}"""

NAMELESS = """[...document.querySelectorAll("canvas")]
    .filter((e) => e.checkVisibility() && e.ariaHidden !== "true")
    .filter((e) => !e.ariaLabel && !e.hasAttribute("aria-labelledby"))
    .map((e) => e.id)"""


def until(page, what, part, text):
    """Waits until a part has a text. The page's policy forbids Playwright's own wait."""
    since = time.monotonic()
    while text not in page.inner_text(part) and time.monotonic() - since < 10:
        time.sleep(0.02)
    check(f"{what}: {page.inner_text(part)!r}", text in page.inner_text(part))


def shows_a_recording(browser, address, width, scheme, picture):
    errors = []
    window = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
    page = window.new_page()
    page.on("console", lambda message: errors.append(message.text))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(address)
    page.wait_for_selector("#playback:not([hidden])")

    page.select_option("#speed", "0.001")
    page.evaluate(MOVE, 0.5)
    until(page, "it goes to half of the recording", "#place", "0.100 of 0.200 s")
    until(page, "about half of the events have come", "#totals", "\n15,")
    until(page, "the pixel has events", "#ranges-note", "Range in millimetres")
    check("the speed is as chosen", page.eval_on_selector("#speed", "e => e.value") == "0.001")
    spoken = page.get_attribute("#position", "aria-valuetext")
    check(f"the position is said in seconds: {spoken}", " of 0.200 s" in spoken)
    page.focus("#position")
    page.keyboard.press("End")
    until(page, "End goes to the end", "#state", "at its end")
    until(page, "it can be played again", "#play", "Play again")
    page.keyboard.press("Home")
    until(page, "Home plays it from the start", "#state", "playing")
    # Paused, so that only the key moves it.
    page.click("#play")
    until(page, "it is paused", "#play", "Play")
    before = page.inner_text("#place")
    page.focus("#position")
    page.keyboard.press("ArrowRight")
    since = time.monotonic()
    while page.inner_text("#place") == before and time.monotonic() - since < 10:
        time.sleep(0.02)
    check(f"an arrow key moves it from {before!r}", page.inner_text("#place") != before)
    nameless = page.evaluate(NAMELESS)
    check(f"every picture has a name {nameless}", not nameless)
    wide = page.evaluate("document.documentElement.scrollWidth")
    check(f"no scrolling sideways at {width} pixels", wide <= width)
    page.screenshot(path=picture)
    check(f"no errors {errors}", not errors)
    window.close()


def draws_a_device_that_tracks(browser, address):
    """The number that the rule needs is not known then, nor the background."""
    look = {"peak": [1, 40], "needed": None, "depends": True, "background": None}
    look |= {"quadrants": [0, 1, 2, 3, 4], "window": None, "dead_time": 0}
    # Counts of 1, 40, 2 and 0 photons.
    histogram = {"pixel": 3, "exposure": 1200, "whole": False, "counts": "AQAAACgAAAACAAAAAAAAAA==", "look": look}
    settings = {"sensor": {}, "detection": {"rule": "window", "tracking": True}, "gate": [0, 3]}
    frame = {
        "frame": 1, "connection": {"state": "live", "reason": "", "returned": 0}, "events": 0, "masked": 0, "rate": 0,
        "losses": {"photon_rate": 0, "cycles": 0, "counts": [], "last_fault": None},
        "recorded": {"on": False, "file": "", "events": 0, "error": ""}, "playhead": {},
        "source": {"page": 1, "name": "x", "kind": "device", "columns": 2, "rows": 2, "settings": settings},
        "pixels": "", "drawn": {"pixels": 0, "left": 0, "events": 0},
        "pixel": {"number": 3, "events": "", "drawn": 0, "arrived": 0}, "histogram": histogram,
    }
    errors = []
    page = browser.new_page()
    page.on("pageerror", lambda error: errors.append(str(error)))
    body = f"data: {json.dumps(frame)}\n\n"
    page.route("**/stream*", lambda route: route.fulfill(content_type="text/event-stream", body=body))
    page.route("**/watch", lambda route: route.fulfill(body=""))
    page.goto(address)
    until(page, "the note on the histogram", "#histogram-note", "40 photons in bin 1; the required number depends on")
    drawn = """() => {
        const { width, height } = document.getElementById("histogram");
        const bytes = document.getElementById("histogram").getContext("2d").getImageData(0, 0, width, height).data;
        return bytes.some((byte) => byte > 0);
    }"""
    check("the histogram is drawn", page.evaluate(drawn))
    check(f"no errors {errors}", not errors)
    page.close()


def main(chromium, pictures, dtof, recording):
    # The recording takes two seconds, so that a busy machine has its page long before the end.
    command = [dtof, "view", recording, "--speed", "0.1"]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        address = program.stdout.readline().strip()
        # Longer than the recording takes.
        time.sleep(3)
        with sync_playwright() as driver:
            # Root, as in a container, has no sandbox.
            browser = driver.chromium.launch(executable_path=shutil.which(chromium), args=["--no-sandbox"])
            page = browser.new_page()
            page.goto(address)
            until(page, "it ends", "#state", "at its end")
            note = page.inner_text("#ranges-note")
            check(f"it has waited for its page: {note}", note.startswith("Range in millimetres: the last"))
            page.close()
            print("tracking")
            draws_a_device_that_tracks(browser, address)
            for width in [400, 1200]:
                for scheme in ["light", "dark"]:
                    print(f"{width} pixels, {scheme}")
                    shows_a_recording(browser, address, width, scheme, f"{pictures}/view-{width}-{scheme}.png")
            browser.close()
    finally:
        program.terminate()


main(*sys.argv[1:])
