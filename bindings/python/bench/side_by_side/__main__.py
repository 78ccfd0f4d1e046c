"""Photons to depths with numpy and scipy, and with dtof, side by side.

    python bench/side_by_side [RECORDING] [--check] [--scenes NAMES] [--page]

Writes docs/results/python.md with its chart and its tables. RECORDING is the public log of a
TMF8820. --check compares with the kept table instead, all but the speed.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys

os.environ["RAYON_NUM_THREADS"] = "1"  # before dtof is loaded

import numpy
import scipy

import kept
import measure
from methods import METHODS, OWN_THRESHOLD
from photons import scenes


def arguments():
    parser = argparse.ArgumentParser(prog="side_by_side", description=__doc__.splitlines()[0])
    place = kept.ROOT.parent / "shared/data/tmf8820_plane_gt/distance_data.json"
    parser.add_argument("recording", nargs="?", default=place, help="the log of a TMF8820")
    parser.add_argument("--check", action="store_true", help="compare with what is kept")
    parser.add_argument("--scenes", default="bright,outdoor,recording",
                        help="those to measure or check; the rest stays as kept")
    parser.add_argument("--page", action="store_true", help="write page and chart of what is kept")
    return parser.parse_args()


def main():
    given = arguments()
    made = scenes(given.recording)
    if given.page:
        return write_page()
    names = given.scenes.split(",")
    if "recording" in names and not os.path.exists(given.recording):
        sys.exit(f"{given.recording}: not found; name the log, or leave it out: --scenes bright,outdoor")
    rows, speeds = [], []
    for name in names:
        scene = made[name]()
        for method in METHODS:
            found = measure.curve(method, scene)
            rows += found
            print(f"{name}: {method.name}, {len(found)} settings", flush=True)
            if not given.check:
                speeds.append(speed(method, scene, found))
        rows.append(measure.own_threshold(OWN_THRESHOLD, METHODS[-1], scene))
    if given.check:
        wrong = kept.differences(rows, names)
        print(*wrong or [f"{len(rows)} rows are as kept"], sep="\n")
        sys.exit(f"{len(wrong)} figures differ from {kept.ROWS}" if wrong else 0)
    kept.write(kept.ROWS, kept.with_others(kept.ROWS, rows, list(made)))
    kept.write(kept.SPEEDS, kept.with_others(kept.SPEEDS, speeds, list(made)))
    write_page()


def fast(rows):
    """The row whose speed is measured."""
    return measure.chosen(rows, measure.WITHIN[0]) or rows[-1]


def speed(method, scene, rows):
    found = measure.photons_a_second(method, scene, fast(rows)) / 1e6
    print(f"    {found:.3g} million photons a second of processor time", flush=True)
    machine = (f"{platform.machine()} with {os.cpu_count()} cores, "
               f"Python {platform.python_version()}, numpy {numpy.__version__}, "
               f"scipy {scipy.__version__}")
    return kept.Speed(scene.name, method.name, found, len(scene.photons), machine)


def write_page():
    import chart
    import page

    rows, speeds = kept.read(kept.ROWS, measure.Row), kept.read(kept.SPEEDS, kept.Speed)
    kept.PAGE.write_text(page.text(rows, speeds), encoding="utf-8")
    kept.CHART.write_text(chart.svg(rows), encoding="utf-8")
    print(f"{kept.PAGE}\n{kept.CHART}")


if __name__ == "__main__":
    main()
