"""The keywords of every function, with the help of the program: kind and range, then text and default.

``None`` is the same as a keyword that is not given.
"""

from __future__ import annotations

import inspect
import os
import textwrap
from collections.abc import Iterable, Mapping
from typing import (
    Annotated,
    Any,
    Callable,
    Literal,
    Optional,
    Protocol,
    TypedDict,
    TypeVar,
    Union,
    get_args,
    get_type_hints,
)

import numpy

Integer = Union[int, numpy.integer, None]
Number = Union[float, numpy.floating, numpy.integer, None]
Switch = Union[bool, numpy.bool_, None]
Text = Optional[str]
Path = Union[str, os.PathLike[str], None]
#: Lists may be texts, as on the command line.
Names = Union[str, Iterable[str], None]
Integers = Union[str, Iterable[int], None]
Numbers = Union[str, Iterable[float], None]
Rule = Optional[Literal["paper", "average", "window"]]
Estimator = Optional[Literal["centroid", "window"]]
Echo = Optional[Literal["first", "last", "strongest", "all"]]

#: Keywords of several functions.
BinWidth = Annotated[
    Number,
    "number, 0 to 65535.99998, picoseconds",
    "Width of a bin of the file in picoseconds, rounded to 1/65536 [default: 250; for logs the sensor's]",
]
Offset = Annotated[
    Number,
    "number, -8388608 to 8388607.996, millimetres",
    "Millimetres added to every range, rounded to 1/256 [default: 0; for logs the sensor's]",
]
Offsets = Annotated[
    Numbers,
    "numbers, one a pixel, millimetres",
    "Millimetres added to offset_mm for each pixel, in the order of the addresses, rounded to 1/256 [default: 0]",
]
CyclesToReplay = Annotated[
    Integer,
    "whole number, 1 to 9223372036854775807",
    "Laser cycles to replay at most [default: all of a photon list and with decide_once, else 10000]",
]
Frame = Annotated[
    Integer,
    "whole number, 1 to 65535",
    "Simulate a frame-based sensor for comparison: every N laser cycles each pixel reports its "
    "highest bin, if that is above the background",
]
DecideOnce = Annotated[
    Switch,
    "True or False",
    "Events are the decisions of depth.npy, one a pixel on all of its photons, instead of asynchronous ones. "
    "Takes all laser cycles unless cycles says less",
]
DeadTime = Annotated[
    Integer,
    "whole number, 0 to 65535, bins",
    "Bins for which the TDC is blind after a photon, 0 to 65535. With all bins of a histogram it "
    "takes the first photon of a laser cycle only. Fewer are for the window rule without binning "
    "[default: the sensor's, else 0]",
]
Glass = Annotated[
    Switch,
    "True or False",
    "Whether the nearest surface that most pixels see is a cover glass, which the gate then leaves out [default: if all "
    "pixels have it at one place and half of them see something behind it]",
]
FalseAlarm = Annotated[
    Number,
    "number above 0",
    "Share of exposures without a target that end with an event, at most 0.1 [default: 0.01]",
]


class HasSettings(Protocol):
    """A calibration, a comparison or a run."""

    @property
    def toml(self) -> Optional[str]: ...


Settings = Union[str, os.PathLike[str], Mapping[str, Any], HasSettings, None]


class RecordingOptions(TypedDict, total=False):
    """How a recording is read."""

    axes: Annotated[
        Names,
        "names of axes",
        "Arrays of histograms: meaning of each axis: captures, rows, columns or bins [default: the last "
        "is bins, the one before columns, all others are rows]",
    ]
    array: Annotated[Text, "text", ".npz: name of the array [default: the only one]"]
    capture: Annotated[
        Integer,
        "whole number, 0 to 65535",
        "Arrays with captures, and logs: the capture or frame to use, counted from 0 [default: all]",
    ]
    columns: Annotated[
        Integer,
        "whole number, 1 to 65536",
        "Photon lists: columns of the array, pixel = row × columns + column [default: one row]",
    ]
    rebin: Annotated[Integer, "whole number, 1 to 512", "Number of neighbouring bins to add up [default: 1]"]
    bins: Annotated[
        Integer,
        "whole number",
        "Number of bins after rebin, a power of two from 8 to 1024. Longer histograms lose their last "
        "bins [default: the file's, or the next power of two; 128 for photon lists]",
    ]
    bin_width_ps: BinWidth
    offset_mm: Offset
    offsets_mm: Offsets
    photons_per_cycle: Annotated[
        Number,
        "number above 0",
        "Histograms: photons a laser cycle in the brightest unmasked pixel of each capture [default: 1]",
    ]
    recorded_cycles: Annotated[
        Integer,
        "whole number, 1 to 9223372036854775807",
        "Histograms: laser cycles of each capture",
    ]
    laser_hz: Annotated[Integer, "whole number, hertz", "Laser cycles a second [default: unknown]"]


