"""What events say of each pixel, and where they are in space."""

from __future__ import annotations

from typing import Any

import numpy

from . import _native
from ._arrays import POINT, Array, records_of
from ._options import arguments


def depth_map(
    events: Any, array: Array, *, mean: bool = False, echo: str = "strongest"
) -> numpy.ndarray:
    """The range of the last event of each pixel in millimetres, rows by columns; NaN without one.

    With ``mean`` it is the mean of the last ten. An event of a block holds for those of its pixels
    that have not reported since. ``echo`` is the one of each exposure that counts: ``"first"``,
    ``"last"``, ``"strongest"`` or ``"all"``.
    """
    maps = _native.maps(records_of(events), array, arguments({"echo": echo}))
    return numpy.array(maps["mean_mm" if mean else "last_mm"]).reshape(array.shape)


def reflectivity(
    events: Any, array: Array, *, of: str = "signal", echo: str = "strongest"
) -> numpy.ndarray:
    """How bright surfaces are against each other, rows by columns; NaN without an event.

    ``of="signal"`` takes the signal photons a laser cycle, ``of="events"`` the number of events as
    the paper does, both times the squared mean range.
    """
    if of not in ("signal", "events"):
        raise _native.Error(f'of {of!r}: must be "signal" or "events"')
    maps = _native.maps(records_of(events), array, arguments({"echo": echo}))
    return numpy.array(maps[f"reflectivity_of_{of}"]).reshape(array.shape)


def points(events: Any, array: Array, **options: Any) -> numpy.ndarray:
    """Events as points: an array of :data:`dtof.POINT`, x, y and z in metres, t_ns in nanoseconds.

    The records are those of ``dtof export --format pcd``. ``fov=(horizontal, vertical)`` is in
    degrees (60 across the longer side), ``calibration`` a file with a ray for each pixel,
    ``laser_hz`` the laser cycles a second (those of ``array``, or 10 MHz), ``echo`` the one of each
    exposure (``"all"``).
    """
    given = arguments(options)
    return numpy.frombuffer(_native.points(records_of(events), array, given), dtype=POINT)
