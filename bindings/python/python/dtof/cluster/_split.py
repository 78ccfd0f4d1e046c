"""Splits a recording at rows, which are contiguous in the address space."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any, Optional

import dask.array
import numpy
from distributed import Client

from .. import _native
from ._worker import begin

#: Rows of the largest blocks of pixels.
_SIDE = 8
#: Parts of a file for each thread of the workers.
_PARTS = 3
_NAMES = ("captures", "rows", "columns", "bins")


@dataclass(frozen=True)
class Part:
    """A range of rows. ``row`` is the first, ``block`` has their histograms."""

    name: str
    row: int
    block: Any


@dataclass(frozen=True)
class Split:
    """A recording in parts. ``rows`` is the total over all captures."""

    rows: int
    columns: int
    captures: int
    parts: list[Part]


def _axes(shape: tuple[int, ...], axes: Any, name: str) -> list[str]:
    """The names of the axes; by default rows, columns and bins."""
    if axes is None:
        if len(shape) < 3:
            raise _native.Error(f"{name}: {len(shape)} axes: must be rows, columns and bins")
        return ["rows"] * (len(shape) - 2) + ["columns", "bins"]
    names = [part.strip() for part in (axes.split(",") if isinstance(axes, str) else axes)]
    if len(names) != len(shape) or len(set(names)) != len(names) or set(names) - set(_NAMES):
        raise _native.Error(
            f"{name}: axes {','.join(names)} of {len(shape)} axes: must be some of "
            "captures, rows, columns and bins, one for each"
        )
    if "bins" not in names or not {"captures", "rows"} & set(names):
        raise _native.Error(f"{name}: axes {','.join(names)}: bins, and rows or captures are needed")
    return names


def _outer(names: list[str]) -> list[int]:
    """The axes that form rows, the slowest first."""
    outer = [axis for axis, name in enumerate(names) if name in ("captures", "rows")]
    return sorted(outer, key=lambda axis: names[axis] != "captures")


def split(array: Any, axes: Any, name: str) -> Split:
    """The chunks of a dask array as parts.

    Raises :class:`dtof.Error` if a chunk is not a range of rows.
    """
    if not isinstance(array, dask.array.Array):
        kind = type(array).__name__
        raise _native.Error(f"{name}: {kind}: must be a dask array, or the name of an .npy file")
    if any(math.isnan(length) for length in array.shape):
        raise _native.Error(f"{name}: the lengths of its chunks are not known: call compute_chunk_sizes()")
    if array.size == 0:
        raise _native.Error(f"{name}: an array of {array.shape} is empty")
    names = _axes(array.shape, axes, name)
    outer = _outer(names)
    for axis, axis_name in enumerate(names):
        if axis not in outer and array.numblocks[axis] > 1:
            raise _native.Error(f"{name}: chunks split the {axis_name}: .rechunk({{{axis}: -1}}) makes them whole")
    lengths = [array.shape[axis] for axis in outer]
    blocks = array.to_delayed()
    parts = []
    for place in itertools.product(*(range(array.numblocks[axis]) for axis in outer)):
        chunks = [array.chunks[axis] for axis in outer]
        begin = [sum(chunk[:at]) for chunk, at in zip(chunks, place)]
        extent = [chunk[at] for chunk, at in zip(chunks, place)]
        index, slices = [0] * array.ndim, [":"] * array.ndim
        for axis, at, first, length in zip(outer, place, begin, extent):
            index[axis], slices[axis] = at, f"{first}:{first + length}"
        of_part = f"{name}[{', '.join(slices)}]"
        more = next((at for at, length in enumerate(extent) if length > 1), len(extent))
        if extent[more + 1 :] != lengths[more + 1 :]:
            raise _native.Error(
                f"{of_part}: parts of several captures: .rechunk({{{outer[0]}: 1}}) makes chunks of one each"
            )
        row = 0
        for length, first in zip(lengths, begin):
            row = row * length + first
        if math.prod(extent):
            parts.append(Part(of_part, row, blocks[tuple(index)]))
    return Split(
        rows=math.prod(lengths),
        columns=array.shape[names.index("columns")] if "columns" in names else 1,
        captures=array.shape[names.index("captures")] if "captures" in names else 1,
        parts=sorted(parts, key=lambda part: part.row),
    )


def blocks_of_file(client: Client, version: str, path: str, axes: Any, rows: Optional[int]) -> dask.array.Array:
    """An ``.npy`` file as a dask array; workers read its chunks."""
    shape, dtype = client.submit(_header, version, path, pure=False).result()
    if rows is not None and (isinstance(rows, bool) or not isinstance(rows, int) or rows < 1):
        raise _native.Error(f"rows {rows!r}: must be a whole number from 1")
    names = _axes(shape, axes, path)
    outer = _outer(names)
    # One of several captures or rows.
    axis = next((axis for axis in outer if shape[axis] > 1), outer[-1])
    if rows is None:
        threads = sum(client.nthreads().values()) or 1
        rows = math.ceil(shape[axis] / (_PARTS * threads))
        rows = rows if names[axis] == "captures" else _SIDE * math.ceil(rows / _SIDE)
    chunks = tuple(rows if at == axis else length for at, length in enumerate(shape))
    chunks = dask.array.core.normalize_chunks(chunks, shape)
    empty = numpy.empty((0,) * len(shape), dtype)
    blocks: dask.array.Array = dask.array.map_blocks(_block, version, path, chunks=chunks, dtype=dtype, meta=empty)
    return blocks


def _opened(path: str) -> numpy.ndarray:
    """The array of a file, memory-mapped."""
    try:
        array = numpy.load(path, mmap_mode="r", allow_pickle=False)
    except OSError as error:
        raise _native.Error(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise _native.Error(f"{path}: not an .npy array: {' '.join(str(error).split())}") from error
    if not isinstance(array, numpy.ndarray):
        raise _native.Error(f"{path}: an archive: save its array with numpy.save")
    if array.dtype.names is not None:
        raise _native.Error(f"{path}: holds photons: only histograms are replayed in parts")
    return array


def _header(version: str, path: str) -> tuple[tuple[int, ...], numpy.dtype]:
    begin(version)
    array = _opened(path)
    return array.shape, array.dtype


def _block(version: str, path: str, block_info: Any = None) -> numpy.ndarray:
    begin(version)
    location = block_info[None]["array-location"]
    return numpy.asarray(_opened(path)[tuple(slice(*ends) for ends in location)])