class SensorOptions(TypedDict, total=False):
    """A sensor."""

    settings: Annotated[
        Settings,
        "file, text of several lines, dict of sections, or a result with settings",
        "Settings file in TOML, such as every run writes; options override it. docs/settings.md lists its keys",
    ]
    gate: Annotated[
        Integers,
        "two bins, (20, 119)",
        "First and last bin that may hold the peak, as 20..119 [default: all bins]",
    ]
    mask: Annotated[
        Integers,
        "addresses, [3, 70], or 'none'; [] adds none",
        "Pixels to leave out, such as hot and dead ones, as 3,70, beside those that are found; none leaves out none",
    ]
    sigma_bins: Annotated[
        Number,
        "number above 0, bins",
        "Standard deviation of the pulse in bins, at most 1.75, rounded to 1/256. It sets the window for "
        "the depth [default: the depth is the centroid of three bins]",
    ]
    dead_time: DeadTime


class DetectionOptions(TypedDict, total=False):
    """How pixels decide."""

    rule: Annotated[
        Rule,
        "paper, average or window",
        "Detection rule, which decides whether a peak is a target [default: paper]",
    ]
    alpha: Annotated[
        Number,
        "number, 0 to 255.996",
        "Rules paper and average: threshold above the background in its standard deviations, 0 to "
        "255.996, rounded to 1/256 [default: 4]",
    ]
    window: Annotated[
        Integer,
        "whole number, 1 to 7, bins",
        "Window rule: bins in the window, 1 to 7 [default: from sigma_bins]",
    ]
    z: Annotated[
        Number,
        "number, 0 to 15.9998",
        "Window rule: threshold of the photons in the window above the background in its standard "
        "deviations, 0 to 15.9998, rounded to 1/4096 [default: from false_alarm]",
    ]
    false_alarm: Annotated[
        Number,
        "number above 0",
        "Window rule, instead of z: share of exposures without a target that end with an event, at most "
        "0.1 [default: 0.01]",
    ]
    estimator: Annotated[
        Estimator,
        "centroid or window",
        "Estimator of the position of a peak [default: window with sigma_bins or half_widths, else centroid]",
    ]
    half_widths: Annotated[
        Numbers,
        "two numbers, (1.75, 4)",
        "Estimator window: bins before and after its centre, 1 to 4 each, rounded to 1/256. A longer part "
        "after suits a pulse that falls more slowly than it rises [default: from sigma_bins]",
    ]
    min_count: Annotated[
        Integer,
        "whole number, 1 to 1023",
        "Fewest photons in a reported peak, or in the window around it [default: 5]",
    ]
    l1: Annotated[
        Integer,
        "whole number, 0 to 65535",
        "Shortest exposure: pixels decide after more than N laser cycles [default: 40]",
    ]
    l2: Annotated[
        Integer,
        "whole number, 0 to 65535",
        "Longest exposure: a pixel without an event starts over after N laser cycles [default: 2000]",
    ]
    x: Annotated[Integer, "whole number, 0 to 65535", "Laser cycles between two decisions [default: 4]"]
    binning: Annotated[
        Integer,
        "whole number, 0 to 3",
        "Levels of adaptive binning, 0 to 3: pixels without events also count in blocks, at level 1 of "
        "2x2 pixels, at 2 of 4x4 and at 3 of 8x8 [default: 0]",
    ]
    patience: Annotated[
        Integer,
        "whole number, 1 to 65535",
        "Adaptive binning: laser cycles without an event after which a pixel also counts in its block [default: 64]",
    ]
    neighbours: Annotated[
        Integer,
        "0, 4 or 8",
        "Window rule: the 4 or 8 pixels around a pixel confirm what is not enough by itself. For arrays, "
        "without binning [default: 0]",
    ]
    tracking: Annotated[
        Switch,
        "True or False",
        "Window rule: expect the next event of a pixel near its last, with a lower threshold there and a "
        "higher one elsewhere",
    ]
    echoes: Annotated[
        Integer,
        "whole number, 1 to 4",
        "Most echoes of a pixel in an exposure, 1 to 4. With 2 or more the exposure goes on until all are "
        "found or echo_wait ends it [default: 1]",
    ]
    echo_wait: Annotated[
        Integer,
        "whole number, 2 to 254",
        "Two or more echoes: an exposure ends at this multiple of its length at the last echo [default: it ends at L2]",
    ]
    once_per_bin: Annotated[
        Switch,
        "True or False",
        "Photons of one laser cycle in one bin count once, so that raindrops are no targets. For photons, "
        "not for histograms",
    ]
    counter_bits: Annotated[
        Integer,
        "8 or 10",
        "Bits of a pixel's counters, 8 or 10. With 8 an exposure ends without an event once a counter "
        "passes 255. A device has one of both [default: 10]",
    ]


