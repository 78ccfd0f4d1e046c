"""Reports of `dtof` in a real browser, for the test `report` of `dtof-host-tests`.

Arguments: the browser, the folder for the pictures, the reports of a static scene, of a moving
one with more events than a report shows, of a large array, of a target that moves before few
pixels, of a single pixel, and of pixels that confirm each other. Ends with an error at the first thing that is not as it should be.
"""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from browser import Report, check
from pixels import chooses_pixels, maps_time, opened, plays_a_move, shows_a_pixel, shows_few

MOST_BYTES = 5_000_000


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


def leaves_no_names(report, path):
    """The window has no names but those of an empty page."""
    names = "Object.getOwnPropertyNames(window)"
    nothing = path.with_name("empty.html")
    nothing.write_text("<!DOCTYPE html>")
    empty = report.window.new_page()
    empty.goto(nothing.resolve().as_uri())
    more = set(report.run(names)) - set(empty.evaluate(names))
    empty.close()
    check(f"no names of the script in the window {more}", not more)


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


def main(chromium, pictures, *reports):
    pictures = Path(pictures)
    static, moving, large, few, single, confirmed = map(Path, reports)
    with sync_playwright() as driver:
        # Root, as in a container, has no sandbox.
        browser = driver.chromium.launch(executable_path=shutil.which(chromium), args=["--no-sandbox"])
        print(f"browser {browser.version}")

        print("static scene")
        check("smaller than 5 MB", static.stat().st_size < MOST_BYTES)
        with Report(browser, static, has_touch=True) as report:
            check("drawn in colours", report.colours() > 50)
            check("no note on scripting", not report.page.locator("#unscripted").is_visible())
            turns(report)
            moves_in_time(report)
            shows_spikes(report)
            is_named(report)
            leaves_no_names(report, static)
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
            report.run("$pixel.lookAt(256 * 8 + 8)")
            check("a pixel of the grid has its histogram", note().startswith("Histogram of the last event"))
            report.run("$pixel.lookAt(256 * 8 + 9)")
            every = report.run("$run.data.histograms.every")
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

        print("neighbours")
        with Report(browser, opened(confirmed)) as report:
            notes = []
            for pixel in range(16 * 16):
                report.run(f"$pixel.lookAt({pixel})")
                notes.append(report.page.locator("#histogram-note").inner_text())
            numbered = [note for note in notes if "; the rule needs " in note]
            depends = [note for note in notes if note.endswith("depends on earlier events or on neighbours.")]
            check(f"a number of its own: {numbered[:1]}", numbered)
            check(f"confirmed by neighbours: {depends[:1]}", depends)

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
