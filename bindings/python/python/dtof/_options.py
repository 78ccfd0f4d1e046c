"""Keyword arguments as text, which the native extension reads like the flags of the program."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy

from ._keywords import is_list, is_text, kind_of
from ._native import Error

#: The name and the value of each option.
Keywords = list[tuple[str, str]]


def arguments(kinds: Any, options: Mapping[str, Any]) -> Keywords:
    """Options of :mod:`dtof._keywords` as text, without ``None`` values and empty lists of pixels."""
    texts = [(key, _text(kinds, key, value)) for key, value in options.items() if value is not None]
    return [(key, text) for key, text in texts if text or key not in ("mask", "offsets_mm", "laser_off")]


def settings_text(value: Any) -> str:
    """Settings for the native extension: the name of a file, or a text of several lines."""
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return toml_of(value)
    toml = getattr(value, "toml", value)
    if toml is None:
        raise Error("settings: the comparison has none: no method is as exact as required")
    if not isinstance(toml, str):
        raise Error(
            f"settings: {type(value).__name__}: must be the name of a file, its text, a dict of its sections, "
            "a calibration, a comparison or a run"
        )
    return toml


def toml_of(sections: Mapping[str, Any]) -> str:
    """A dict of sections as the text of a settings file."""
    lines: list[str] = []
    for section, values in sections.items():
        if not isinstance(values, Mapping):
            lines.insert(0, f"{json.dumps(section)} = {_toml(section, values)}")
            continue
        lines.append(f"[{json.dumps(section)}]")
        given = {key: value for key, value in values.items() if value is not None}
        lines += [f"{json.dumps(key)} = {_toml(key, value)}" for key, value in given.items()]
    return "\n".join([*lines, ""]) or "\n"


def _toml(key: str, value: Any) -> str:
    if isinstance(value, (numpy.generic, numpy.ndarray)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml(key, one) for one in value)}]"
    if isinstance(value, (bool, str)):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (int, float)):
        return str(value)
    if isinstance(value, os.PathLike):
        return json.dumps(os.fspath(value), ensure_ascii=False)
    raise Error(f"settings: {key}: {type(value).__name__}: must be a number, a text, True, False or a list")


def _text(kinds: Any, key: str, value: Any) -> str:
    if key == "settings":
        return settings_text(value)
    if key == "mask" and isinstance(value, numpy.ndarray) and value.dtype.kind == "b":
        raise Error("mask: must be addresses of pixels, as numpy.flatnonzero gives them")
    if isinstance(value, (str, bytes)) and not is_text(kinds, key):
        raise Error(f"{key} {value!r}: is a text; must be: {kind_of(kinds, key)}")
    if isinstance(value, numpy.ndarray) and value.ndim == 0:
        value = value.item()
    is_given_list = isinstance(value, Iterable) and not isinstance(value, (str, bytes))
    if is_given_list and not is_list(kinds, key) and (value := list(value)):
        raise Error(f"{key} {value}: is a list; must be: {kind_of(kinds, key)}")
    if key == "laser_off":
        return "true" if value else ""
    if key == "glass" and isinstance(value, (bool, numpy.bool_)):
        return "yes" if value else "no"
    separator = {"gate": "..", "array": "x", "fov": "x"}.get(key, ",")
    return _plain(value, separator)


def _plain(value: Any, separator: str) -> str:
    if isinstance(value, (bool, numpy.bool_)):
        return "true" if value else "false"
    if isinstance(value, numpy.generic):
        value = value.item()
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, Iterable):
        return separator.join(_plain(part, ",") for part in value)
    return str(value)
