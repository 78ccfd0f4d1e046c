"""Reports of `dtof` in a real browser, for the test `report` of `dtof-host-tests`.

Arguments: the browser, the folder for the pictures, the reports of a static scene, of a moving
one with more events than a report shows, of a large array, of a target that moves before few
pixels, and of a single pixel. Ends with an error at the first thing that is not as it should be.
"""

import base64
import json
import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from browser import Report, check
from pixels import chooses_pixels, maps_time, opened, plays_a_move, shows_a_pixel, shows_few

MOST_BYTES = 5_000_000
SCRIPTS = Path(__file__).parent.parent.parent / "host/report/src"


def turns(report):
    page, cloud = report.page, report.page.locator("#cloud")
    first = report.picture()
    cloud.scroll_into_view_if_needed()
    box = cloud.bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag():
        page.mouse.move(*middle)
        page.mouse.down()
        page.mouse.move(middle[0] + 80, middle[1] + 30, steps=4)
        page.mouse.up()

    def touch():
        fingers = page.context.new_cdp_session(page)

        def send(kind, *points):
            places = [{"x": x, "y": y} for x, y in points]
            fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

        send("touchStart", middle)
        for step in range(1, 6):
            send("touchMove", (middle[0] + 12 * step, middle[1]))
        send("touchEnd")

    def wheel():
        page.keyboard.down("Control")
        page.mouse.move(*middle)
        page.mouse.wheel(0, -120)
        page.keyboard.up("Control")

    report.changes("the mouse", drag)
    report.changes("a finger", touch)
    report.changes("Ctrl + wheel", wheel)
    cloud.focus()
    for key in ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "+", "-"]:
        report.changes(f"the key {key}", lambda: page.keyboard.press(key))
    page.keyboard.press("0")
    check("the key 0 gives back the first picture", report.picture() == first)
    for view in ["front", "side", "top"]:
        report.changes(f"the view {view}", page.locator(f"[data-view={view}]").click)
    page.locator("[data-view=reset]").click()
    check("Reset gives back the first picture", report.picture() == first)
    report.changes("the time as third axis", lambda: page.select_option("#third", "cycle"))
    label = cloud.get_attribute("aria-label")
    check("the label names the third axis", "column, row and time," in label)
    page.select_option("#third", "range")
    check("and the other", "row and range," in cloud.get_attribute("aria-label"))
    report.changes("leaving out what is far", lambda: page.locator("#far").fill("50"))
    page.locator("#far").fill("100")
    check("any range gives back the first picture", report.picture() == first)


def moves_in_time(report):
    page = report.page
    status = page.locator("#status")
    report.changes("a window of time", lambda: page.select_option("#width", index=3))
    report.changes("the slider", lambda: page.locator("#start").fill("100"))
    page.locator("#start").focus()
    text = status.evaluate("e => e.value")
    report.changes("a key on the slider", lambda: page.keyboard.press("ArrowRight"))
    check("the text describes the view", status.evaluate("e => e.value") != text)

    def play():
        page.locator("#play").click()
        page.wait_for_timeout(400)
        page.locator("#play").click()

    report.changes("playing", play)
    check("Pause becomes Play", page.locator("#play").inner_text() == "Play")
    page.select_option("#width", index=0)


def shows_spikes(report):
    page, lanes = report.page, report.page.locator("#lanes li:not(.scale)")
    check("five pixels at first", lanes.count() == 5)
    page.locator("#column").fill("7")
    page.locator("#line").fill("3")
    page.keyboard.press("Enter")
    check("a pixel by its place", "column 7, row 3: " in lanes.first.inner_text())
    text = page.locator("#status").evaluate("e => e.value")
    check("the text names the pixel", "Spikes of column 7, row 3: " in text)
    page.locator("[data-view=front]").click()
    report.settle()
    page.locator("#cloud").scroll_into_view_if_needed()
    box = page.locator("#cloud").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2 + 40, box["y"] + box["height"] / 2)
    report.settle()
    chosen = page.locator("#status").evaluate("e => e.value")
    name = lanes.first.locator("span").inner_text().split(":")[0]
    # An event of the pixel, or of a block that begins with it.
    picked = chosen.partition("Chosen: ")[2].partition(" mm")[0]
    check("a click chooses an event", f"{name}," in picked)
    count = lanes.count()
    lanes.first.locator("button").click()
    check("a pixel can be removed", lanes.count() == count - 1)
    page.locator("[data-view=reset]").click()


def is_named(report):
    nameless = report.run(
        """[...document.querySelectorAll("button, input, select, canvas, output")]
            .filter((e) => !e.closest("[aria-hidden]") && e.checkVisibility({ visibilityProperty: true }))
            .filter((e) => e.ariaHidden !== "true" && e.tagName !== "OUTPUT")
            .filter((e) => !e.labels?.length && !e.ariaLabel && !e.textContent.trim())
            .map((e) => e.outerHTML)"""
    )
    check(f"everything to use has a name {nameless}", not nameless)
    role = report.page.locator("#cloud").get_attribute("role")
    check("keys go to the cloud in browse mode, too", role == "application")
    report.page.locator("#play").focus()
    report.page.keyboard.press("Tab")
    outline = report.run("getComputedStyle(document.activeElement).outlineStyle")
    check("the focus can be seen", outline == "solid")


