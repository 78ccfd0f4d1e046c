"""The stored tables: results and speed."""

from __future__ import annotations

import csv
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from measure import Row

ROOT = Path(__file__).resolve().parents[4]
ROWS = ROOT / "docs/results/data/python.csv"
SPEEDS = ROOT / "docs/results/data/python_speed.csv"
PAGE = ROOT / "docs/results/python.md"
CHART = ROOT / "docs/figures/python.svg"
PALETTE = ROOT / "host/draw/src/palette.css"


@dataclass
class Speed:
    """Millions of photons a second, with the setting for the larger error."""

    scene: str
    method: str
    one_core: float  # of processor time
    photons: int
    machine: str


def text(row) -> dict:
    """A row as text, with five digits, so that rounding does not matter."""
    shown = asdict(row)
    for name, value in shown.items():
        if value is None:
            shown[name] = ""
        elif isinstance(value, float):
            shown[name] = f"{value:.5g}"
        else:
            shown[name] = str(value)
    return shown


def write(path, rows) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        names = [field.name for field in fields(rows[0])]
        table = csv.DictWriter(file, names, lineterminator="\n")
        table.writeheader()
        table.writerows(map(text, rows))


def read(path, kind) -> list:
    """The rows of a table, ``Row`` or ``Speed``."""
    rows = []
    with open(path, newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            for field in fields(kind):
                value = line[field.name]
                if field.type == "int":
                    line[field.name] = int(value)
                elif field.type != "str":
                    line[field.name] = float(value) if value else None
            rows.append(kind(**line))
    return rows


def with_others(path, new, scenes) -> list:
    """The new rows, and the stored rows of other scenes, in the order of the scenes."""
    measured = {row.scene for row in new}
    rows = new + [row for row in read(path, type(new[0])) if row.scene not in measured]
    return sorted(rows, key=lambda row: scenes.index(row.scene))


def differences(measured, scenes) -> list[str]:
    """The differences from the stored rows of these scenes."""
    old = [text(row) for row in read(ROWS, Row) if row.scene in scenes]
    new = [text(row) for row in measured]
    if len(old) != len(new):
        return [f"{len(new)} rows, {len(old)} are stored"]
    return [
        f"{was['scene']}, {was['method']}, {was['setting']}: {name} {now[name]}, stored {was[name]}"
        for was, now in zip(old, new)
        for name in was
        if was[name] != now[name]
    ]
