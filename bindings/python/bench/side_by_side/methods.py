"""The compared methods, each with the settings of its curve."""

from __future__ import annotations

import inspect
import io
import tokenize
from dataclasses import dataclass
from typing import Any, Callable

import with_dtof
import with_numpy

# Both kinds of setting grow by a factor of √2. Frames: laser cycles of a frame.
EXPOSURES = (10, 14, 20, 28, 40, 56, 80, 112, 160, 224, 320, 450, 640, 900, 1280)
# Asynchronous methods: the minimum number of photons of a peak.
MIN_PHOTONS = (5, 7, 10, 14, 20, 28, 40, 56, 80, 112, 160)
# Thresholds z, in standard deviations of the background.
Z_THRESHOLDS = tuple(2 + step / 16 for step in range(161))
# Thresholds k: chance reaches such a count with a probability below 10 ** -k.
K_THRESHOLDS = tuple(3 + step / 16 for step in range(97))


@dataclass(frozen=True)
class Method:
    """A method from photons to reports."""

    name: str
    function: Callable
    arguments: Callable[[Any], dict]  # of a scene
    thresholds: tuple[float, ...]  # the higher, the fewer false alarms
    by_exposure: bool  # the setting is the length of a frame, otherwise the minimum of photons

    @property
    def settings(self) -> tuple[int, ...]:
        return EXPOSURES if self.by_exposure else MIN_PHOTONS

    def reports(self, scene, photons, setting, threshold):
        """Pixel, laser cycle and position in bins of every report."""
        settings = {
            "exposure" if self.by_exposure else "min_photons": setting,
            "z" if self.thresholds is Z_THRESHOLDS else "k": threshold,
        }
        return self.function(photons, **self.arguments(scene), **settings)

    @property
    def lines(self) -> int:
        """Lines of code of the function and of those it calls, without comments and imports."""
        return sum(lines_of(function) for function in needed(self.function))


def numpy_arguments(scene):
    return {"pixels": scene.pixels, "bins": scene.bins, "half_width": scene.centroid_half_width}


def find_peaks_arguments(scene):
    return {**numpy_arguments(scene), "min_photons": scene.find_peaks_min_photons, "sigma": scene.sigma_bins}


def frames_arguments(scene):
    return {**numpy_arguments(scene), "min_photons": scene.frames_min_photons}


def dtof_arguments(scene):
    pulse = {"sigma_bins": scene.sigma_bins}
    if scene.half_widths:
        pulse["half_widths"] = scene.half_widths
    return {"bins": scene.bins, **pulse}


METHODS = (
    Method("frames, find_peaks", with_numpy.frames_with_find_peaks, find_peaks_arguments, Z_THRESHOLDS, True),
    Method("frames, arrays", with_numpy.frames, frames_arguments, K_THRESHOLDS, True),
    Method("asynchronous, arrays", with_numpy.asynchronous, numpy_arguments, K_THRESHOLDS, False),
    Method("dtof", with_dtof.events, dtof_arguments, Z_THRESHOLDS, False),
)
# dtof with its default threshold.
OWN_THRESHOLD = "dtof, its own threshold"


def needed(function):
    """A function and the functions of its module that it calls."""
    found, left = [], [function]
    while left:
        function = left.pop()
        if function not in found:
            found.append(function)
            of_module = vars(inspect.getmodule(function))
            named = [of_module.get(name) for name in function.__code__.co_names]
            left += [other for other in named if inspect.isfunction(other) and other.__module__ == function.__module__]
    return found


def lines_of(function) -> int:
    """Lines of code, without empty lines, comments and docstrings."""
    lines, at_start = set(), True
    nothing = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    for token in tokenize.generate_tokens(io.StringIO(inspect.getsource(function)).readline):
        docstring = token.type == tokenize.STRING and at_start
        if token.type not in nothing and not docstring:
            lines.update(range(token.start[0], token.end[0] + 1))
        at_start = token.type in nothing and (at_start or token.type == tokenize.NEWLINE)
    return len(lines)
