"""Many recordings, each on one worker."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Optional, Union

from distributed import Client

from .. import _native
from .._options import arguments
from .._run import Replay, warn
from ._client import Progress, line, look_at, totals, wait_for
from ._folder import FORMATS
from ._recording import Task, do

#: How names of recordings end.
_ENDS = (".json.gz", ".json", ".npy", ".npz", ".csv")


@dataclass(frozen=True)
class Recorded:
    """What came of one recording.

    ``error`` is the line that says why there is nothing, None if all went well. ``statistics`` hold
    what ``summary.json`` holds. ``run`` are its events and settings, None if they are in the folder
    ``folder``. ``is_kept`` says that an earlier run had left them there.
    """

    file: str
    error: Optional[str] = None
    statistics: Optional[dict[str, Any]] = None
    run: Optional[Replay] = None
    folder: Optional[str] = None
    is_kept: bool = False


@dataclass(frozen=True)
class Recordings:
    """What came of many recordings: ``results`` are in the order in which they were given."""

    results: list[Recorded]

    @property
    def failed(self) -> list[Recorded]:
        """Those with an error."""
        return [one for one in self.results if one.error is not None]

    @cached_property
    def totals(self) -> dict[str, int]:
        """The sums of all counters, over the recordings without an error."""
        return totals(one.statistics for one in self.results if one.statistics is not None)

    def __repr__(self) -> str:
        events, photons = self.totals["events"], self.totals["photons"]
        failed = f", {len(self.failed)} failed" if self.failed else ""
        return (
            f"<dtof.cluster.Recordings: {events} events of {photons} photons in "
            f"{len(self.results)} recordings{failed}>"
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

    Without ``out`` events come back, and have to fit into memory. ``out`` is a folder that all
    workers share: there each recording gets a folder with ``events.aer`` (or ``events.npy``, an
    array of :data:`dtof.EVENT`, with ``events="npy"``), ``dtof.toml`` and ``summary.json``, as from
    ``dtof replay``; only statistics come back. ``names`` are the names of these folders, those of
    the files without their ending if not given. ``summary.json`` is written last. A recording whose
    folder has one, of this version and with equal options, settings, size and time of the file, is
    not replayed again, if its files are as they were written; its warnings are given again. Other
    results of this function are replaced, other files never. A folder that ``dtof replay`` wrote is
    an error of its recording.

    A recording that cannot be replayed is a result with an ``error``; the others go on.
    ``progress(done, all)`` is called with each that is done.
    """
    given = _files(files)
    if options.get("settings") is not None:
        options["settings"] = os.path.abspath(options["settings"])
    said = arguments(options)
    _native.check_options(said)
    if events not in FORMATS:
        raise _native.Error(f"events {events!r}: must be one of {', '.join(FORMATS)}")
    if out is None and names is not None:
        raise _native.Error("names are those of folders: say out, too")
    folder = None if out is None else os.path.abspath(out)
    folders: list[Optional[str]] = [None] * len(given)
    if folder is not None:
        folders = [os.path.join(folder, name) for name in _names(given, names)]
    look_at(client, folder)
    version = _native.__version__
    tasks = [Task(version, file, place, events, said) for file, place in zip(given, folders)]
    futures = client.map(do, tasks, pure=False)
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
        # What separates names on one system does so for all.
        parts = name.replace("\\", "/").split("/")
        if os.path.isabs(name) or not all(parts) or {".", ".."} & set(parts) or "\0" in name:
            raise _native.Error(f"names: {name!r} is no name of a folder in out")
        # Some file systems do not tell them apart.
        other = seen.setdefault(name.lower(), file)
        if other is not file:
            raise _native.Error(
                f"{file}: its folder would be {name}, which is that of {other}: give names"
            )
    return given


def _stem(file: str) -> str:
    name = os.path.basename(file)
    end = next((end for end in _ENDS if name.lower().endswith(end)), "")
    return name[: len(name) - len(end)] or name
