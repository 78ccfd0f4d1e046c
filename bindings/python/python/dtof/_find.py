"""Settings for a recording, a scene or a required rate of false alarms."""

from __future__ import annotations

import csv
import io
import json
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Optional

from . import _native
from ._arrays import native_input, recording_input
from ._keywords import CalibrateOptions, CompareOptions, Settings, TuneOptions, takes
from ._options import arguments, settings_text
from ._run import Progress, scene_of
from ._warn import rows_of, warn

if TYPE_CHECKING:
    from typing_extensions import Unpack


class _Settings:
    """Settings that can be saved."""

    toml: Optional[str]

    def save(self, path: Any) -> None:
        """Writes the settings file, for ``settings=path``. An existing file stays as it is."""
        if self.toml is None:
            raise _native.Error("no settings: no method is as exact as required")
        try:
            with open(path, "x", encoding="utf-8") as file:
                file.write(self.toml)
        except OSError as error:
            raise _native.Error(f"{os.fspath(path)}: {error.strerror}") from error


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(_Settings):
    """The properties of a sensor, from a recording.

    ``found`` has each result with its 95 % interval, ``remarks`` what the recording does not
    determine, ``changes`` the differences from older settings. ``report`` is an HTML page.
    """

    settings: dict[str, Any]
    toml: str
    found: dict[str, str]
    remarks: list[tuple[str, str]]
    changes: dict[str, str]
    report: str

    def __repr__(self) -> str:
        return f"<dtof.Calibration: {len(self.found)} findings, {len(self.remarks)} remarks>"


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(_Settings):
    """All methods on the same photons.

    ``answer`` recommends a method, in rows; ``able`` lists the methods that are exact enough.
    ``settings`` and ``toml`` are those of the recommended method, which keeps every pixel; None if
    there is none. ``fastest_toml`` are the settings of the fastest method, None if it is the same.
    ``methods`` and ``stress`` are the rows of ``methods.csv`` and ``stress.csv``, ``chart`` is an
    SVG document.
    """

    settings: Optional[dict[str, Any]]
    toml: Optional[str]
    fastest_toml: Optional[str]
    answer: dict[str, str]
    able: dict[str, str]
    methods: list[dict[str, str]]
    stress: list[dict[str, str]]
    chart: str

    def __repr__(self) -> str:
        return f"<dtof.Comparison: {len(self.methods)} methods, {len(self.able)} exact enough>"


@takes(CalibrateOptions)
def calibrate(
    recorded: Any, *, settings: Settings = None, progress: Progress = None, **options: Unpack[CalibrateOptions]
) -> Calibration:
    """Finds background, pulse, cover glass, hot pixels and thresholds in histograms.

    ``recorded`` is a recording as for :func:`replay`. ``target_mm`` is the distance of a flat target
    in millimetres, straight ahead; with ``fov`` the ``settings`` also have an offset for each pixel
    (``settings["sensor"]["offsets_mm"]``) if pixels differ. ``glass`` says whether the nearest surface
    is a cover glass. ``settings`` are older settings, as for :func:`replay`. ``progress(done, total)`` is
    called about 20 times a second with steps of each part of the work. An exception in it ends the work,
    as does Ctrl-C.
    """
    older = None if settings is None else settings_text(settings)
    source = recording_input(recorded, options)
    found = _native.calibrate(source, older, arguments(CalibrateOptions, options), progress)
    warn(found["warnings"])
    return Calibration(
        settings=json.loads(found["settings"]),
        toml=found["toml"],
        found=dict(rows_of(found["rows"])),
        remarks=rows_of(found["remarks"]),
        changes=dict(found["changes"]),
        report=found["report"],
    )


@takes(CompareOptions)
def compare(
    recorded: Any = None,
    *,
    scene: Any = None,
    truth: Any = None,
    progress: Optional[Callable[[str, float], Any]] = None,
    **options: Unpack[CompareOptions],
) -> Comparison:
    """Compares all methods on a recording or a scene, and recommends one.

    Takes ``recorded``, a recording as for :func:`replay`, or ``scene``, as for :func:`simulate`.
    ``truth`` is the true range of each pixel in millimetres, an array or a file; 0 means none.
    ``within`` is the largest error of 68 % of the reports, in millimetres. ``progress(step, share)``
    is called with each step and the share of the whole work that is done, 0 to 1, some 200 times.
    """
    compared = _CompareInput(
        recording=None if recorded is None else recording_input(recorded, options),
        truth=None if truth is None else native_input(truth, "truth"),
        scene=None if scene is None else scene_of(scene),
    )
    found = _native.compare(compared, arguments(CompareOptions, options), progress)
    warn(found["warnings"])
    return Comparison(
        settings=found["settings"] and json.loads(found["settings"]),
        toml=found["toml"],
        fastest_toml=found["fastest_toml"],
        answer=dict(rows_of(found["rows"])),
        able=dict(rows_of(found["able"])),
        methods=_table(found["table"]),
        stress=_table(found["stress"]),
        chart=found["chart"],
    )


@takes(TuneOptions)
def tune(*, progress: Progress = None, **options: Unpack[TuneOptions]) -> dict[str, Any]:
    """Finds α or z and L1 for a required rate of false alarms, and the performance to expect.

    ``background`` is in photons per bin and laser cycle, ``signal`` in photons per laser cycle,
    ``sigma_bins`` is the standard deviation of the pulse. Each result has ``value``, ``unit`` and ``source``;
    ``"options"`` has the flags for the command line. ``progress`` is as for :func:`calibrate`.
    """
    found, flags = _native.tune(arguments(TuneOptions, options), progress)
    return {**json.loads(found), "options": flags}


@dataclass(frozen=True)
class _CompareInput:
    """The input of a comparison, for the native extension."""

    recording: Any
    truth: Any
    scene: Any


def _table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))
