"""Keyword arguments as options of the command line, so that names, ranges and errors are its own."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import numpy

from ._native import Error


def arguments(options: dict[str, Any], flags: Iterable[str] = ()) -> list[str]:
    """Each option that is given as ``--name=value``; one of ``flags`` as ``--name``."""
    said = []
    for key, value in options.items():
        name = "--" + key.replace("_", "-")
        if value is None or _is_no_pixel(key, value):
            continue
        if key not in flags:
            said.append(f"{name}={_text(key, value)}")
        elif value:
            said.append(name)
    return said


def _is_no_pixel(key: str, value: Any) -> bool:
    """Whether it is an empty mask, as of ``numpy.flatnonzero``."""
    return key == "mask" and not isinstance(value, (str, os.PathLike)) and not _text(key, value)


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
