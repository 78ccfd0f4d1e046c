"""Replay of recordings and simulation of scenes."""

from __future__ import annotations

import json
import os
import warnings
from dataclasses import dataclass
from typing import Any, Callable, Optional

import numpy

from . import _native
from ._arrays import Array, events_of, photon_list, native_input
from ._maps import depth_map, points, reflectivity
from ._options import arguments

Progress = Optional[Callable[[int, int], Any]]


@dataclass(frozen=True)
class Replay:
    """The results of a run.

    ``events`` is an array of :data:`dtof.EVENT`, sorted by laser cycle, level and pixel.
    ``statistics`` has the contents of ``summary.json``; every loss is counted there. ``settings``
    are those of the run, ``toml`` is the same as the text of a settings file.
    """

    events: numpy.ndarray
    array: Array
    statistics: dict[str, Any]
    settings: dict[str, Any]
    toml: str

    def __repr__(self) -> str:
        photons, (rows, columns) = self.statistics["photons"], self.array.shape
        return f"<dtof.Replay: {self.events.size} events of {photons} photons, {rows}x{columns} pixels>"

    def depth_map(self, **options: Any) -> numpy.ndarray:
        """See :func:`dtof.depth_map`."""
        return depth_map(self.events, self.array, **options)

    def reflectivity(self, **options: Any) -> numpy.ndarray:
        """See :func:`dtof.reflectivity`."""
        return reflectivity(self.events, self.array, **options)

    def points(self, **options: Any) -> numpy.ndarray:
        """See :func:`dtof.points`."""
        return points(self.events, self.array, **options)


def replay(
    recorded: Any, *, axis: int = -1, progress: Progress = None, **options: Any
) -> Replay:
    """Turns a recording into depth events.

    ``recorded`` is the name of a file (``.npy``, ``.npz``, ``.csv``, or the ``.json`` log of a
    TMF8820 or TMF8829), an array of histograms, or an array of photons with the fields ``pixel``,
    ``cycle`` and ``bin``. Counts are whole numbers from 0, of any type. The bins of an array are
    its axis ``axis``; the one before it are columns and all others rows. ``axes`` names all of
    them instead: ``axes="captures,rows,columns,bins"``. At most 65,536 pixels and 4096 bins.

    ``photons_per_cycle`` (1.0, in the brightest pixel) or ``recorded_cycles`` determine how long
    histograms were recorded. ``cycles`` (10,000) laser cycles are replayed with random ``seed`` (1).
    Other options of ``dtof replay`` are keywords, with ``_`` instead of ``-``: ``rule="window",
    sigma_bins=0.8, gate=(12, 119), mask=[3, 70]``. An empty ``mask`` is the same as none.
    Without ``settings`` and without an option of detection, the settings are those of :func:`calibrate`.
    ``settings`` is the name of a settings file. Options of reports and files are not available:
    ``echo``, ``dynamic_depth``, ``threshold_mm``, ``reference`` and ``no_csv``.

    ``progress(done, total)`` is called about 20 times a second with laser cycles. An exception in it
    ends the run, as does Ctrl-C.

    Raises :class:`dtof.Error` with the message of the program, with keywords instead of flags.
    """
    if axis != -1:
        recorded = _bins_last(recorded, axis, options)
    source = native_input(recorded, "the array")
    return result(_native.replay(source, arguments(options), progress, None))


def photons(
    pixel: Any, cycle: Any, bin: Any, *, progress: Progress = None, **options: Any
) -> Replay:
    """Turns single photons into depth events.

    ``pixel``, ``cycle`` and ``bin`` are integers from 0, one per photon, or one number for all
    photons. Laser cycles must not decrease. ``columns`` is the width of the array (default: one
    row), ``bins`` the number of bins (128). All laser cycles up to the last photon are replayed,
    or as many as ``cycles`` or a settings file requests. Further options are those of
    :func:`replay`. The photons are copied twice; if they do not fit into memory, save them with
    ``numpy.save`` and replay the file, with ``cycles``.
    """
    listed = photon_list(pixel, cycle, bin)
    # Laser cycles do not decrease. Invalid values are refused later.
    last = int(listed["cycle"][-1]) if listed.size else 0
    cycles = min(max(last, 0) + 1, 2**63 - 1)
    source = native_input(listed, "photons")
    return result(_native.replay(source, arguments(options), progress, None, cycles))


def simulate(scene: Any, *, progress: Progress = None, **options: Any) -> Replay:
    """Simulates a scene.

    ``scene`` is the name of a scene file, or the text of one (several lines).
    ``array=(columns, rows)``, ``laser_off=True``, ``cycles`` and ``seed`` are those of ``dtof
    simulate``, further options those of :func:`replay`. ``statistics["against_truth"]`` compares
    the events with the scene.
    """
    return result(_native.simulate(scene_of(scene), arguments(options), progress))


def scene_of(scene: Any) -> Any:
    """A scene for the native extension: text has several lines, a file name has one."""
    if isinstance(scene, str) and "\n" in scene:
        return "the scene", scene
    return os.fspath(scene)


def result(done: dict[str, Any]) -> Replay:
    """The result of a native run; issues its warnings."""
    warn(done["warnings"], callers=3)
    return quiet_result(done)


def quiet_result(done: dict[str, Any]) -> Replay:
    """The result of a native run, without its warnings."""
    return Replay(
        events=events_of(done["events"]),
        array=Array(**done["array"]),
        statistics=json.loads(done["summary"]),
        settings=json.loads(done["settings"]),
        toml=done["toml"],
    )


def warn(lines: list[str], callers: int = 2) -> None:
    """Issues warnings about a recording.

    They name the line ``callers`` levels up: 2 if the user called the caller of this function.
    """
    for line in lines:
        warnings.warn(line, UserWarning, stacklevel=callers + 1)


def _bins_last(recorded: Any, axis: int, options: dict[str, Any]) -> numpy.ndarray:
    if options.get("axes") is not None:
        raise _native.Error("axis and axes: give one of them")
    if isinstance(recorded, (str, os.PathLike)):
        raise _native.Error("axis is for arrays; axes names those of a file")
    try:
        return numpy.moveaxis(numpy.asanyarray(recorded), axis, -1)
    except (TypeError, ValueError) as error:
        raise _native.Error(f"axis {axis}: {error}") from error
