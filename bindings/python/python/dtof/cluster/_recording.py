"""One recording, on a worker."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Optional

from .. import _native
from .._options import Given
from .._run import quietly
from ._client import line
from ._folder import Folder
from ._worker import begin


@dataclass(frozen=True)
class Task:
    """What is to be done. What comes of it depends on nothing else but the files."""

    version: str
    file: str
    folder: Optional[str]
    events: str
    said: Given


class Done(NamedTuple):
    """Fields of a ``Recorded``, and what is surely wrong with the recording."""

    result: dict[str, Any]
    warnings: list[str]


def do(task: Task) -> Done:
    """Replays a recording. What is wrong with it is a result: no other worker could do better."""
    begin(task.version)
    try:
        return _kept_or_new(task)
    except (_native.Error, OSError, MemoryError) as error:
        text = line(error)
        text = text if task.file in text else f"{task.file}: {text}"
        return Done({"error": text}, [])


def _kept_or_new(task: Task) -> Done:
    folder = None
    if task.folder is not None:
        folder = Folder(task.folder, task.events, task.file, task.said)
        kept = folder.kept()
        if kept is not None:
            return Done({"statistics": kept, "is_kept": True}, _warnings(kept))
    done = _native.replay(task.file, task.said, None, None)
    run = quietly(done)
    if folder is None:
        return Done({"statistics": run.statistics, "run": run}, done["warnings"])
    folder.write(run)
    return Done({"statistics": run.statistics}, done["warnings"])


def _warnings(statistics: dict[str, Any]) -> list[str]:
    """The lines that the run itself gave."""
    cut_off = statistics["cut_off"]
    lines = [f"{cut_off:,} photons in bins that were cut off"] if cut_off else []
    return [*statistics["warnings"], *lines]
