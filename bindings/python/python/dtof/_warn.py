"""Messages of the native extension as those of Python: warnings, and keywords in place of flags."""

from __future__ import annotations

import re
import warnings

#: A flag, and perhaps a value: a number, a placeholder such as N or HxV, yes or no, none, names with commas.
_FLAG = re.compile(
    r"(?<![\w-])--([a-z][a-z0-9-]*)(?: (\d[\d.]*\b|[A-Z](?:xV)?\b|FILE\b|yes\b|no\b|none\b|[a-z]+(?:,[a-z]+)+))?"
)
_SWITCH = {"yes": "True", "no": "False", "HxV": "(H, V)"}


def with_keywords(text: str) -> str:
    """The text with keywords in place of flags: ``cycles=N`` for ``--cycles N``.

    >>> with_keywords("--columns 8 makes 8x8; --glass yes is a cover glass, --mask leaves out")
    'columns=8 makes 8x8; glass=True is a cover glass, mask leaves out'
    """

    def keyword(flag: re.Match[str]) -> str:
        name, value = flag[1].replace("-", "_"), flag[2]
        if value is None:
            return name
        is_text = "," in value or value == "none"
        return f'{name}="{value}"' if is_text else f"{name}={_SWITCH.get(value, value)}"

    return _FLAG.sub(keyword, text)


def rows_of(rows: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Rows with keywords in place of flags."""
    return [(name, with_keywords(text)) for name, text in rows]


def warn(lines: list[str], callers: int = 2) -> None:
    """Issues warnings about a recording.

    They name the line ``callers`` levels up: 2 if the user called the caller of this function.
    """
    for line in lines:
        warnings.warn(with_keywords(line), UserWarning, stacklevel=callers + 1)