class LoadOptions(RecordingOptions, total=False):
    """Of ``load``."""

    settings: Annotated[
        Settings,
        "file, text of several lines, dict of sections, or a result with settings",
        "Settings file in TOML, such as every run writes; options override it. docs/settings.md lists its keys",
    ]
    cycles: CyclesToReplay


class ReplayOptions(RecordingOptions, SensorOptions, DetectionOptions, total=False):
    """Of ``replay`` and ``photons``."""

    frame: Frame
    glass: Glass
    decide_once: DecideOnce
    cycles: CyclesToReplay
    seed: Annotated[
        Integer,
        "whole number, 0 to 9223372036854775807",
        "Seed of the laser cycles that recorded photons get [default: 1]",
    ]


class SimulateOptions(SensorOptions, DetectionOptions, total=False):
    """Of ``simulate``."""

    array: Annotated[Integers, "columns and rows, (64, 32)", "Macropixels of the array [default: the file's]"]
    laser_off: Annotated[
        Switch,
        "True or False",
        "Simulate without signal: photon-counts.svg is then a passive image",
    ]
    frame: Frame
    decide_once: DecideOnce
    cycles: Annotated[
        Integer,
        "whole number, 1 to 9223372036854775807",
        "Laser cycles to simulate [default: the file's]",
    ]
    seed: Annotated[
        Integer,
        "whole number, 0 to 9223372036854775807",
        "Seed of the simulated photons [default: 1]",
    ]


class CalibrateOptions(RecordingOptions, total=False):
    """Of ``calibrate``."""

    gate: Annotated[
        Integers,
        "two bins, (20, 119)",
        "First and last bin that may hold the peak, as 20..119 [default: found]",
    ]
    mask: Annotated[
        Integers,
        "addresses, [3, 70], or 'none'; [] adds none",
        "Pixels to leave out, as 3,70, beside hot and dead ones that are found; none leaves out none",
    ]
    once_per_bin: Annotated[
        Switch,
        "True or False",
        "Photons of one laser cycle in one bin count once. For photons, not for histograms",
    ]
    sigma_bins: Annotated[
        Number,
        "number above 0, bins",
        "Standard deviation of the pulse in bins, at most 1.75, rounded to 1/256 [default: measured; without "
        "a peak that is bright enough that of settings, else 1]",
    ]
    fov: Annotated[
        Numbers,
        "two numbers, (60, 40), degrees",
        "Field of view in degrees from edge to edge, so that a flat target gives the offset of each pixel "
        "[default: unknown]",
    ]
    calibration: Annotated[
        Path,
        "file",
        "Instead of fov: TOML file with a direction for each pixel; docs/export.md lists its keys",
    ]
    target_mm: Annotated[
        Number,
        "number, 0 to 1000000, millimetres",
        "Distance in millimetres of a flat target that most pixels see: with fov straight ahead, as a tape "
        "measures it, else along the ray of the median pixel",
    ]
    dead_time: DeadTime
    glass: Glass
    false_alarm: FalseAlarm
    seed: Annotated[Integer, "whole number, 0 to 9223372036854775807", "Seed of the simulation [default: 1]"]


class CompareOptions(RecordingOptions, SensorOptions, total=False):
    """Of ``compare``."""

    within: Annotated[
        Number,
        "number above 0, millimetres",
        "Largest error of 68 % of the reports in millimetres [default: that of the longest frames]",
    ]
    false_alarm: FalseAlarm
    glass: Glass
    once_per_bin: Annotated[
        Switch,
        "True or False",
        "Also try photons of one laser cycle in one bin that count once. For photons, not for histograms",
    ]
    cycles: Annotated[
        Integer,
        "whole number, 1 to 9223372036854775807",
        "Laser cycles to use at most [default: 10000 of a recording; the scene's]",
    ]
    seed: Annotated[
        Integer,
        "whole number, 0 to 9223372036854775807",
        "Seed of every random number [default: 1]",
    ]


