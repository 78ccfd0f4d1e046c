"""Recordings and events in files."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Optional

import numpy

from . import _native
from ._arrays import Array, array_of, events_of, recording_input, records_of
from ._keywords import LoadOptions, PointsOptions, takes
from ._options import arguments
from ._warn import warn

if TYPE_CHECKING:
    from typing_extensions import Unpack


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Histograms of a recording.

    ``counts`` has the axes captures, rows, columns and bins, and 64-bit photon counts.
    ``bin_width_ps`` is in picoseconds, ``offset_mm`` in millimetres (None if the format has none).
    ``gate`` is the first and the last bin that were measured completely, None for all bins.
    ``truth_mm`` is the true distance of each pixel (captures, rows, columns; NaN if unknown), None
    if the file has none. ``cycles`` is the number of laser cycles of a photon list. ``cut_off``
    counts photons in bins that were cut off, ``notes`` lists other changes.
    """

    counts: numpy.ndarray
    bin_width_ps: float
    offset_mm: Optional[float]
    gate: Optional[tuple[int, int]]
    truth_mm: Optional[numpy.ndarray]
    cycles: Optional[int]
    cut_off: int
    notes: dict[str, str]

    def __repr__(self) -> str:
        captures, rows, columns, bins = self.counts.shape
        several = f"{captures} captures of " if captures > 1 else ""
        return f"<dtof.Recording: {several}{rows}x{columns} pixels, {bins} bins of {self.bin_width_ps:g} ps>"


@takes(LoadOptions)
def load(path: Any, **options: Unpack[LoadOptions]) -> Recording:
    """Reads a recording of any format that ``dtof replay`` reads; photon lists become histograms.

    Without ``cycles`` the whole photon list is read. The number of bins is that of
    a run: a power of two from 8 to 1024.
    """
    source = recording_input(path, options)
    loaded = _native.load(source, arguments(LoadOptions, options))
    warn(loaded["warnings"])
    shape = loaded["shape"]
    truth = loaded["truth_mm"]
    if truth is not None:
        truth = numpy.array(truth, dtype=float).reshape(shape[:3])
    return Recording(
        counts=numpy.frombuffer(loaded["counts"], dtype="<u8").reshape(shape),
        bin_width_ps=loaded["bin_width_ps"],
        offset_mm=loaded["offset_mm"],
        gate=loaded["gate"],
        truth_mm=truth,
        cycles=loaded["cycles"],
        cut_off=loaded["cut_off"],
        notes=dict(loaded["notes"]),
    )


def read_events(path: Any) -> tuple[numpy.ndarray, Array]:
    """Reads the depth events of an AER file (:data:`dtof.EVENT`), and their array of pixels.

    Raises :class:`dtof.Error` with the position of the byte if the file is damaged.
    """
    records, array = _native.read_events(os.fspath(path))
    return events_of(records), array_of(array)


def write_events(path: Any, events: Any, array: Array) -> None:
    """Writes events as an AER file, completely or not at all.

    ``range_mm`` is not written: it follows from ``depth_bins`` and ``array``. Raises
    :class:`dtof.Error` if an event is impossible for ``array``.
    """
    _native.write_events(os.fspath(path), records_of(events), array)


@takes(PointsOptions)
def export(
    path: Any, events: Any, array: Array, format: Optional[str] = None, **options: Unpack[PointsOptions]
) -> None:
    """Writes events as ``dtof export`` does, completely or not at all.

    ``format`` is csv, pcd, ply, mcap, ros2 or evt2, by default the extension of ``path``. Events are in the
    order of their laser cycles. With ``one_per_pixel`` it is the depth map, a point a pixel.
    """
    export_for(path, events, array, format, options)


def export_for(path: Any, events: Any, array: Array, format: Optional[str], options: Any) -> None:
    """:func:`export` for a function that the user calls. Warnings name the line that called that."""
    name = os.fspath(path)
    format = os.path.splitext(name)[1][1:].lower() if format is None else format
    warnings = _native.export(name, format, records_of(events), array, arguments(PointsOptions, options))
    warn(warnings, callers=3)
