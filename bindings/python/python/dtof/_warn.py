"""Warnings of the native extension as those of Python."""

from __future__ import annotations

import warnings


def warn(lines: list[str], callers: int = 2) -> None:
    """Issues warnings about a recording.

    They name the line ``callers`` levels up: 2 if the user called the caller of this function.
    """
    for line in lines:
        warnings.warn(line, UserWarning, stacklevel=callers + 1)