def is_closed(report):
    """Foreign scripts do not run, and nothing is loaded."""
    report.run(
        """(() => {
            const script = document.createElement("script");
            script.textContent = "window.foreign = true";
            document.body.append(script);
        })()"""
    )
    check("no other script runs", report.run("window.foreign === undefined"))
    fetched = "fetch('data:,x').then(() => true, () => false)"
    check("nothing is fetched", report.run(fetched) is False)
    check("the policy reported them", len(report.errors) >= 2)
    report.errors.clear()


def packed(numbers):
    """Encodes numbers for the page: digits of three bits, the lowest first, two per byte."""
    digits = []
    for number in numbers:
        while number > 7:
            digits.append(number & 7 | 8)
            number >>= 3
        digits.append(number)
    digits += [0] * (len(digits) % 2)
    pairs = zip(digits[::2], digits[1::2])
    return base64.b64encode(bytes(low | high << 4 for low, high in pairs)).decode()


def page_of(browser, data, events):
    """A page with these events (since the one before, pixel, level, echo, range) and the scripts
    that place them, and nothing else."""
    numbers = [(since, pixel, level << 2 | echo - 1, 40, mm * 512, 9) for since, pixel, level, echo, mm in events]
    data |= {"sides": ["column", "row"], "events": "events", "laserHz": 1000, "histograms": None}
    data |= {"colours": "000000" * 256, "packed": packed(sum(numbers, ())), "count": len(events)}
    page = browser.new_page()
    page.set_content(f'<script type="application/json" id="data">{json.dumps(data)}</script>')
    for script in ["shared/helpers.js", "events.js", "shared/projection.js"]:
        page.add_script_tag(content=(SCRIPTS / script).read_text())
    return page


def places_are_true(browser):
    """The axis is linear, also for ranges beyond the colours."""
    ranges = [500, 1000, 2000, 9000]
    events = [(1 if at > 0 else 0, 0, 0, 1, mm) for at, mm in enumerate(ranges)]
    data = {"columns": 1, "rows": 1, "cycles": 4, "oneOf": 1, "low": 1000, "high": 2000}
    page = page_of(browser, data, events)
    found = page.evaluate(
        """() => {
            Object.assign(view, VIEWS.side, { third: "range" });
            showWindow(0, 4);
            const found = [], sides = axes();
            eachPlace(sides, camera(sides, 800, 600), (event, x) => found.push(x));
            return { found, low: sides[2].low, high: sides[2].high };
        }"""
    )
    check("the axis spans all ranges", (found["low"], found["high"]) == (500, 9000))
    left, *_, right = places = found["found"]
    expected = [left + (right - left) * (mm - 500) / 8500 for mm in ranges]
    wrong = max(abs(place - true) for place, true in zip(places, expected))
    check("every range has its place", abs(right - left) > 100 and wrong < 0.01)
    page.close()


def blocks_are_as_large_as_their_pixels(browser):
    """On 5x3 pixels: a pixel, blocks of each level, and one that the array cuts."""
    events = [(7, 0, 1), (2, 1, 1), (0, 2, 2), (0, 3, 3), (14, 1, 4)]
    events = [(0, *event, 1000) for event in events]
    data = {"columns": 5, "rows": 3, "cycles": 10, "oneOf": 1, "low": 900, "high": 1100}
    page = page_of(browser, data, events)
    found = page.evaluate(
        """() => {
            Object.assign(view, VIEWS.front, { third: "range" });
            showWindow(0, 10);
            const places = [], sides = axes(), eye = camera(sides, 800, 600);
            const cell = eye.scale * sides[0].length / data.columns;
            const [left, top] = [400 - 2.5 * cell, 292 - 1.5 * cell];
            eachPlace(sides, eye, (event, x, y, depth, wide, high) =>
                places.push([(x - left) / cell, (y - top) / cell, wide, high]));
            const pixels = [...Array(15).keys()];
            const of = places.map((place, event) => pixels.filter((pixel) => isOf(event, pixel)));
            return { places, of, names: places.map((place, event) => kindName(eventOf(event))) };
        }"""
    )
    middles = [[2.5, 1.5, 1, 1], [3, 1, 2, 2], [2, 1.5, 4, 3], [2.5, 1.5, 5, 3], [4.5, 2.5, 1, 1]]
    pairs = zip(sum(found["places"], []), sum(middles, []))
    check("the point of a block lies in its middle", max(abs(a - b) for a, b in pairs) < 1e-6)
    four = [0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13]
    check("a block has its pixels", found["of"] == [[7], [2, 3, 7, 8], four, list(range(15)), [14]])
    names = ["column 2, row 1, echo 1", "2×2 block from column 2, row 0, echo 1"]
    names += ["4×4 block from column 0, row 0, echo 2", "8×8 block from column 0, row 0, echo 3"]
    names += ["2×2 block from column 4, row 2, echo 4"]
    check("it says which block and echo it is", found["names"] == names)
    page.close()


