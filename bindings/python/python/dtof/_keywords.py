"""The keywords of every function: their types, and their help from the tables of the program.

``None`` is the same as a keyword that is not given.
"""

from __future__ import annotations

import inspect
import os
import textwrap
from collections.abc import Iterable, Mapping
from typing import (
    Any,
    Callable,
    Literal,
    NamedTuple,
    Optional,
    Protocol,
    TypedDict,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy

from . import _native

Integer = Union[int, numpy.integer, None]
Number = Union[float, numpy.floating, numpy.integer, None]
Switch = Union[bool, numpy.bool_, None]
Text = Optional[str]
Path = Union[str, os.PathLike[str], None]
#: Lists may be texts, as on the command line.
Names = Union[str, Iterable[str], None]
Integers = Union[str, Iterable[int], None]
Numbers = Union[str, Iterable[float], None]
Echo = Optional[Literal["first", "last", "strongest", "all"]]


class HasSettings(Protocol):
    """A calibration, a comparison or a run."""

    @property
    def toml(self) -> Optional[str]: ...


Settings = Union[str, os.PathLike[str], Mapping[str, Any], HasSettings, None]


# The types below are made from the tables of the options:
# DTOF_BLESS=1 python -m pytest bindings/python/tests/test_keywords.py


class LoadOptions(TypedDict, total=False):
    """Of ``load``."""

    axes: Names
    array: Text
    capture: Integer
    columns: Integer
    rebin: Integer
    bins: Integer
    bin_width_ps: Number
    offset_mm: Number
    offsets_mm: Numbers
    photons_per_cycle: Number
    recorded_cycles: Integer
    laser_hz: Integer
    settings: Settings
    cycles: Integer


class ReplayOptions(TypedDict, total=False):
    """Of ``replay``."""

    axes: Names
    array: Text
    capture: Integer
    columns: Integer
    rebin: Integer
    bins: Integer
    bin_width_ps: Number
    offset_mm: Number
    offsets_mm: Numbers
    photons_per_cycle: Number
    recorded_cycles: Integer
    laser_hz: Integer
    settings: Settings
    gate: Integers
    mask: Integers
    sigma_bins: Number
    dead_time: Integer
    rule: Optional[Literal["paper", "average", "window"]]
    alpha: Number
    window: Integer
    z: Number
    false_alarm: Number
    estimator: Optional[Literal["centroid", "window"]]
    half_widths: Numbers
    min_count: Integer
    l1: Integer
    l2: Integer
    x: Integer
    binning: Integer
    patience: Integer
    neighbours: Integer
    tracking: Switch
    echoes: Integer
    echo_wait: Integer
    once_per_bin: Switch
    counter_bits: Integer
    frame: Integer
    decide_once: Switch
    glass: Switch
    cycles: Integer
    seed: Integer


class SimulateOptions(TypedDict, total=False):
    """Of ``simulate``."""

    array: Integers
    laser_off: Switch
    settings: Settings
    gate: Integers
    mask: Integers
    sigma_bins: Number
    dead_time: Integer
    rule: Optional[Literal["paper", "average", "window"]]
    alpha: Number
    window: Integer
    z: Number
    false_alarm: Number
    estimator: Optional[Literal["centroid", "window"]]
    half_widths: Numbers
    min_count: Integer
    l1: Integer
    l2: Integer
    x: Integer
    binning: Integer
    patience: Integer
    neighbours: Integer
    tracking: Switch
    echoes: Integer
    echo_wait: Integer
    once_per_bin: Switch
    counter_bits: Integer
    frame: Integer
    decide_once: Switch
    cycles: Integer
    seed: Integer


class CalibrateOptions(TypedDict, total=False):
    """Of ``calibrate``."""

    axes: Names
    array: Text
    capture: Integer
    columns: Integer
    rebin: Integer
    bins: Integer
    bin_width_ps: Number
    offset_mm: Number
    offsets_mm: Numbers
    photons_per_cycle: Number
    recorded_cycles: Integer
    laser_hz: Integer
    gate: Integers
    mask: Integers
    once_per_bin: Switch
    sigma_bins: Number
    dead_time: Integer
    fov: Numbers
    calibration: Path
    glass: Switch
    target_mm: Number
    false_alarm: Number
    seed: Integer


class CompareOptions(TypedDict, total=False):
    """Of ``compare``."""

    within: Number
    false_alarm: Number
    axes: Names
    array: Text
    capture: Integer
    columns: Integer
    rebin: Integer
    bins: Integer
    bin_width_ps: Number
    offset_mm: Number
    offsets_mm: Numbers
    photons_per_cycle: Number
    recorded_cycles: Integer
    laser_hz: Integer
    settings: Settings
    gate: Integers
    mask: Integers
    sigma_bins: Number
    dead_time: Integer
    glass: Switch
    once_per_bin: Switch
    cycles: Integer
    seed: Integer


class TuneOptions(TypedDict, total=False):
    """Of ``tune``."""

    rule: Optional[Literal["paper", "average", "window"]]
    background: Number
    signal: Number
    snr: Number
    sigma_bins: Number
    sigma_ps: Number
    bins: Integer
    bin_width_ps: Number
    false_alarm: Number
    false_alarms_per_second: Number
    laser_hz: Number
    l1: Integer
    l2: Integer
    x: Integer
    min_count: Integer
    binning: Integer
    seed: Integer


class PixelOptions(TypedDict, total=False):
    """Of ``Pixel`` and ``Pixels``."""

    bin_width_ps: Number
    offset_mm: Number
    offsets_mm: Numbers
    settings: Settings
    gate: Integers
    mask: Integers
    sigma_bins: Number
    dead_time: Integer
    rule: Optional[Literal["paper", "average", "window"]]
    alpha: Number
    window: Integer
    z: Number
    false_alarm: Number
    estimator: Optional[Literal["centroid", "window"]]
    half_widths: Numbers
    min_count: Integer
    l1: Integer
    l2: Integer
    x: Integer
    binning: Integer
    patience: Integer
    neighbours: Integer
    tracking: Switch
    echoes: Integer
    echo_wait: Integer
    once_per_bin: Switch
    counter_bits: Integer


class PointsOptions(TypedDict, total=False):
    """Of ``points`` and ``export``."""

    fov: Numbers
    calibration: Path
    laser_hz: Integer
    echo: Optional[Literal["first", "last", "strongest", "all"]]
    one_per_pixel: Switch


# The end of these types.


F = TypeVar("F", bound=Callable[..., Any])


class Keyword(NamedTuple):
    """What is known of a keyword beside its type."""

    #: Kind and range.
    values: str
    #: What it does, and its default.
    help: str


_ALL = {
    options: {name: Keyword(values, help) for name, _, values, help in keywords}
    for options, keywords in _native.keywords()
}


def takes(options: Any) -> Callable[[F], F]:
    """Gives a function with ``**options`` their signature, and their help."""

    def decorate(function: F) -> F:
        signature = inspect.signature(function)
        before = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
        keywords = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_plain(kind))
            for name, kind in get_type_hints(options).items()
        ]
        function.__signature__ = signature.replace(parameters=before + keywords)  # type: ignore[attr-defined]
        lines = [f"{name}: {one.values}\n{_wrapped(one.help)}" for name, one in all_of(options).items()]
        function.__doc__ = f"{inspect.cleandoc(function.__doc__ or '')}\n\nKeywords:\n\n" + "\n".join(lines) + "\n"
        return function

    return decorate


def all_of(options: Any) -> dict[str, Keyword]:
    """The keywords of a type of options."""
    return _ALL[options.__name__]


def is_text(options: Any, name: str) -> bool:
    """Whether the value of an option may be a text."""
    kinds = get_args(get_type_hints(options).get(name, Text))
    return any(kind is str or str in map(type, get_args(kind)) for kind in kinds)


def is_list(options: Any, name: str) -> bool:
    """Whether the value of an option may be a list."""
    kinds = get_args(get_type_hints(options).get(name, Names))
    return any(get_origin(kind) is Iterable for kind in kinds)


def kind_of(options: Any, name: str) -> str:
    """The kind and the range of an option, in words."""
    return all_of(options)[name].values


def _plain(kind: Any) -> Any:
    """A type without those of numpy."""
    return Union[tuple(one for one in get_args(kind) if getattr(one, "__module__", "") != "numpy")]


def _wrapped(text: str) -> str:
    return textwrap.fill(text, 96, initial_indent="    ", subsequent_indent="    ")
