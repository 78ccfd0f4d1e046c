"""The ways that are compared, each with the settings that make its curve."""

from __future__ import annotations

import inspect
import io
import tokenize
from dataclasses import dataclass
from typing import Any, Callable

import dtof_way
import numpy_way

# Settings grow by the root of two.
EXPOSURES = (10, 14, 20, 28, 40, 56, 80, 112, 160, 224, 320, 450, 640, 900, 1280)
LEAST = (5, 7, 10, 14, 20, 28, 40, 56, 80, 112, 160)
DEVIATIONS = tuple(2 + step / 16 for step in range(161))
POWERS = tuple(3 + step / 16 for step in range(97))


@dataclass(frozen=True)
class Method:
    """A way from photons to reports."""

    name: str
    way: Callable
    arguments: Callable[[Any], dict]  # of a scene
    thresholds: tuple[float, ...]  # the higher, the fewer false alarms
    by_exposure: bool  # frames; else by the least photons of a peak

    @property
    def settings(self) -> tuple[int, ...]:
        return EXPOSURES if self.by_exposure else LEAST

    def reports(self, scene, photons, setting, threshold):
        """Pixel, laser cycle and position in bins of every report."""
        given = {"exposure" if self.by_exposure else "least": setting,
                 "z" if self.thresholds is DEVIATIONS else "k": threshold}
        return self.way(photons, **self.arguments(scene), **given)

    @property
    def lines(self) -> int:
        """Lines of code of the function and of those it calls, without comments and imports."""
        return sum(lines_of(function) for function in needed(self.way))


def of_numpy(scene):
    return {"pixels": scene.pixels, "bins": scene.bins, "reach": scene.reach}


def of_find_peaks(scene):
    return {**of_numpy(scene), "least": scene.least_of_frames[0], "sigma": scene.sigma_bins}


def of_frames(scene):
    return {**of_numpy(scene), "least": scene.least_of_frames[1]}


def of_dtof(scene):
    pulse = {"sigma_bins": scene.sigma_bins}
    if scene.half_widths:
        pulse["half_widths"] = scene.half_widths
    return {"bins": scene.bins, **pulse}


METHODS = (
    Method("frames, find_peaks", numpy_way.frames_with_find_peaks, of_find_peaks, DEVIATIONS, True),
    Method("frames, arrays", numpy_way.frames, of_frames, POWERS, True),
    Method("asynchronous, arrays", numpy_way.asynchronous, of_numpy, POWERS, False),
    Method("dtof", dtof_way.events, of_dtof, DEVIATIONS, False),
)
# What dtof does without a threshold that is found.
OWN_THRESHOLD = "dtof, its own threshold"


def needed(function):
    """A function and those of its module that it needs."""
    found, left = [], [function]
    while left:
        function = left.pop()
        if function not in found:
            found.append(function)
            of_module = vars(inspect.getmodule(function))
            named = [of_module.get(name) for name in function.__code__.co_names]
            left += [other for other in named if inspect.isfunction(other)
                     and other.__module__ == function.__module__]
    return found


def lines_of(function) -> int:
    """Lines that are not empty, and neither comment nor docstring."""
    lines, at_start = set(), True
    nothing = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
               tokenize.ENDMARKER}
    for token in tokenize.generate_tokens(io.StringIO(inspect.getsource(function)).readline):
        docstring = token.type == tokenize.STRING and at_start
        if token.type not in nothing and not docstring:
            lines.update(range(token.start[0], token.end[0] + 1))
        at_start = token.type in nothing and (at_start or token.type == tokenize.NEWLINE)
    return len(lines)