def main(chromium, pictures, *reports):
    pictures = Path(pictures)
    static, moving, large, few, single = map(Path, reports)
    with sync_playwright() as driver:
        # Root, as in a container, has no sandbox.
        browser = driver.chromium.launch(executable_path=shutil.which(chromium), args=["--no-sandbox"])
        print(f"browser {browser.version}")

        print("ranges")
        places_are_true(browser)

        print("blocks")
        blocks_are_as_large_as_their_pixels(browser)

        print("static scene")
        check("smaller than 5 MB", static.stat().st_size < MOST_BYTES)
        with Report(browser, static, has_touch=True) as report:
            check("drawn in colours", report.colours() > 50)
            check("no note on scripting", not report.page.locator("#unscripted").is_visible())
            turns(report)
            moves_in_time(report)
            shows_spikes(report)
            is_named(report)
        with Report(browser, opened(static)) as report:
            chooses_pixels(report)
            shows_a_pixel(report, static, 64, [942, 942 - 64 * 9, 20 * 64 + 5, 31 * 64 + 63])
            maps_time(report, static)
        with Report(browser, static) as report:
            report.page.screenshot(path=pictures / "light.png", full_page=True)
            is_closed(report)
            report.requests[:] = report.requests[:1]

        with Report(browser, static, width=1280) as report:
            places = [report.page.locator(part).bounding_box() for part in [".time", "#histogram"]]
            top, bottom = places[0]["y"] - 16, places[1]["y"] + places[1]["height"] + 24
            part = {"x": 24, "y": top, "width": 1232, "height": bottom - top}
            report.page.screenshot(path=pictures / "report.png", full_page=True, clip=part)

        print("moving scene")
        check("smaller than 5 MB", moving.stat().st_size < MOST_BYTES)
        with Report(browser, moving, has_touch=True) as report:
            text = report.page.locator("#cloud-hint").inner_text()
            check("says that not all events are shown", " events shown: " in text)
            check("drawn in colours", report.colours() > 50)
            turns(report)
            moves_in_time(report)

        print("large array")
        check("smaller than 5 MB", large.stat().st_size < MOST_BYTES)
        with Report(browser, large) as report:
            text = report.page.locator("#cloud-hint").inner_text()
            check("says that not all events are shown", " events shown: " in text)
            check("drawn in colours", report.colours() > 50)
            note = report.page.locator("#histogram-note").inner_text()
            check("it opens on a pixel with a histogram", note.startswith("Histogram of the last event"))

        with Report(browser, opened(large)) as report:
            note = report.page.locator("#histogram-note").inner_text
            report.run("choose(256 * 8 + 8)")
            check("a pixel of the grid has its histogram", note().startswith("Histogram of the last event"))
            report.run("choose(256 * 8 + 9)")
            every = report.run("data.histograms.every")
            next = f"every {every} columns and rows. The next is that of column 8, row 8."
            check(f"another one says where the next is: {note()}", every in [2, 4, 8] and next in note())

        print("few pixels")
        for path, columns, count in [(few, 3, 9), (single, 1, 1)]:
            with Report(browser, opened(path), color_scheme="dark") as report:
                shows_few(report, path, columns, count)
                shows_a_pixel(report, path, columns, range(count))
                plays_a_move(report, path, columns)
                is_named(report)
        with Report(browser, few, width=390, height=740, has_touch=True) as report:
            report.width_is(390)
            report.page.screenshot(path=pictures / "few-narrow.png", full_page=True)

        print("dark")
        with Report(browser, static, color_scheme="dark") as report:
            light = report.picture()
            page = report.run("getComputedStyle(document.body).backgroundColor")
            check("a dark page", page == "rgb(1, 4, 9)")
            check("drawn in colours", report.colours() > 50)
            report.changes(
                "the other scheme", lambda: report.page.emulate_media(color_scheme="light")
            )
            report.page.emulate_media(color_scheme="dark")
            check("and back", report.picture() == light)
            report.page.screenshot(path=pictures / "dark.png", full_page=True)

        print("narrow")
        for path in [static, moving]:
            with Report(browser, path, width=360, height=740, has_touch=True) as report:
                report.width_is(360)
                check("drawn in colours", report.colours() > 50)
                report.page.screenshot(path=pictures / "narrow.png", full_page=True)

        print("less motion")
        with Report(browser, static, reduced_motion="reduce") as report:
            report.page.locator("#play").click()
            report.page.wait_for_timeout(500)
            value = report.page.locator("#start").input_value
            check("no motion within half a second", value() == "0")
            report.page.wait_for_timeout(1000)
            check("a step after a second", value() != "0")

        print("no scripting")
        with Report(browser, static, java_script_enabled=False) as report:
            page = report.page
            check("note on scripting", page.locator("#unscripted").is_visible())
            check("no dead controls", not page.locator("#interactive").is_visible())
            check("all maps", page.locator("figure svg").count() == 4)
            check("maps are seen", page.locator("figure svg").last.is_visible())
        browser.close()


main(*sys.argv[1:])
