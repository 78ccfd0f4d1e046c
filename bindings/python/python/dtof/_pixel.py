"""One pixel, step by step."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Optional

import numpy

from . import _native
from ._arrays import events_of
from ._keywords import PixelOptions, takes
from ._options import arguments

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Pixel:
    """One pixel as in the firmware, for inspection while it decides.

    Options are the settings of pixels.
    With ``once_per_bin=True``, photons of one laser cycle in one bin count once.

    >>> pixel = Pixel(l1=40, l2=2000, x=4)
    >>> for cycle in range(44):
    ...     pixel.count(60)
    ...     event = pixel.end_laser_cycles()
    >>> float(event["depth_bins"]), pixel.exposure
    (60.5, 0)
    """

    @takes(PixelOptions)
    def __init__(self, *, bins: int = 128, address: int = 0, **options: Unpack[PixelOptions]) -> None:
        for name, value, most in (("bins", bins, 1024), ("address", address, 65535)):
            whole(name, value, most)
        self._native = _native.Pixel(int(bins), int(address), arguments(PixelOptions, options))

    def count(self, bin: Any) -> None:
        """Counts a photon in ``bin``, or one in each of several bins. Bins past the last are rejected.
        All photons up to the next :meth:`end_laser_cycles` are of one laser cycle."""
        bins = numpy.atleast_1d(numpy.asarray(bin))
        if bins.size == 0:
            return
        if bins.dtype.kind not in "iu" or bins.ndim > 1:
            raise _native.Error(f"bin: {bins.dtype} with {bins.ndim} axes: must be integers with one")
        if bins.min() < 0 or bins.max() > 65535:
            raise _native.Error("bin: must be from 0 to 65535")
        self._native.count(bins.tolist())

    def end_laser_cycles(self, cycles: int = 1) -> Optional[numpy.void]:
        """Ends ``cycles`` laser cycles (1 to 65,535), and looks once if X have passed since the last
        look. Returns the event, a record of :data:`dtof.EVENT`, or None.

        With ``once_per_bin=True``, all photons since the last call are of one laser cycle, even if
        ``cycles`` is more than 1."""
        record = self._native.end_laser_cycles(whole("cycles", cycles, 65535))
        return None if record is None else events_of(record)[0]

    @property
    def histogram(self) -> numpy.ndarray:
        """The photons of each bin since the exposure began."""
        return numpy.array(self._native.counts(), dtype=numpy.uint32)

    @property
    def exposure(self) -> int:
        """Laser cycles since the histogram was cleared."""
        return self._native.exposure

    @property
    def cycle(self) -> int:
        """Laser cycles that have ended."""
        return self._native.cycle

    @property
    def statistics(self) -> dict[str, int]:
        """Counters of photons by their fate, of events, of expired exposures, and of what a dead time
        hides: exposures that a full counter ended, and decisions without bins hardly ever live.
        With ``once_per_bin=True``, ``repeated`` counts the photons of a laser cycle after the first of
        their bin."""
        return dict(self._native.statistics())

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the pixel, as in a settings file."""
        settings: dict[str, Any] = json.loads(self._native.settings)
        return settings


def whole(name: str, value: Any, most: int) -> int:
    is_whole = isinstance(value, (int, numpy.integer)) and not isinstance(value, bool)
    if not is_whole or not 0 <= value <= most:
        raise _native.Error(f"{name} {value!r}: must be a whole number from 0 to {most}")
    return int(value)
