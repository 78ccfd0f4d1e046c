"""Keyword arguments as text, which the native extension reads like the flags of the program."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import numpy

from ._native import Error


#: The name and the value of each option.
Keywords = list[tuple[str, str]]


def arguments(options: dict[str, Any]) -> Keywords:
    """Options as text, without ``None`` values and an empty mask."""
    texts = [(key, _text(key, value)) for key, value in options.items() if value is not None]
    return [(key, text) for key, text in texts if text or key not in ("mask", "laser_off")]


def flags(keywords: Keywords) -> list[str]:
    """The same as sorted flags of the command line, without the settings file."""
    others = [(key.replace("_", "-"), text) for key, text in keywords if key != "settings"]
    return sorted("--laser-off" if name == "laser-off" else f"--{name}={text}" for name, text in others)


def settings_file(value: Any) -> str:
    """The name of a settings file."""
    if not isinstance(value, (str, os.PathLike)) or "\n" in str(value):
        raise Error('settings: must be the name of a file; save it first, as with .save("dtof.toml")')
    return os.fspath(value)


def _text(key: str, value: Any) -> str:
    if key == "settings":
        return settings_file(value)
    if key == "mask" and getattr(value, "dtype", None) == bool:
        raise Error("mask: must be addresses of pixels, as numpy.flatnonzero gives them")
    if key == "laser_off":
        return "true" if value else ""
    if key == "glass" and isinstance(value, (bool, numpy.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (bool, numpy.bool_)):
        return "true" if value else "false"
    if isinstance(value, numpy.generic):
        value = value.item()
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, Iterable):
        separator = {"gate": "..", "array": "x", "fov": "x"}.get(key, ",")
        return separator.join(_text("", part) for part in value)
    return str(value)
