"""Photons to depths with numpy and scipy, and with dtof, side by side.

    python bench/side_by_side [RECORDING] [--check] [--scenes NAMES] [--page]

Writes docs/results/python.md with its chart and its tables. RECORDING is the public log of a
TMF8820. --check compares with the kept table instead, all but the speed.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
from types import SimpleNamespace

if "--wall" not in sys.argv:
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
    parser.add_argument("--scenes", default="bright,outdoor,recording", help="those to check")
    parser.add_argument("--page", action="store_true", help="write page and chart of what is kept")
    parser.add_argument("--wall", help=argparse.SUPPRESS)
    return parser.parse_args()


def main():
    given = arguments()
    made = scenes(given.recording)
    if given.wall:
        return print(wall(made, *given.wall.split(",")))
    if given.page:
        return write_page()
    names = given.scenes.split(",") if given.check else list(made)
    if "recording" in names and not os.path.exists(given.recording):
        sys.exit(f"{given.recording}: not found; name the log, or leave it out: --check --scenes bright,outdoor")
    rows, speeds = [], []
    for name in names:
        scene = made[name]()
        for method in METHODS:
            found = measure.curve(method, scene)
            rows += found
            print(f"{name}: {method.name}, {len(found)} settings", flush=True)
            if not given.check:
                speeds.append(speed(method, scene, found))
        if not given.check and cores() > 1:
            speeds[-1].all_cores = all_cores(given.recording, fast(found))
        rows.append(measure.own_threshold(OWN_THRESHOLD, METHODS[-1], scene))
    if given.check:
        wrong = kept.differences(rows, names)
        print(*wrong or [f"{len(rows)} rows are as kept"], sep="\n")
        sys.exit(f"{len(wrong)} figures differ from {kept.ROWS}" if wrong else 0)
    kept.write(kept.ROWS, rows)
    kept.write(kept.SPEEDS, speeds)
    write_page()


def cores():
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def fast(rows):
    """The row whose speed is measured."""
    return measure.chosen(rows, measure.WITHIN[0]) or rows[-1]


def speed(method, scene, rows):
    found = measure.photons_a_second(method, scene, fast(rows), measure.CPU) / 1e6
    print(f"    {found:.3g} million photons a second of processor time", flush=True)
    machine = (f"{platform.machine()} with {os.cpu_count()} cores, "
               f"Python {platform.python_version()}, numpy {numpy.__version__}, "
               f"scipy {scipy.__version__}")
    return kept.Speed(scene.name, method.name, found, 0.0, len(scene.photons), machine)


def wall(made, name, setting, threshold):
    """Millions of photons a second from start to end, of the last way and with all cores."""
    way = METHODS[-1]
    row = SimpleNamespace(setting=int(setting), threshold=float(threshold))
    return measure.photons_a_second(way, made[name](), row, measure.WALL) / 1e6


def all_cores(recording, row):
    """The same in a process of its own, as dtof takes its threads once."""
    environment = {name: value for name, value in os.environ.items() if name != "RAYON_NUM_THREADS"}
    said = f"{row.scene},{row.setting},{row.threshold}"
    command = [sys.executable, os.path.dirname(os.path.abspath(__file__)), str(recording), "--wall", said]
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    return float(done.stdout)


def write_page():
    import chart
    import page

    rows, speeds = kept.read(kept.ROWS, measure.Row), kept.read(kept.SPEEDS, kept.Speed)
    kept.PAGE.write_text(page.text(rows, speeds), encoding="utf-8")
    kept.CHART.write_text(chart.svg(rows), encoding="utf-8")
    print(f"{kept.PAGE}\n{kept.CHART}")


if __name__ == "__main__":
    main()
