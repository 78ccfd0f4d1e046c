"""Many recordings, each on one worker."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Optional, Union

from distributed import Client

from .. import _native
from .._keywords import ReplayOptions
from .._options import absolute, arguments
from .._run import Replay
from .._warn import warn
from ._client import Progress, check_workers, line, totals, wait_for
from ._folder import FORMATS
from ._recording import Task, run_task

#: Extensions of recordings.
_ENDS = (".json.gz", ".json", ".npy", ".npz", ".csv")


@dataclass(frozen=True)
class Recorded:
    """The result of one recording.

    ``error`` is the message of a failure, None on success. ``statistics`` has the contents of
    ``summary.json``. ``run`` has events and settings, None if they are in ``folder``. ``is_kept``
    tells that an earlier run wrote them.
    """

    file: str
    error: Optional[str] = None
    statistics: Optional[dict[str, Any]] = None
    run: Optional[Replay] = None
    folder: Optional[str] = None
    is_kept: bool = False


@dataclass(frozen=True)
class Recordings:
    """The results of many recordings, in the order of the files."""

    results: list[Recorded]

    @property
    def failed(self) -> list[Recorded]:
        """The results with an error."""
        return [one for one in self.results if one.error is not None]

    @cached_property
    def totals(self) -> dict[str, int]:
        """The sums of all counters, over the recordings without an error."""
        return totals(one.statistics for one in self.results if one.statistics is not None)

    def __repr__(self) -> str:
        events, photons = self.totals["events"], self.totals["photons"]
        failed = f", {len(self.failed)} failed" if self.failed else ""
        return (
            f"<dtof.cluster.Recordings: {events} events of {photons} photons in {len(self.results)} recordings{failed}>"
        )


def recordings(
    client: Client,
    files: Iterable[Union[str, os.PathLike[str]]],
    *,
    out: Any = None,
    names: Optional[Iterable[str]] = None,
    events: str = "aer",
    progress: Progress = None,
    **options: Any,
) -> Recordings:
    """Replays many recordings, each on one worker of ``client``.

    ``files`` are names that every worker can read, of any format that :func:`dtof.replay` reads.
    ``options`` are its options, the same for all; a settings file is read by the workers.

    Without ``out`` events are returned, and have to fit into memory. ``out`` is a folder that all
    workers share: each recording gets a folder there with ``events.aer`` (or ``events.npy``, an
    array of :data:`dtof.EVENT`, with ``events="npy"``), ``dtof.toml`` and ``summary.json``, as from
    ``dtof replay``; only statistics are returned. ``names`` are the names of these folders, by
    default those of the files without extension. ``summary.json`` is written last. A recording is
    not replayed again if its folder has unchanged results of this version with the same options,
    settings, and size and time of the file; its warnings are repeated. Other results of this
    function are replaced, other files never. A folder that ``dtof replay`` wrote is an error of its
    recording.

    A recording that cannot be replayed is a result with an ``error``; the others continue.
    ``progress(done, all)`` is called after each recording.
    """
    given = _files(files)
    options["settings"] = absolute(options.get("settings"))
    keywords = arguments(ReplayOptions, options)
    _native.check_options(keywords)
    if events not in FORMATS:
        raise _native.Error(f"events {events!r}: must be one of {', '.join(FORMATS)}")
    if out is None and names is not None:
        raise _native.Error("names are those of folders: give out, too")
    folder = None if out is None else os.path.abspath(out)
    folders: list[Optional[str]] = [None] * len(given)
    if folder is not None:
        folders = [os.path.join(folder, name) for name in _names(given, names)]
    check_workers(client, folder)
    version = _native.__version__
    tasks = [Task(version, file, place, events, keywords) for file, place in zip(given, folders)]
    futures = client.map(run_task, tasks, pure=False)
    results = []
    for task, done in zip(tasks, wait_for(client, futures, progress, keep_errors=True)):
        if isinstance(done, Exception):
            results.append(Recorded(task.file, error=f"{task.file}: {line(done)}"))
            continue
        result = Recorded(task.file, folder=task.folder, **done.result)
        results.append(result if result.error is None else Recorded(task.file, result.error))
        warn([f"{task.file}: {warning}" for warning in done.warnings])
    return Recordings(results)


def _files(files: Any) -> list[str]:
    if isinstance(files, (str, bytes, os.PathLike)):
        raise _native.Error(f"files: one name: put it in a list, as [{os.fspath(files)!r}]")
    try:
        given = [os.path.abspath(os.fspath(file)) for file in files]
    except TypeError as error:
        raise _native.Error(f"files: must be names of files: {error}") from error
    if not given:
        raise _native.Error("files: there are none")
    seen: dict[str, str] = {}
    for file in given:
        other = seen.setdefault(os.path.realpath(file), file)
        if other is not file:
            raise _native.Error(f"{file}: is given twice{'' if other == file else f', as {other}'}")
    return given


def _names(files: list[str], names: Optional[Iterable[str]]) -> list[str]:
    """A name for the folder of each file."""
    given = [_stem(file) for file in files] if names is None else [str(name) for name in names]
    if len(given) != len(files):
        raise _native.Error(f"names: {len(given)} for {len(files)} files")
    seen: dict[str, str] = {}
    for file, name in zip(files, given):
        # Separators of any system count on all systems.
        parts = name.replace("\\", "/").split("/")
        if os.path.isabs(name) or not all(parts) or {".", ".."} & set(parts) or "\0" in name:
            raise _native.Error(f"names: {name!r} is not the name of a folder in out")
        # Some file systems ignore case.
        other = seen.setdefault(name.lower(), file)
        if other is not file:
            raise _native.Error(f"{file}: its folder would be {name}, which is that of {other}: give names")
    return given


def _stem(file: str) -> str:
    name = os.path.basename(file)
    end = next((end for end in _ENDS if name.lower().endswith(end)), "")
    return name[: len(name) - len(end)] or name
