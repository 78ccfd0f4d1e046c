"""An array of pixels, laser cycle by laser cycle."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy

from . import _native
from ._arrays import Array, array_of, events_of, integers
from ._keywords import PixelOptions, takes
from ._options import arguments
from ._pixel import whole

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Pixels:
    """An array of pixels that receives photons while they arrive.

    Its events are those of :func:`dtof.photons` on the same photons. ``bins`` is a power of two from 8 to 1024.
    ``keep_histograms`` keeps the histogram of the last event of each pixel, for :meth:`histogram`; it takes as
    much memory as the pixels: 2 bytes a bin.

    >>> pixels = Pixels(2, 2, l1=40, l2=2000, x=4)
    >>> for cycle in range(44):
    ...     events = pixels.cycle([0, 3], [60, 61])
    >>> events["pixel"].tolist(), events["peak_bin"].tolist()
    ([0, 3], [60, 61])
    """

    @takes(PixelOptions)
    def __init__(
        self,
        rows: int,
        columns: int,
        bins: int = 128,
        *,
        keep_histograms: bool = False,
        **options: Unpack[PixelOptions],
    ) -> None:
        rows, columns = whole("rows", rows, 65536), whole("columns", columns, 65536)
        keywords = arguments(PixelOptions, options)
        self._native = _native.Pixels(rows, columns, whole("bins", bins, 1024), bool(keep_histograms), keywords)

    def cycle(self, pixel: Any = (), bin: Any = (), cycles: int = 1) -> numpy.ndarray:
        """Runs a laser cycle with these photons; returns its events, an array of :data:`dtof.EVENT`.

        ``pixel`` (row × columns + column) and ``bin`` are integers from 0, one per photon. With ``cycles`` of 1 to
        65,535, laser cycles without photons follow.
        """
        pixels, bins = _numbers("pixel", pixel), _numbers("bin", bin)
        if pixels.size != bins.size:
            raise _native.Error(f"pixel and bin: {pixels.size} and {bins.size}: must be as long as each other")
        cycles = whole("cycles", cycles, 65535)
        if cycles == 0:
            raise _native.Error("cycles 0: must be at least 1")
        return events_of(self._native.cycle(pixels.tobytes(), bins.tobytes(), cycles))

    def histogram(self, event: Any) -> numpy.ndarray:
        """The photons of each bin from which ``event`` was decided, if it is the last of its pixel or block."""
        pixel, level, cycle, echo = (int(event[name]) for name in ("pixel", "level", "cycle", "echo"))
        return numpy.frombuffer(self._native.histogram(pixel, level, cycle, echo), dtype="<u4")

    @property
    def cycles(self) -> int:
        """Laser cycles that have ended."""
        return self._native.cycles

    @property
    def array(self) -> Array:
        """The array, for :func:`dtof.depth_map` and files."""
        return array_of(self._native.array)

    @property
    def statistics(self) -> dict[str, Any]:
        """The contents of ``summary.json`` so far."""
        statistics: dict[str, Any] = json.loads(self._native.summary())
        return statistics

    @property
    def settings(self) -> dict[str, Any]:
        """The settings, as in a settings file."""
        settings: dict[str, Any] = json.loads(self._native.settings_json)
        return settings

    @property
    def toml(self) -> str:
        """The same as the text of a settings file."""
        return self._native.toml

    def __repr__(self) -> str:
        rows, columns = self.array.shape
        return f"<dtof.Pixels: {rows}x{columns} pixels after {self.cycles} laser cycles>"


def _numbers(name: str, values: Any) -> numpy.ndarray:
    array = numpy.atleast_1d(integers(name, values))
    if array.size and (array.min() < 0 or array.max() > 65535):
        raise _native.Error(f"{name}: must be from 0 to 65535")
    return array.astype("<u2")
