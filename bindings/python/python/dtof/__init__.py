"""Depth events from single photons.

Photons or histograms of a single-photon (SPAD) LiDAR become depth events, with the integer
arithmetic of a microcontroller or an FPGA. Arrays are numpy arrays; settings are keyword
arguments with the names of the command line.

>>> import dtof, numpy
>>> counts = numpy.random.default_rng(1).poisson(0.2, size=(8, 8, 128))
>>> counts[..., 60] += 50
>>> events = dtof.replay(counts, bin_width_ps=250).events
>>> bool(abs(numpy.median(events["range_mm"]) - 2267) < 20)
True
"""

from ._arrays import EVENT, POINT, Array
from ._files import Recording, export, load, read_events, write_events
from ._find import Calibration, Comparison, calibrate, compare, tune
from ._maps import depth_map, points, reflectivity
from ._native import Error, __version__
from ._pixel import Pixel
from ._pixels import Pixels
from ._run import Replay, photons, replay, simulate
from ._view import View, view

__all__ = [
    "EVENT",
    "POINT",
    "Array",
    "Calibration",
    "Comparison",
    "Error",
    "Pixel",
    "Pixels",
    "Recording",
    "Replay",
    "View",
    "__version__",
    "calibrate",
    "compare",
    "depth_map",
    "export",
    "load",
    "photons",
    "points",
    "read_events",
    "reflectivity",
    "replay",
    "simulate",
    "tune",
    "view",
    "write_events",
]
