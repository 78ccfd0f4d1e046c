"""Replay of recordings and simulation of scenes."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Optional

import numpy

from . import _native
from ._arrays import Array, array_of, events_of, is_table, native_input, photon_columns, photon_list, recording_input
from ._files import export_for, write_events
from ._html import depth_image
from ._keywords import Echo, PointsOptions, ReplayOptions, SimulateOptions, takes
from ._maps import depth_map, points, reflectivity
from ._options import arguments
from ._view import View, view
from ._warn import warn

if TYPE_CHECKING:
    from typing_extensions import Unpack

Progress = Optional[Callable[[int, int], Any]]


@dataclass(frozen=True, eq=False, repr=False)
class Replay:
    """The results of a run.

    ``events`` is an array of :data:`dtof.EVENT`, sorted by laser cycle, level and pixel.
    ``statistics`` has the contents of ``summary.json``; every loss is counted there. ``settings``
    are those of the run, ``toml`` is the same as the text of a settings file. ``depth`` is ``depth.npy``:
    millimetres of each pixel, decided once on all of its photons (rows by columns, NaN without a surface).
    ``confidence`` has how many standard deviations the peak of each pixel stands above its background
    (NaN for pixels left out). With ``frame`` both are None. Two runs are never equal: compare their events.
    """

    events: numpy.ndarray
    array: Array
    statistics: dict[str, Any]
    settings: dict[str, Any]
    toml: str
    depth: Optional[numpy.ndarray] = None
    confidence: Optional[numpy.ndarray] = None

    def __repr__(self) -> str:
        photons, (rows, columns) = self.statistics["photons"], self.array.shape
        return f"<dtof.Replay: {self.events.size} events of {photons} photons, {rows}x{columns} pixels>"

    def _repr_html_(self) -> str:
        depth = self.depth_map()
        reporting = f"{self.statistics['pixels_reporting']:,} of {self.statistics['pixels']:,}"
        totals = [
            ("depth events", f"{self.events.size:,}"),
            ("photons", f"{self.statistics['photons']:,}"),
            ("laser cycles", f"{self.statistics['cycles']:,}"),
            ("pixels reporting", reporting),
        ]
        rows = "".join(f"<tr><td>{name}</td><td>{value}</td></tr>" for name, value in totals)
        return f"<table>{rows}</table>{depth_image(depth)}"

    def depth_map(self, *, of: str = "photons", mean: bool = True, echo: Echo = "strongest") -> numpy.ndarray:
        """The depth of each pixel in millimetres, rows by columns; NaN without a surface.

        It is that of ``depth.npy``, decided once on all photons of each pixel. With ``of="events"`` it is that of
        ``depth-events.npy``: see :func:`dtof.depth_map`, also for ``mean`` and ``echo``. Frames, ``mean=False`` and another
        ``echo`` take that of the events, too.
        """
        if of not in ("photons", "events"):
            raise _native.Error(f'of {of!r}: must be "photons" or "events"')
        if of == "photons" and mean and echo == "strongest" and self.depth is not None:
            return self.depth.copy()
        return depth_map(self.events, self.array, mean=mean, echo=echo)

    def reflectivity(self, *, of: str = "signal", echo: Echo = "strongest") -> numpy.ndarray:
        """See :func:`dtof.reflectivity`."""
        return reflectivity(self.events, self.array, of=of, echo=echo)

    @takes(PointsOptions)
    def points(self, **options: Unpack[PointsOptions]) -> numpy.ndarray:
        """See :func:`dtof.points`."""
        return points(self.events, self.array, **options)

    def write_events(self, path: Any) -> None:
        """Writes the events as an AER file; see :func:`dtof.write_events`."""
        write_events(path, self.events, self.array)

    def view(self, **options: Any) -> View:
        """See :func:`dtof.view`."""
        return view(self, **options)

    @takes(PointsOptions)
    def export(self, path: Any, format: Optional[str] = None, **options: Unpack[PointsOptions]) -> None:
        """See :func:`dtof.export`."""
        export_for(path, self.events, self.array, format, options)


@takes(ReplayOptions)
def replay(recorded: Any, *, axis: int = -1, progress: Progress = None, **options: Unpack[ReplayOptions]) -> Replay:
    """Turns a recording into depth events.

    ``recorded`` is the name of a file (``.npy``, ``.npz``, ``.csv``, or the ``.json`` log of a
    TMF8820, TMF8828 or TMF8829), an array of histograms, or an array of photons with the fields ``pixel``,
    ``cycle`` and ``bin``. A data frame with these columns, a sparse matrix of pixels and bins, and an
    xarray with dimensions row, column, bin and capture (or y, x, time) are read, too. Counts are whole numbers from 0, of any type. The bins of an array are
    its axis ``axis``; the one before it are columns and all others rows. ``axes`` names all of
    them instead: ``axes="captures,rows,columns,bins"``. At most 65,536 pixels and 4096 bins.

    ``photons_per_cycle`` (1.0, in the brightest pixel) or ``recorded_cycles`` determine how long
    histograms were recorded. ``cycles`` (10,000; all of photons) laser cycles are replayed with random ``seed`` (1);
    a warning counts the photons after them, unless ``cycles`` is given. :attr:`Replay.depth` is decided on all photons.
    ``decide_once`` has these decisions in place of asynchronous events.
    ``settings`` is the name or the text of a settings file, a dict of its sections, or a calibration, a
    comparison or a run. Without ``settings``, those of :func:`calibrate` are found in the recording:
    ``statistics["found"]``. Options override them. With ``settings``, even ``{}``, the defaults hold for what it leaves out.
    Options of reports and files are not available:
    ``echo``, ``dynamic_depth``, ``threshold_mm``, ``reference`` and ``no_csv``.

    ``progress(done, total)`` is called about 20 times a second with laser cycles. An exception in it
    ends the run, as does Ctrl-C.

    Raises :class:`dtof.Error` with the message of the program, with keywords instead of flags.
    """
    if axis != -1:
        recorded = _bins_last(recorded, axis, options)
    source = recording_input(recorded, options)
    return result(_native.replay(source, arguments(ReplayOptions, options), progress))


@takes(ReplayOptions)
def photons(
    pixel: Any, cycle: Any = None, bin: Any = None, *, progress: Progress = None, **options: Unpack[ReplayOptions]
) -> Replay:
    """Turns single photons into depth events.

    ``pixel``, ``cycle`` and ``bin`` are integers from 0, one per photon, or one number for all
    photons. ``photons(array)`` takes all of them in one: an N×3 array of integers with the columns pixel,
    cycle and bin, or an array or a data frame with these fields. Laser cycles must not decrease. ``columns`` is the width of the array (default: one
    row), ``bins`` the number of bins (128). All laser cycles up to the last photon are replayed,
    or as many as ``cycles`` or a settings file requests. Further options are those of
    :func:`replay`. The photons are copied twice; if they do not fit into memory, save them with
    ``numpy.save`` and replay the file.
    """
    listed = photon_list(*_columns(pixel) if cycle is None and bin is None else (pixel, cycle, bin))
    source = native_input(listed, "photons")
    return result(_native.replay(source, arguments(ReplayOptions, options), progress))


@takes(SimulateOptions)
def simulate(scene: Any, *, progress: Progress = None, **options: Unpack[SimulateOptions]) -> Replay:
    """Simulates a scene.

    ``scene`` is the name of a scene file, or the text of one (several lines).
    ``array=(columns, rows)``, ``laser_off=True``, ``cycles`` and ``seed`` are those of ``dtof
    simulate``, further options those of :func:`replay`. ``statistics["against_truth"]`` compares
    the events with the scene.
    """
    return result(_native.simulate(scene_of(scene), arguments(SimulateOptions, options), progress))


def scene_of(scene: Any) -> Any:
    """A scene for the native extension: text has several lines, a file name has one."""
    if isinstance(scene, str) and "\n" in scene:
        return "the scene", scene
    return os.fspath(scene)


def result(done: dict[str, Any]) -> Replay:
    """The result of a native run; issues its warnings."""
    warn(done["warnings"], callers=3)
    array = array_of(done["array"])
    depth, confidence = (
        None if values is None else numpy.array(values).reshape(array.shape)
        for values in (done["depth"], done["confidence"])
    )
    return Replay(
        events=events_of(done["events"]),
        array=array,
        statistics=json.loads(done["summary"]),
        settings=json.loads(done["settings"]),
        toml=done["toml"],
        depth=depth,
        confidence=confidence,
    )


def _columns(photons: Any) -> tuple[Any, ...]:
    """Pixel, cycle and bin of a list of photons."""
    if is_table(photons) or getattr(getattr(photons, "dtype", None), "names", None) is not None:
        return tuple(photon_columns(photons, "photons"))
    try:
        array = numpy.asarray(photons)
    except (TypeError, ValueError) as error:
        raise _native.Error("photons: not an array: must be pixel, cycle and bin") from error
    if array.ndim != 2 or array.shape[1] != 3:
        raise _native.Error(f"photons: an array of {array.shape}: give pixel, cycle and bin, or an array of N×3")
    return tuple(array.T)


def _bins_last(recorded: Any, axis: int, options: Any) -> numpy.ndarray:
    if options.get("axes") is not None:
        raise _native.Error("axis and axes: give one of them")
    if isinstance(recorded, (str, os.PathLike)):
        raise _native.Error("axis is for arrays; axes names those of a file")
    try:
        moved = numpy.moveaxis(numpy.asanyarray(recorded), axis, -1)
    except (TypeError, ValueError) as error:
        raise _native.Error(f"axis {axis}: {error}") from error
    if moved.ndim == 3:
        options["axes"] = "rows,columns,bins"
    return moved
