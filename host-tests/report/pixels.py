"""The pixels of a report: their numbers are those of events.csv beside it."""

import csv
import math

from browser import check


def opened(path):
    """Writes the report again with a plain script instead of a module, so that the exports of its
    modules are readable: `$run.data` is `data` of `run.js`."""
    text = path.read_text()
    policy, rest = text.split("<meta http-equiv=", 1)
    copy = path.with_name("opened.html")
    copy.write_text(policy + rest.split(">", 1)[1].replace('<script type="module">', "<script>"))
    return copy


def rows_of(path):
    """The events of the run."""
    with open(path.parent / "events.csv") as file:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


def tenths(number):
    """A number as the page writes it: ties are rounded away from zero."""
    return f"{math.floor(number * 10 + 0.5) / 10:,.1f}"


def events_of(rows, pixel, columns):
    def holds(row):
        first, level = int(row["pixel"]), int(row["level"])
        return all(
            here >> level == there >> level
            for here, there in zip(divmod(pixel, columns), divmod(first, columns))
        )

    return [row for row in rows if holds(row)]


def shows_a_pixel(report, path, columns, pixels):
    """The chosen pixel's numbers are those of events.csv."""
    page, rows = report.page, rows_of(path)
    for pixel in pixels:
        report.run(f"$pixel.lookAt({pixel})")
        report.settle()
        expected = events_of(rows, pixel, columns)
        found = report.run("$pixel.chosen.events")
        check(f"pixel {pixel} has its {len(expected)} events", len(found) == len(expected) > 0)
        names = {"cycle": "cycle", "exposure": "exposure", "flags": "flags", "level": "level"}
        names |= {"echo": "echo", "peak": "peak_count"}
        for here, there in names.items():
            same = [event[here] for event in found] == [row[there] for row in expected]
            check(f"{there} of each is that of events.csv", same)
        off = max(abs(event["range"] - row["range_mm"]) for event, row in zip(found, expected))
        check(f"ranges are those of events.csv (off by {off})", off < 0.001)
        shot, last = report.run("$pixel.chosen.decision"), max(row["cycle"] for row in expected)
        row = next(row for row in expected if (row["cycle"], row["level"]) == (last, shot["level"]))
        check("the histogram is that of the last event", shot["cycle"] == last)
        check("of its range", abs(shot["range"] - row["range_mm"]) < 0.001)
        bin, photons = shot["look"]["peak"]
        check("its peak is the event's", (bin, photons) == (row["peak_bin"], row["peak_count"]))
        check("and in the histogram", shot["counts"][bin] == photons)
        check("the range lies at the peak", abs(row["depth_bins"] - bin - 0.5) <= 3)
        check("the rule needs no more", shot["look"]["needed"] <= photons)
        check("the background is the event's", abs(shot["look"]["background"] - row["background"]) <= 0.5)
        note = page.locator("#histogram-note").inner_text()
        text = f"{tenths(row['range_mm'])} mm. Peak: {photons:,.0f} photons in bin {bin};"
        check(f"the text has {text}", text in note)
        first = page.locator("#events tbody tr").first.locator("td").all_inner_texts()
        check(f"the table begins with it {first}", first[1] == f"{int(last):,}")


def chooses_pixels(report):
    page, place = report.page, report.page.locator("#map")
    place.scroll_into_view_if_needed()
    box = place.bounding_box()
    page.mouse.click(box["x"] + box["width"] * 0.51, box["y"] + box["height"] * 0.51)
    name = page.locator("#pixel-name").evaluate("e => e.value")
    middle = report.run("Math.floor($run.data.rows / 2) * $run.data.columns + $run.data.columns / 2")
    check(f"a click in the map chooses pixel {name}", report.run("$pixel.chosen.pixel") == middle)
    for key, by in [("ArrowRight", 1), ("ArrowDown", 64), ("ArrowLeft", -1), ("ArrowUp", -64)]:
        before = report.run("$pixel.chosen.pixel")
        page.keyboard.press(key)
        check(f"the key {key} chooses the next", report.run("$pixel.chosen.pixel") == before + by)
    report.settle()
    drawn = "document.getElementById('{}').toDataURL()"
    both = [report.run(drawn.format(id)) for id in ["histogram", "ranges"]]
    page.keyboard.press("ArrowRight")
    report.settle()
    check("both plots are another's", all(
        before != report.run(drawn.format(id)) for before, id in zip(both, ["histogram", "ranges"])
    ))


