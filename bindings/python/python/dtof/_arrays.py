"""Conversion of arrays for the native extension, and of its results."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from typing import Any, NamedTuple, Optional, Union

import numpy

from ._native import Error

# The C layout, spelt out: alignment differs between machines.
EVENT = numpy.dtype(
    {
        "names": [
            "cycle",
            "pixel",
            "exposure",
            "peak_bin",
            "depth_bins",
            "range_mm",
            "peak_count",
            "background",
            "flags",
            "level",
            "echo",
        ],
        "formats": ["<i8", "<u2", "<u2", "<u2", "<f4", "<f8", "<u4", "<u4", "u1", "u1", "u1"],
        "offsets": [0, 8, 10, 12, 16, 24, 32, 36, 40, 41, 42],
        "itemsize": 48,
    }
)

POINT = numpy.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "<f4"),
        ("pixel", "<u4"),
        ("flags", "u1"),
        ("level", "u1"),
        ("echo", "u1"),
        ("t_ns", "<f8"),
    ]
)

#: The fields of a photon.
PHOTON = ("pixel", "cycle", "bin")

#: The names of dimensions, and the axes that they are.
_AXES = {
    "capture": "captures",
    "captures": "captures",
    "frame": "captures",
    "frames": "captures",
    "time": "captures",
    "row": "rows",
    "rows": "rows",
    "y": "rows",
    "column": "columns",
    "columns": "columns",
    "col": "columns",
    "x": "columns",
    "bin": "bins",
    "bins": "bins",
}

#: A file name, or the name, the .npy header and the data of an array.
Input = Union[str, "tuple[str, bytes, bytes]"]


class Array(NamedTuple):
    """The array of pixels that events come from, as in the header of an AER file.

    ``bin_width_ps`` is in picoseconds, a multiple of 1/65536. ``offset_mm`` is in millimetres, a
    multiple of 1/256, and added to every range. ``laser_millihertz`` is the number of laser
    cycles in 1000 seconds. ``start_us`` is the time of laser cycle 0, in microseconds since
    1970-01-01 UTC. Both are 0 if unknown. ``offsets_mm`` are added to ``offset_mm`` for each pixel, None for one
    that is left out; as a whole None if they are 0.
    """

    bins: int
    rows: int
    columns: int
    bin_width_ps: float
    offset_mm: float
    laser_millihertz: int = 0
    start_us: int = 0
    offsets_mm: Optional[Sequence[Optional[float]]] = None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows, self.columns


def array_of(fields: dict[str, Any]) -> Array:
    """The array of pixels that the native extension gives."""
    offsets = fields.pop("offsets_mm")
    return Array(**fields, offsets_mm=None if offsets is None else tuple(offsets))


def native_input(value: Any, name: str) -> Input:
    """A file or an array for the native extension. Errors call it ``name``."""
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    value = _array_of(value, name)
    if isinstance(value, numpy.ma.MaskedArray):
        raise Error(f"{name}: a masked array; fill it first, as with .filled(0)")
    try:
        array = numpy.asarray(value)
    except (TypeError, ValueError) as error:
        raise Error(f"{name}: not an array: {_line(error)}") from error
    if array.dtype.hasobject:
        raise Error(f"{name}: the elements are Python objects: must be numbers; convert them, as with .astype(int)")
    _check_cycles(array, name)
    small = {"bool": "u1", "float16": "f4"}.get(array.dtype.name)
    if small is not None:
        array = array.astype(small)
    header = io.BytesIO()
    described = numpy.lib.format.header_data_from_array_1_0(array)
    try:
        numpy.lib.format.write_array_header_1_0(header, described)
    except ValueError as error:
        raise Error(f"{name}: {_line(error)}") from error
    data = array.tobytes("F") if described["fortran_order"] else array.tobytes("C")
    return name, header.getvalue(), data


def _check_cycles(array: numpy.ndarray, name: str) -> None:
    """Refuses laser cycles of photons that are negative numbers in an unsigned type."""
    if "cycle" not in (array.dtype.names or ()) or array["cycle"].dtype.kind != "u":
        return
    cycles = array["cycle"].ravel()
    wrapped = cycles > numpy.iinfo("i8").max
    if wrapped.any():
        record = int(wrapped.argmax())
        raise Error(
            f"{name}: record {record}: cycle {cycles[record]} is 2^63 or more: a difference of unsigned numbers "
            "probably wrapped below 0; subtract after .astype(int)"
        )


def recording_input(recorded: Any, options: Any) -> Input:
    """A recording for the native extension. Sets ``axes`` in ``options``, if its dimensions have names."""
    if options.get("axes") is None:
        options["axes"] = named_axes(recorded, "the array")
    return native_input(recorded, "the array")


def _array_of(value: Any, name: str) -> Any:
    """The array of a table of photons or a sparse matrix; anything else as it is."""
    if is_table(value):
        return photon_list(*photon_columns(value, name))
    if hasattr(value, "toarray") and hasattr(value, "nnz"):
        if len(value.shape) != 2 or value.shape[0] > 65_536 or value.shape[1] > 4096:
            raise Error(f"{name}: a sparse array of {value.shape}: must have at most 65536 pixels and 4096 bins")
        return value.toarray()
    return value


def photon_columns(photons: Any, name: str) -> list[Any]:
    """Pixel, cycle and bin of a table, or of an array with fields, in any case."""
    names = list(photons.columns if is_table(photons) else photons.dtype.names)
    columns = []
    for column in PHOTON:
        found = [one for one in names if one == column]
        found = found or [one for one in names if str(one).strip().lower() == column]
        if not found:
            there = ", ".join(map(str, names)) or "none"
            raise Error(
                f"{name}: {column} is missing: photons have the columns pixel, cycle and bin, not {_line(there)}; "
                "histograms are arrays, as from .to_numpy()"
            )
        if len(found) > 1:
            raise Error(f"{name}: {column} is there {len(found)} times: rename the others")
        columns.append(photons[found[0]])
    return columns


def is_table(value: Any) -> bool:
    """Whether ``value`` is a data frame, as of pandas."""
    return hasattr(type(value), "columns") and hasattr(value, "to_numpy")


def named_axes(value: Any, name: str) -> Optional[str]:
    """The axes of an array whose dimensions have names, as of xarray; None of other arrays."""
    if not (hasattr(value, "dims") and hasattr(value, "to_numpy")):
        return None
    axes = [_AXES.get(str(dim).lower()) for dim in value.dims]
    names = [axis for axis in axes if axis is not None]
    if len(names) < len(axes) or len(set(names)) < len(names) or "bins" not in names:
        dims = ", ".join(map(str, value.dims))
        why = "must be some of captures, rows, columns and bins, each once"
        if len(names) == len(axes) and "bins" not in names:
            why = f"none is bins, as they are read as {', '.join(names)}"
        raise Error(f"{name}: the dimensions {dims}: {why}; rename them with .rename, or give axes")
    # One axis of pixels is rows.
    return ",".join(
        "rows" if axis == "columns" and "rows" not in names and "captures" not in names else axis for axis in names
    )


def photon_list(pixel: Any, cycle: Any, bin: Any) -> numpy.ndarray:
    """A photon list with the smallest possible types."""
    columns = {"pixel": pixel, "cycle": cycle, "bin": bin}
    columns = {name: integers(f"photons: {name}", values) for name, values in columns.items()}
    lengths = {values.size for values in columns.values() if values.ndim == 1}
    if len(lengths) != 1:
        shapes = ", ".join(f"{name} {values.shape}" for name, values in columns.items())
        raise Error(f"photons: must be as long as each other and have one axis: {shapes}")
    fields = [(name, _smallest(values)) for name, values in columns.items()]
    photons = numpy.empty(lengths.pop(), dtype=fields)
    for name, values in columns.items():
        photons[name] = values
    return photons


def integers(name: str, values: Any) -> numpy.ndarray:
    """One number, or an array of integers with one axis."""
    if isinstance(values, numpy.ma.MaskedArray):
        raise Error(f"{name} is a masked array; leave the masked photons out first")
    try:
        array = numpy.asarray(values)
    except (TypeError, ValueError, OverflowError) as error:
        raise Error(f"{name} is not an array: {_line(error)}") from error
    if array.shape == (0,):
        return array.astype("u2")
    if array.dtype.kind not in "iu" or array.ndim > 1:
        raise Error(f"{name} is {array.dtype} with {array.ndim} axes: must be integers with one")
    return array


def _smallest(values: numpy.ndarray) -> numpy.dtype:
    """The smallest type for all values. Negative or larger values keep theirs and fail later."""
    if values.size and values.min() >= 0:
        for small in ("<u2", "<u4"):
            if values.max() <= numpy.iinfo(small).max:
                return numpy.dtype(small)
    return values.dtype


def events_of(records: bytearray) -> numpy.ndarray:
    """Events from the native extension."""
    return numpy.frombuffer(records, dtype=EVENT)


def records_of(events: Any) -> bytes:
    """Events for the native extension."""
    events = numpy.asarray(events)
    if events.dtype.names is None or not set(EVENT.names or ()) <= set(events.dtype.names):
        raise Error(f"events: an array of {events.dtype}: must have the fields of dtof.EVENT")
    if events.ndim != 1:
        raise Error(f"events: an array of {events.ndim} axes: must have one")
    if events.dtype == EVENT:
        return bytes(events.tobytes())
    records = numpy.zeros(events.size, dtype=EVENT)
    for name in EVENT.names or ():
        records[name] = events[name]
        if not (records[name] == events[name]).all():
            raise Error(f"events: {name} does not fit {EVENT[name]}")
    return records.tobytes()


def _line(error: Any) -> str:
    return " ".join(str(error).split())
