"""Photons to depths with numpy and scipy, and with dtof, side by side.

    python bench/side_by_side [RECORDING] [--check] [--scenes NAMES] [--page]

Writes docs/results/python.md with its chart and its tables. RECORDING is the public log of a
TMF8820. --check compares everything except the speed with the stored table instead.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys

os.environ["RAYON_NUM_THREADS"] = "1"  # before dtof is loaded

import measure
import numpy
import scipy
import stored
from methods import METHODS, OWN_THRESHOLD
from photons import scenes


def arguments():
    parser = argparse.ArgumentParser(prog="side_by_side", description=__doc__.splitlines()[0])
    place = stored.ROOT.parent / "shared/data/tmf8820_plane_gt/distance_data.json"
    parser.add_argument("recording", nargs="?", default=place, help="the log of a TMF8820")
    parser.add_argument("--check", action="store_true", help="compare with the stored table")
    parser.add_argument(
        "--scenes", default="bright,outdoor,recording", help="scenes to measure or check; others stay unchanged"
    )
    parser.add_argument("--page", action="store_true", help="write page and chart from the stored tables")
    return parser.parse_args()


def main():
    options = arguments()
    makers = scenes(options.recording)
    if options.page:
        return write_page()
    names = options.scenes.split(",")
    if "recording" in names and not os.path.exists(options.recording):
        sys.exit(f"{options.recording}: not found; name the log, or leave it out: --scenes bright,outdoor")
    rows, speeds = [], []
    for name in names:
        scene = makers[name]()
        for method in METHODS:
            found = measure.curve(method, scene)
            rows += found
            print(f"{name}: {method.name}, {len(found)} settings", flush=True)
            if not options.check:
                speeds.append(speed(method, scene, found))
        rows.append(measure.own_threshold(OWN_THRESHOLD, METHODS[-1], scene))
    if options.check:
        wrong = stored.differences(rows, names)
        print(*wrong or [f"{len(rows)} rows are unchanged"], sep="\n")
        sys.exit(f"{len(wrong)} figures differ from {stored.ROWS}" if wrong else 0)
    stored.write(stored.ROWS, stored.with_others(stored.ROWS, rows, list(makers)))
    stored.write(stored.SPEEDS, stored.with_others(stored.SPEEDS, speeds, list(makers)))
    write_page()


def fast(rows):
    """The row whose speed is measured."""
    return measure.chosen(rows, measure.WITHIN[0]) or rows[-1]


def speed(method, scene, rows):
    found = measure.photons_a_second(method, scene, fast(rows)) / 1e6
    print(f"    {found:.3g} million photons a second of processor time", flush=True)
    machine = (
        f"{platform.machine()} with {os.cpu_count()} cores, "
        f"Python {platform.python_version()}, numpy {numpy.__version__}, "
        f"scipy {scipy.__version__}"
    )
    return stored.Speed(scene.name, method.name, found, len(scene.photons), machine)


def write_page():
    import chart
    import page

    rows, speeds = stored.read(stored.ROWS, measure.Row), stored.read(stored.SPEEDS, stored.Speed)
    stored.PAGE.write_text(page.text(rows, speeds), encoding="utf-8")
    stored.CHART.write_text(chart.svg(rows), encoding="utf-8")
    print(f"{stored.PAGE}\n{stored.CHART}")


if __name__ == "__main__":
    main()
