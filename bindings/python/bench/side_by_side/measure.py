"""Time, error and false alarms of each method, on the same photons."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Optional

import numpy as np

# One false alarm per this many laser cycles of a pixel: 1 % of exposures of 2000.
CYCLES_PER_ALARM = 200_000
WRONG_BINS = 3.0
# Laser cycles from the start whose reports are averaged, for `mean_error_bins`.
AVERAGED_CYCLES = 1000
# Target errors, in bins.
WITHIN = (0.4, 0.2)


@dataclass
class Row:
    """A method with a setting on a scene: a row of the stored table.

    Times are laser cycles until the first right report. They are infinite if too few pixels have
    one; in the mean such a pixel counts with the whole run.
    """

    scene: str
    method: str
    setting: int
    threshold: Optional[float]
    mean: float
    half: float
    nine_of_ten: float
    error_bins: float
    error_mm: float
    wrong: float  # share of the pixels whose first report is wrong
    mean_error_bins: float  # of the mean of the reports in the first AVERAGED_CYCLES
    false_alarms: Optional[float] = None  # relative to the limit; only for chosen settings


def alarms(method, scene, photons, setting, threshold) -> float:
    """False alarms relative to the limit."""
    reports = method.reports(scene, photons, setting, threshold)[0].size
    return reports * CYCLES_PER_ALARM / (scene.pixels * photons.cycles)


def lowest_threshold(method, scene, setting) -> Optional[float]:
    """The lowest threshold within the limit of false alarms, if there is one."""
    low, high = 0, len(method.thresholds)
    while low < high:
        middle = (low + high) // 2
        if alarms(method, scene, scene.empty, setting, method.thresholds[middle]) <= 1:
            high = middle
        else:
            low = middle + 1
    return method.thresholds[low] if low < len(method.thresholds) else None


def scored(scene, reports) -> dict:
    """Times, errors and wrong pixels, with the keys of :class:`Row`.

    A pixel counts once, with time and error of its first right report.
    """
    pixel, cycle, position = reports
    pixel = pixel.astype(int)
    error = position - scene.truth_mm[pixel] / scene.mm_per_bin
    if scene.fit_offset:
        error = error - np.median(error)
    first_of_all = np.unique(pixel, return_index=True)[1]
    is_right = np.abs(error) <= WRONG_BINS
    wrong = np.mean(~is_right[first_of_all])
    pixel, cycle, error = pixel[is_right], cycle[is_right], error[is_right]
    reporting, at = np.unique(pixel, return_index=True)
    waited = np.full(scene.pixels, np.inf)
    waited[reporting] = cycle[at]
    half, nine_of_ten = np.quantile(waited, [0.5, 0.9], method="inverted_cdf")
    early = cycle <= AVERAGED_CYCLES
    number = np.bincount(pixel[early], minlength=scene.pixels)
    total = np.bincount(pixel[early], error[early], minlength=scene.pixels)
    mean = total[number > 0] / number[number > 0]
    rms = root_mean_square(error[at])
    wait = float(np.minimum(waited, scene.photons.cycles).mean())
    return {
        "mean": wait,
        "half": float(half),
        "nine_of_ten": float(nine_of_ten),
        "error_bins": rms,
        "error_mm": rms * scene.mm_per_bin,
        "wrong": float(wrong),
        "mean_error_bins": root_mean_square(mean),
    }


def root_mean_square(values) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("inf")


def curve(method, scene) -> list[Row]:
    """A row for each setting. Frames have a threshold for each setting, others one for all."""
    rows, threshold = [], None
    for setting in method.settings:
        if threshold is None or method.by_exposure:
            threshold = lowest_threshold(method, scene, setting)
        if threshold is not None:
            reports = method.reports(scene, scene.photons, setting, threshold)
            rows.append(Row(scene.name, method.name, setting, threshold, **scored(scene, reports)))
    for row in filter(None, (chosen(rows, within) for within in WITHIN)):
        row.false_alarms = alarms(method, scene, scene.empty_again, row.setting, row.threshold)
    return rows


def own_threshold(name, method, scene) -> Row:
    """The first setting, with the default threshold."""
    setting = method.settings[0]
    reports = method.reports(scene, scene.photons, setting, None)
    many = alarms(method, scene, scene.empty_again, setting, None)
    return Row(scene.name, name, setting, None, **scored(scene, reports), false_alarms=many)


def chosen(rows, within) -> Optional[Row]:
    """The row with the shortest mean time and an error of at most ``within`` bins."""
    exact = [row for row in rows if row.error_bins <= within and np.isfinite(row.nine_of_ten)]
    return min(exact, key=lambda row: row.mean, default=None)


def times_at(rows, within) -> Optional[tuple[float, float, float]]:
    """The times (mean, half and nine in ten of the pixels) at an error of ``within`` bins.

    Interpolated in logarithms between two settings. If all settings are more exact, the times are
    those of the soonest.
    """
    curve = [(row.error_bins, row.mean, row.half, row.nine_of_ten) for row in rows]
    exact = [tuple(point[1:]) for point in curve if point[0] <= within]
    for one, other in zip(curve, curve[1:]):
        if min(one[0], other[0]) < within < max(one[0], other[0]):
            part = np.log(within / one[0]) / np.log(other[0] / one[0])
            between = (a if a == b else a ** (1 - part) * b**part for a, b in zip(one[1:], other[1:]))
            exact.append(tuple(map(float, between)))
    return min((times for times in exact if np.isfinite(times[2])), default=None)


def photons_a_second(method, scene, row) -> float:
    """Photons per second of processor time, the best of three."""
    times = []
    for _ in range(3):
        begun = time.process_time()
        method.reports(scene, scene.photons, row.setting, row.threshold)
        times.append(time.process_time() - begun)
    return len(scene.photons) / min(times)
