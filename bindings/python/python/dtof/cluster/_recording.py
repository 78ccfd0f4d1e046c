"""One recording, on a worker."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Optional

from .. import _native
from .._options import Keywords
from .._run import quiet_result
from ._client import line
from ._folder import Folder
from ._worker import begin


@dataclass(frozen=True)
class Task:
    """The parameters of a task. Its result depends only on these and the files."""

    version: str
    file: str
    folder: Optional[str]
    events: str
    keywords: Keywords


class Done(NamedTuple):
    """Fields of a ``Recorded``, and warnings about the recording."""

    result: dict[str, Any]
    warnings: list[str]


def run_task(task: Task) -> Done:
    """Replays a recording. An error is a result: another worker would have the same."""
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
        folder = Folder(task.folder, task.events, task.file, task.keywords)
        earlier = folder.kept_statistics()
        if earlier is not None:
            return Done({"statistics": earlier, "is_kept": True}, _warnings(earlier))
    done = _native.replay(task.file, task.keywords, None, None)
    run = quiet_result(done)
    if folder is None:
        return Done({"statistics": run.statistics, "run": run}, done["warnings"])
    folder.write(run)
    return Done({"statistics": run.statistics}, done["warnings"])


def _warnings(statistics: dict[str, Any]) -> list[str]:
    """The warnings of the earlier run."""
    cut_off = statistics["cut_off"]
    lines = [f"{cut_off:,} photons in bins that were cut off"] if cut_off else []
    return [*statistics["warnings"], *lines]