def last_map(path):
    """The range of each pixel's last event, from the events alone: the event of a block sets the pixels
    without a finer event in its exposure, and the first echo counts."""
    ranges, ends = {}, {}
    for row in rows_of(path):
        if row["echo"] > 1:
            continue
        level, end = int(row["level"]), row["cycle"] + 1
        y, x = divmod(int(row["pixel"]), 64)
        for pixel in (64 * j + i for j in range(y, y + 2**level) for i in range(x, x + 2**level)):
            finer = [ends.get((pixel, below), 0) for below in range(level)]
            if all(other <= end - row["exposure"] for other in finer):
                ends[pixel, level], ranges[pixel] = end, row["range_mm"]
    return ranges


def maps_time(report, path):
    """The last map shows the last events; earlier maps show those of their time."""
    expected = last_map(path)
    found = report.run("($pixel.showRangesUntil($run.data.cycles), [...$pixel.map.range].map((mm) => (isNaN(mm) ? null : mm)))")
    off = [pixel for pixel, mm in enumerate(found) if abs((mm or 0) - expected.get(pixel, 0)) > 0.01]
    check(f"the map at the end is that of events.csv {off}", not off)
    half = report.run("($pixel.showRangesUntil(400), [...$pixel.map.range].filter((mm) => !isNaN(mm)).length)")
    check("early on, fewer pixels have a range", 0 < half < len(expected))
    again = report.run("($pixel.showRangesUntil($run.data.cycles), [...$pixel.map.range].map((mm) => (isNaN(mm) ? null : mm)))")
    check("and at the end again the same", again == found)


def plays_a_move(report, path, columns):
    """During playback map, plots and text show the range of that time."""
    page = report.page
    report.run("$pixel.lookAt(0)")
    expected = events_of(rows_of(path), 0, columns)
    page.select_option("#width", index=3)
    seen = []
    for place in [20, 100, 180]:
        page.locator("#start").fill(str(place))
        report.settle()
        end = report.run("$run.shown.end")
        last = [row for row in expected if row["cycle"] < end][-1]
        note = page.locator("#ranges-note").inner_text()
        check(f"the range at the time: {note}", f": {tenths(last['range_mm'])} mm, reported at" in note)
        seen.append((last["range_mm"], report.run("document.getElementById('ranges').toDataURL()")))
    ranges = [mm for mm, _ in seen]
    check(f"the target has moved {ranges}", max(ranges) - min(ranges) > 200)
    check("the cursor as well", len({picture for _, picture in seen}) == 3)
    page.select_option("#width", index=0)


def shows_few(report, path, columns, count):
    """Plots, not squares."""
    page = report.page
    check("no cloud and no map", not page.locator("#cloud").is_visible() and not page.locator("#map").is_visible())
    check("no pictures of squares", page.locator("figure svg").count() == 0)
    plots = page.locator("#few button")
    check(f"{count} plots", plots.count() == count)
    check("a table of pixels", page.locator("h2", has_text="Pixels").count() == 1)
    if count == 1:
        check("one plot is enough", not page.locator("#few").is_visible())
        return
    plots.nth(1).click()
    check("a click chooses a pixel", report.run("$pixel.chosen.pixel") == 1)
    page.keyboard.press("ArrowDown")
    check("an arrow key the one below", report.run("$pixel.chosen.pixel") == 1 + columns)
    # Plots are drawn with the next frame.
    report.settle()
    check("its plot is pressed", plots.nth(1 + columns).get_attribute("aria-pressed") == "true")
    texts = plots.all_inner_texts()
    rows = rows_of(path)
    counts = [len(events_of(rows, pixel, columns)) for pixel in range(count)]
    check(f"each with its events {counts}", all(f": {n:,} events" in text for n, text in zip(counts, texts)))
