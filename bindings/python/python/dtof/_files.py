"""Recordings and events in files."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, Optional

import numpy

from . import _native
from ._arrays import Array, events_of, records_of, recording
from ._options import arguments
from ._run import warn


@dataclass(frozen=True)
class Recording:
    """Histograms of a recording.

    ``counts`` has captures, rows, columns and bins, photons of 64 bits. ``bin_width_ps`` is in
    picoseconds, ``offset_mm`` in millimetres where the format says it. ``gate`` is the first and
    the last bin that were measured in full, None for all. ``truth_mm`` is the true distance of
    each pixel, captures by rows by columns and NaN without, None if the file has none. ``cycles``
    are the laser cycles of a photon list. ``cut_off`` counts photons in bins that were cut off,
    ``notes`` says what else was done.
    """

    counts: numpy.ndarray
    bin_width_ps: float
    offset_mm: Optional[float]
    gate: Optional[tuple[int, int]]
    truth_mm: Optional[numpy.ndarray]
    cycles: Optional[int]
    cut_off: int
    notes: dict[str, str]


def load(path: Any, **options: Any) -> Recording:
    """Reads a recording of any format that ``dtof replay`` reads; photon lists are summed up.

    ``axes``, ``array``, ``columns``, ``rebin``, ``bins`` and ``bin_width_ps`` are those of
    :func:`replay`; without ``cycles`` all of a photon list is read. There are as many bins as a run
    has: a power of two from 8 to 1024.
    """
    loaded = _native.load(recording(path, "the array"), arguments(options))
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
    """The depth events of an AER file, of :data:`dtof.EVENT`, and the array they come from.

    A damaged file is an error that names the byte.
    """
    records, array = _native.read_events(os.fspath(path))
    return events_of(records), Array(**array)


def write_events(path: Any, events: Any, array: Array) -> None:
    """Writes events as an AER file, whole or not at all.

    ``range_mm`` is not written: it follows from ``depth_bins`` and ``array``. An event that
    ``array`` cannot have sent is an error that names it.
    """
    _native.write_events(os.fspath(path), records_of(events), array)
