"""Maps of events per pixel, and events as points in space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy

from . import _native
from ._arrays import POINT, Array, records_of
from ._keywords import Echo, PointsOptions, takes
from ._options import arguments

if TYPE_CHECKING:
    from typing_extensions import Unpack


def depth_map(events: Any, array: Array, *, mean: bool = True, echo: Echo = "strongest") -> numpy.ndarray:
    """The depth of each pixel in millimetres, rows by columns; NaN without an event.

    It is that of ``depth-events.npy``: the mean of those of the last ten events that lie on one surface, where most of
    them lie. An event of a block counts for pixels that have never reported by themselves or in a smaller block.
    With ``mean=False`` it is the range of the last event, also of a block if the pixel has not reported since.
    ``echo`` selects the echo of each exposure: ``"first"``, ``"last"``, ``"strongest"`` or ``"all"``.
    """
    maps = _native.maps(records_of(events), array, arguments(PointsOptions, {"echo": echo}))
    return numpy.array(maps["mean_mm" if mean else "last_mm"]).reshape(array.shape)


def reflectivity(events: Any, array: Array, *, of: str = "signal", echo: Echo = "strongest") -> numpy.ndarray:
    """The relative reflectivity of surfaces, rows by columns; NaN without an event.

    ``of="signal"`` uses the signal photons per laser cycle, ``of="events"`` the number of events as
    in the paper, both multiplied by the squared mean range.
    """
    if of not in ("signal", "events"):
        raise _native.Error(f'of {of!r}: must be "signal" or "events"')
    maps = _native.maps(records_of(events), array, arguments(PointsOptions, {"echo": echo}))
    return numpy.array(maps[f"reflectivity_of_{of}"]).reshape(array.shape)


@takes(PointsOptions)
def points(events: Any, array: Array, **options: Unpack[PointsOptions]) -> numpy.ndarray:
    """Events as points: an array of :data:`dtof.POINT`, x, y and z in metres, t_ns in nanoseconds.

    The records are those of ``dtof export --format pcd``. ``fov=(horizontal, vertical)`` is in
    degrees (default 60 across the longer side), ``calibration`` is a file with a ray for each
    pixel, ``laser_hz`` the laser rate in hertz (default that of ``array``, or 10 MHz), ``echo``
    selects the echo of each exposure (default ``"all"``), ``one_per_pixel=True`` gives the depth map.
    """
    keywords = arguments(PointsOptions, options)
    return numpy.frombuffer(_native.points(records_of(events), array, keywords), dtype=POINT)
