"""Settings that suit a recording, a scene or a wanted rate of false alarms."""

from __future__ import annotations

import csv
import io
import json
import os
from dataclasses import dataclass, field
from typing import Any, Callable, Optional

from . import _native
from ._arrays import recording
from ._options import arguments, settings_file
from ._run import scene_of, warn


class _Settings:
    """Settings that can be saved."""

    toml: Optional[str]

    def save(self, path: Any) -> None:
        """Writes the settings file, for ``settings=path``. An existing file stays as it is."""
        if self.toml is None:
            raise _native.Error("no settings: no method is as exact as wanted")
        try:
            with open(path, "x", encoding="utf-8") as file:
                file.write(self.toml)
        except OSError as error:
            raise _native.Error(f"{os.fspath(path)}: {error.strerror}") from error


@dataclass(frozen=True)
class Calibration(_Settings):
    """What a recording tells of its sensor.

    ``found`` names each result with its 95 % interval, ``remarks`` what the recording leaves open,
    ``changes`` what differs from older settings. ``report`` is a page of HTML.
    """

    settings: dict[str, Any]
    toml: str
    found: dict[str, str]
    remarks: list[tuple[str, str]]
    changes: dict[str, str]
    report: str = field(repr=False)


@dataclass(frozen=True)
class Comparison(_Settings):
    """All methods on the same photons.

    ``answer`` says which to take, in rows; ``able`` those that are as exact as wanted.
    ``settings`` and ``toml`` are those of the one to take, None if there is none. ``methods`` and
    ``stress`` are the rows of ``methods.csv`` and ``stress.csv``, ``chart`` an SVG document.
    """

    settings: Optional[dict[str, Any]]
    toml: Optional[str]
    answer: dict[str, str]
    able: dict[str, str]
    methods: list[dict[str, str]]
    stress: list[dict[str, str]]
    chart: str = field(repr=False)


def calibrate(recorded: Any, *, settings: Any = None, **options: Any) -> Calibration:
    """Finds background, pulse, cover glass, hot pixels and thresholds in histograms.

    ``recorded`` is what :func:`replay` takes. ``target_mm`` is the distance of a flat target in
    millimetres, ``glass`` says whether the nearest surface is a cover glass, ``settings`` names
    older settings. Further options are those of ``dtof calibrate``.
    """
    older = None if settings is None else settings_file(settings)
    found = _native.calibrate(recording(recorded, "the array"), older, arguments(options))
    warn(found["warnings"])
    return Calibration(
        settings=json.loads(found["settings"]),
        toml=found["toml"],
        found=dict(found["rows"]),
        remarks=found["remarks"],
        changes=dict(found["changes"]),
        report=found["report"],
    )


def compare(
    recorded: Any = None,
    *,
    scene: Any = None,
    truth: Any = None,
    progress: Optional[Callable[[str], Any]] = None,
    **options: Any,
) -> Comparison:
    """Tries all methods on a recording or a scene, and says which to take.

    ``recorded`` is what :func:`replay` takes, ``scene`` what :func:`simulate` does; one of them is
    needed. ``truth`` is the true range of each pixel in millimetres, an array or a file; 0 is
    none. ``within`` is how many millimetres 68 % of the reports may be off. ``progress(step)`` is
    called with each step. Further options are those of ``dtof compare``.
    """
    given = _Compared(
        recording=None if recorded is None else recording(recorded, "the array"),
        truth=None if truth is None else recording(truth, "truth"),
        scene=None if scene is None else scene_of(scene),
    )
    found = _native.compare(given, arguments(options), progress)
    warn(found["warnings"])
    return Comparison(
        settings=found["settings"] and json.loads(found["settings"]),
        toml=found["toml"],
        answer=dict(found["rows"]),
        able=dict(found["able"]),
        methods=_table(found["table"]),
        stress=_table(found["stress"]),
        chart=found["chart"],
    )


def tune(**options: Any) -> dict[str, Any]:
    """Finds α or z and L1 for a wanted rate of false alarms, and says what to expect.

    ``background`` is photons a bin and laser cycle, ``signal`` photons a laser cycle,
    ``sigma_bins`` the standard deviation of the pulse. Further options are those of ``dtof tune``.
    Each result has ``value``, ``unit`` and ``source``; ``"options"`` is what the command line
    takes.
    """
    found, said = _native.tune(arguments(options))
    return {**json.loads(found), "options": said}


@dataclass(frozen=True)
class _Compared:
    """What is compared, for the native part."""

    recording: Any
    truth: Any
    scene: Any


def _table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))
