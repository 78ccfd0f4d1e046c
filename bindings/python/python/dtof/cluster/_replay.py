"""One recording, its rows on several workers."""

from __future__ import annotations

import os
from typing import Any, NamedTuple, Optional

import numpy
from dask.delayed import delayed
from distributed import Client

from .. import _native
from .._arrays import EVENT, Array, recording
from .._options import Given, arguments
from .._run import Replay, quietly, warn
from ._client import Progress, look_at, totals, wait_for
from ._split import Split, blocks_of_file, split
from ._worker import begin


class Done(NamedTuple):
    """A part that was replayed, and photons bin by bin where the cover glass is watched."""

    run: Replay
    bins: Optional[list[int]]
    warnings: list[str]


def replay(
    client: Client,
    recorded: Any,
    *,
    rows: Optional[int] = None,
    progress: Progress = None,
    **options: Any,
) -> Replay:
    """Replays one recording of histograms, its rows spread over the workers of ``client``.

    The result is that of :func:`dtof.replay` on the whole, its events byte for byte. One warning is
    not made: that the first axis looks like the bins, which no part can tell. No worker holds more
    than a few parts at a time; the events come back and have to fit into memory.

    ``recorded`` is a dask array, or the name of an ``.npy`` file that every worker can read. Its
    axes are those of :func:`dtof.replay`: ``axes`` names them, without it the last is the bins, the
    one before columns, and all others rows. A chunk of a dask array is a part: it has all columns
    and bins, and rows of one capture or whole captures. Of a file a part has ``rows`` rows, or
    captures if it has several; without ``rows`` about three parts a thread. With ``binning`` parts
    begin and end at multiples of 2, 4 or 8 rows, whole blocks.

    How long histograms lasted depends on all of them. So a recording is read twice: first the
    photons of each pixel are counted, then rows are replayed. ``progress(done, all)`` is called
    with each part that is done, twice for each.
    """
    look_at(client)
    if options.get("settings") is not None:
        options["settings"] = os.path.abspath(options["settings"])
    said = arguments(options)
    _native.check_options(said)
    version, axes = _native.__version__, options.get("axes")
    if isinstance(recorded, (str, os.PathLike)):
        name = os.path.abspath(recorded)
        blocks = blocks_of_file(client, version, name, axes, rows)
    elif rows is not None:
        raise _native.Error("rows is for files: the chunks of a dask array are its parts")
    else:
        name, blocks = "the array", recorded
    whole = split(blocks, axes, name)

    counted = _on_all(client, _count, whole, version, said, [()] * len(whole.parts), progress, 0)
    counts = numpy.concatenate([pixels for pixels, _ in counted])
    # Part of the graph, and not of a worker's memory: it is there when that worker is not.
    of_all = delayed(counts.tobytes(), pure=False)
    array = (whole.rows, whole.columns, whole.captures)
    cut_off = sum(cut for _, cut in counted)
    more = [(array, of_all, cut_off, part.row * whole.columns) for part in whole.parts]
    done = _on_all(client, _replay, whole, version, said, more, progress, len(whole.parts))
    warn(done[0].warnings)
    return _joined(done, name)


def _on_all(
    client: Client,
    job: Any,
    whole: Split,
    version: str,
    said: Given,
    more: list[Any],
    progress: Progress,
    before: int,
) -> list[Any]:
    """``job`` of all parts."""
    task = delayed(job, pure=False)
    tasks = [
        task(version, part.name, part.block, said, *of_part)
        for part, of_part in zip(whole.parts, more)
    ]
    futures = client.compute(tasks)
    told = None
    if progress is not None:
        told = lambda done, parts: progress(before + done, 2 * parts)  # noqa: E731
    return wait_for(client, futures, told)


def _count(version: str, name: str, block: Any, said: Given) -> tuple[numpy.ndarray, int]:
    """The photons of each pixel, in the order of addresses, and those that were cut off."""
    begin(version)
    loaded = _native.load(recording(block, name), said)
    counts = numpy.frombuffer(loaded["counts"], dtype="<u8").reshape(-1, loaded["shape"][-1])
    return counts.sum(axis=1, dtype="<u8"), loaded["cut_off"]


def _replay(
    version: str,
    name: str,
    block: Any,
    said: Given,
    array: tuple[int, int, int],
    of_all: bytes,
    cut_off: int,
    first: int,
) -> Done:
    """The events of a part of the whole."""
    begin(version)
    done = _native.replay(recording(block, name), said, None, (*array, of_all, cut_off, first))
    return Done(quietly(done), done["bins"], done["warnings"])


def _joined(done: list[Done], name: str) -> Replay:
    """One run of its parts."""
    runs = [part.run for part in done]
    # As bytes, so that those between the fields stay.
    records = numpy.concatenate([run.events.view(f"V{EVENT.itemsize}") for run in runs])
    events = records.view(EVENT)
    order = numpy.lexsort((events["pixel"], events["level"], events["cycle"]))
    events = records[order].view(EVENT)
    first = runs[0]
    statistics = {**first.statistics, **totals(run.statistics for run in runs), "input": name}
    # What is known of the whole each part says.
    statistics["cut_off"] = first.statistics["cut_off"]
    bins = [part.bins for part in done if part.bins is not None]
    if bins:
        pixels = statistics["pixels"] - len(statistics["settings"].get("masked", []))
        photons = [sum(of_bin) for of_bin in zip(*bins)]
        statistics["cover_glass"] = _native.cover_glass(
            first.toml, photons, statistics["cycles"], max(pixels, 0)
        )
    return Replay(events, Array(*first.array), statistics, first.settings, first.toml)