class TuneOptions(TypedDict, total=False):
    """Of ``tune``."""

    rule: Annotated[Rule, "paper, average or window", "Detection rule to tune [default: paper]"]
    background: Annotated[Number, "number above 0", "Background photons a bin and laser cycle (B)"]
    signal: Annotated[Number, "number above 0", "Signal photons a laser cycle (A)"]
    snr: Annotated[
        Number,
        "number above 0",
        "Instead of signal: SNR of the longest exposure, N·A / √(N·B) with N = L2",
    ]
    sigma_bins: Annotated[Number, "number above 0, bins", "Standard deviation of the pulse in bins"]
    sigma_ps: Annotated[
        Number,
        "number above 0, picoseconds",
        "Instead of sigma_bins: standard deviation of the pulse in picoseconds",
    ]
    bins: Annotated[
        Integer,
        "whole number",
        "Bins of a histogram, a power of two from 8 to 1024 [default: 128]",
    ]
    bin_width_ps: Annotated[
        Number,
        "number above 0, picoseconds",
        "Width of a bin in picoseconds [default: 250]",
    ]
    false_alarm: Annotated[
        Number,
        "number above 0",
        "Share of exposures without a target that end with an event [default: 0.01]",
    ]
    false_alarms_per_second: Annotated[
        Number,
        "number above 0",
        "Instead of false_alarm: false alarms of a pixel a second",
    ]
    laser_hz: Annotated[Number, "number above 0, hertz", "Laser cycles a second"]
    l1: Annotated[
        Integer,
        "whole number, 0 to 65535",
        "Shortest exposure: pixels decide after more than N laser cycles [default: the one with the "
        "shortest time to an event]",
    ]
    l2: Annotated[
        Integer,
        "whole number, 1 to 65535",
        "Longest exposure: a pixel without an event starts over after N laser cycles [default: 2000]",
    ]
    x: Annotated[Integer, "whole number, 1 to 65535", "Laser cycles between two decisions [default: 4]"]
    min_count: Annotated[Integer, "whole number, 1 to 1023", "Fewest photons in a reported peak [default: 5]"]
    binning: Annotated[
        Integer,
        "whole number, 0 to 3",
        "Window rule: levels of adaptive binning, 0 to 3; pixels and blocks share the false alarms [default: 0]",
    ]
    seed: Annotated[
        Integer,
        "whole number, 0 to 9223372036854775807",
        "Seed of the simulated exposures [default: 1]",
    ]


class PixelOptions(SensorOptions, DetectionOptions, total=False):
    """Of ``Pixel`` and ``Pixels``."""

    bin_width_ps: BinWidth
    offset_mm: Offset
    offsets_mm: Offsets


class PointsOptions(TypedDict, total=False):
    """Of ``points`` and ``export``."""

    fov: Annotated[
        Numbers,
        "two numbers, (60, 40), degrees",
        "Field of view in degrees from edge to edge [default: 60 along the longer side, with square pixels]",
    ]
    calibration: Annotated[
        Path,
        "file",
        "TOML file with a direction and a range bias for each pixel; docs/export.md lists its keys",
    ]
    laser_hz: Annotated[
        Integer,
        "whole number, hertz",
        "Laser cycles a second, if the file has none or is wrong [default: the file's, else 10000000 with a warning]",
    ]
    echo: Annotated[
        Echo,
        "first, last, strongest or all",
        "Depth events: echo of each exposure of a pixel or block [default: all; the strongest with one_per_pixel]",
    ]
    one_per_pixel: Annotated[
        Switch,
        "True or False",
        "CSV, PCD and PLY: one point a pixel, at the depth of depth-events.npy, in place of a point an event",
    ]


F = TypeVar("F", bound=Callable[..., Any])


def takes(options: Any) -> Callable[[F], F]:
    """Gives a function with ``**options`` their signature, and their help."""

    def decorate(function: F) -> F:
        kinds = get_type_hints(options, include_extras=True)
        signature = inspect.signature(function)
        before = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
        keywords = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_plain(kind))
            for name, kind in kinds.items()
        ]
        function.__signature__ = signature.replace(parameters=before + keywords)  # type: ignore[attr-defined]
        lines = [f"{name}: {kind.__metadata__[0]}\n{_wrapped(kind.__metadata__[1])}" for name, kind in kinds.items()]
        function.__doc__ = f"{inspect.cleandoc(function.__doc__ or '')}\n\nKeywords:\n\n" + "\n".join(lines) + "\n"
        return function

    return decorate


def is_text(options: Any, name: str) -> bool:
    """Whether the value of an option may be a text."""
    kinds = get_args(get_type_hints(options).get(name, Text))
    return any(kind is str or str in map(type, get_args(kind)) for kind in kinds)


def kind_of(options: Any, name: str) -> str:
    """The kind and the range of an option, in words."""
    kind = get_type_hints(options, include_extras=True)[name]
    return str(kind.__metadata__[0])


def _plain(kind: Any) -> Any:
    """A type without annotation and without numpy's."""
    of = get_args(get_args(kind)[0])
    return Union[tuple(one for one in of if getattr(one, "__module__", "") != "numpy")]


def _wrapped(text: str) -> str:
    return textwrap.fill(text, 96, initial_indent="    ", subsequent_indent="    ")
