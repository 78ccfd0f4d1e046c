"""One scene with many seeds."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Optional

from distributed import Client

from .. import _native
from .._keywords import SimulateOptions
from .._options import Keywords, absolute, arguments, flags
from .._run import quiet_result
from ._client import Progress, check_workers, totals, wait_for
from ._worker import begin

#: Runs in a task.
_PART = 10


@dataclass(frozen=True)
class Seeds:
    """Runs of one scene with different seeds.

    ``statistics`` are those of each run, as in ``summary.json``, in the ascending order of
    ``seeds``. ``scene_sha256`` is the hash of the scene's text and the options. Two objects with the
    same scene and options and disjoint seeds can be added. The results do not depend on the order
    of additions.
    """

    seeds: list[int]
    statistics: list[dict[str, Any]]
    scene_sha256: str

    @cached_property
    def totals(self) -> dict[str, int]:
        """The sums of all counters."""
        return totals(self.statistics)

    @cached_property
    def against_truth(self) -> dict[str, Any]:
        """All events compared with the scene, and those of each surface in ``surfaces``.

        ``events``, ``false_alarms`` and their share. For all other events ``bias_mm``, the mean
        error, and ``rms_mm``, the root mean square error, in millimetres, or None without events.
        """
        runs = [one["against_truth"] for one in self.statistics]
        surfaces = [
            {"name": surface["name"], **_errors([run["surfaces"][place] for run in runs])}
            for place, surface in enumerate(runs[0]["surfaces"])
        ]
        return {**_errors(runs), "surfaces": surfaces}

    def __add__(self, other: Seeds) -> Seeds:
        if not isinstance(other, Seeds):
            return NotImplemented
        both = set(self.seeds) & set(other.seeds)
        if both:
            raise _native.Error(f"seed {min(both)} is in both")
        one, two = (_fixed(of.statistics[0]) for of in (self, other))
        different = next((key for key in one if one[key] != two.get(key)), None)
        if different is not None:
            raise _native.Error(f"runs of different scenes or options: {different} differs")
        if self.scene_sha256 != other.scene_sha256:
            raise _native.Error("runs of different scenes or options: scene_sha256 differs")
        runs = sorted(
            zip(self.seeds + other.seeds, self.statistics + other.statistics),
            key=lambda run: run[0],
        )
        ordered = [seed for seed, _ in runs]
        return Seeds(ordered, [statistics for _, statistics in runs], self.scene_sha256)

    def __repr__(self) -> str:
        return f"<dtof.cluster.Seeds: {self.totals['events']} events of {len(self.seeds)} runs>"


def seeds(
    client: Client,
    scene: Any,
    seeds: Iterable[int],
    *,
    progress: Progress = None,
    **options: Any,
) -> Seeds:
    """Simulates ``scene`` with each of ``seeds``, spread over the workers of ``client``.

    ``scene`` is the name of a scene file, which this process reads, or the text of one; ``options``
    are those of :func:`dtof.simulate`. Only statistics are returned, about 3 kB per run; ``totals`` and
    ``against_truth`` summarise them. ``seeds(client, scene, range(100))`` equals
    ``seeds(client, scene, range(50)) + seeds(client, scene, range(50, 100))``.

    ``progress(done, all)`` is called after every ten runs.
    """
    check_workers(client)
    if "seed" in options:
        raise _native.Error("seed: give seeds instead")
    options["settings"] = absolute(options.get("settings"))
    try:
        given = [int(seed.__index__()) for seed in seeds]
    except (TypeError, AttributeError) as error:
        raise _native.Error(f"seeds: must be whole numbers, as range(100): {error}") from error
    ordered = sorted(set(given))
    if not given or len(ordered) != len(given):
        twice = next((seed for seed in ordered if given.count(seed) > 1), None)
        raise _native.Error("seeds: there are none" if twice is None else f"seed {twice}: is given twice")
    keywords = arguments(SimulateOptions, options)
    text = _text(scene)
    parts = [ordered[at : at + _PART] for at in range(0, len(ordered), _PART)]
    version = _native.__version__
    futures = client.map(_simulate, *zip(*((version, text, part, keywords) for part in parts)), pure=False)
    statistics = [run for part in wait_for(client, futures, progress) for run in part]
    return Seeds(ordered, statistics, _hash(text[1], keywords))


def _simulate(version: str, scene: tuple[str, str], seeds: list[int], keywords: Keywords) -> list[dict[str, Any]]:
    begin(version)
    runs = (_native.simulate(scene, [*keywords, ("seed", str(seed))], None) for seed in seeds)
    return [quiet_result(run).statistics for run in runs]


def _text(scene: Any) -> tuple[str, str]:
    """The name of a scene for errors, and its text."""
    if isinstance(scene, str) and "\n" in scene:
        return "the scene", scene
    name = os.fspath(scene)
    try:
        with open(name, encoding="utf-8") as file:
            return name, file.read()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise _native.Error(f"{name}: {reason}") from error


def _hash(scene: str, keywords: Keywords) -> str:
    """The hash of scene and options. Settings of a file are part of the statistics."""
    return hashlib.sha256(json.dumps([scene, flags(keywords)]).encode()).hexdigest()


def _fixed(statistics: dict[str, Any]) -> dict[str, Any]:
    """The statistics that are equal in all runs of a scene with the same options."""
    settings = {key: value for key, value in statistics["settings"].items() if key != "seed"}
    truth = statistics["against_truth"]
    return {
        **{key: statistics[key] for key in ("program", "input", "cycles", "pixels")},
        "surfaces": [surface["name"] for surface in truth["surfaces"]],
        **settings,
    }


def _errors(runs: list[dict[str, Any]]) -> dict[str, Optional[float]]:
    """The errors of all runs. Sums of floats are exact and rounded once."""
    events = sum(run["events"] for run in runs)
    false_alarms = sum(run["false_alarms"] for run in runs)
    right = [run for run in runs if run["bias_mm"] is not None]
    counts = [run["events"] - run["false_alarms"] for run in right]
    bias = math.fsum(count * run["bias_mm"] for count, run in zip(counts, right))
    square = math.fsum(count * run["rms_mm"] ** 2 for count, run in zip(counts, right))
    all_right = sum(counts)
    return {
        "events": events,
        "false_alarms": false_alarms,
        "false_alarm_share": false_alarms / events if events else None,
        "bias_mm": bias / all_right if all_right else None,
        "rms_mm": math.sqrt(square / all_right) if all_right else None,
    }
