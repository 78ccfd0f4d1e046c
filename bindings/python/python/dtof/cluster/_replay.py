"""One recording, its rows on several workers."""

from __future__ import annotations

import os
from typing import Any, NamedTuple, Optional

import numpy
from dask.delayed import delayed
from distributed import Client

from .. import _native
from .._arrays import EVENT, Array, native_input
from .._keywords import ReplayOptions
from .._options import Keywords, absolute, arguments
from .._run import Replay, quiet_result
from .._warn import warn
from ._client import Progress, check_workers, totals, wait_for
from ._split import Split, blocks_of_file, split
from ._worker import begin


class Done(NamedTuple):
    """A replayed part, and its photons of each bin if the cover glass is monitored."""

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

    The result is that of :func:`dtof.replay` on the whole recording, its events byte for byte. One
    warning is missing: that another axis looks like the bins, which a part cannot detect. No
    worker holds more than a few parts at a time; the events are returned and have to fit into
    memory.

    A part does not show the settings of the whole, so ``settings`` or an option such as ``rule`` is needed:
    ``settings=dtof.calibrate("large.npy")``, for example.

    ``recorded`` is a dask array, or the name of an ``.npy`` file that every worker can read. Its
    axes are those of :func:`dtof.replay`: named by ``axes``; by default the last axis is the bins,
    the one before columns, and all others rows. A chunk of a dask array is a part: it must have all
    columns and bins, and rows of one capture or whole captures. A part of a file has ``rows`` rows,
    or captures if there are several; by default there are about three parts per thread. With
    ``binning`` parts must begin and end at multiples of 2, 4 or 8 rows.

    The duration of histograms depends on all of them, so a recording is read twice: first the
    photons of each pixel are counted, then rows are replayed. ``progress(done, all)`` is called
    after each part, twice for each.
    """
    check_workers(client)
    options["settings"] = absolute(options.get("settings"))
    keywords = arguments(ReplayOptions, options)
    _native.check_options(keywords)
    version, axes = _native.__version__, options.get("axes")
    if isinstance(recorded, (str, os.PathLike)):
        name = os.path.abspath(recorded)
        blocks = blocks_of_file(client, version, name, axes, rows)
    elif rows is not None:
        raise _native.Error("rows is for files: the chunks of a dask array are its parts")
    else:
        name, blocks = "the array", recorded
    layout = split(blocks, axes, name)
    _native.check_part_options(keywords)

    counted = _on_all(client, _count, layout, version, keywords, [()] * len(layout.parts), progress, 0)
    counts = numpy.concatenate([pixels for pixels, _ in counted])
    # In the task graph, not in a worker's memory: it survives the loss of a worker.
    photons_of_all = delayed(counts.tobytes(), pure=False)
    array = (layout.rows, layout.columns, layout.captures)
    cut_off = sum(cut for _, cut in counted)
    more = [(array, photons_of_all, cut_off, part.row * layout.columns) for part in layout.parts]
    done = _on_all(client, _replay, layout, version, keywords, more, progress, len(layout.parts))
    warn(done[0].warnings)
    return _joined(done, name)


def _on_all(
    client: Client,
    job: Any,
    layout: Split,
    version: str,
    keywords: Keywords,
    more: list[Any],
    progress: Progress,
    before: int,
) -> list[Any]:
    """Runs ``job`` for all parts."""
    task = delayed(job, pure=False)
    tasks = [task(version, part.name, part.block, keywords, *of_part) for part, of_part in zip(layout.parts, more)]
    futures = client.compute(tasks)
    report = None
    if progress is not None:
        report = lambda done, parts: progress(before + done, 2 * parts)  # noqa: E731
    return wait_for(client, futures, report)


def _count(version: str, name: str, block: Any, keywords: Keywords) -> tuple[numpy.ndarray, int]:
    """The photons of each pixel, in the order of addresses, and the number of photons cut off."""
    begin(version)
    loaded = _native.load(native_input(block, name), keywords)
    counts = numpy.frombuffer(loaded["counts"], dtype="<u8").reshape(-1, loaded["shape"][-1])
    return counts.sum(axis=1, dtype="<u8"), loaded["cut_off"]


def _replay(
    version: str,
    name: str,
    block: Any,
    keywords: Keywords,
    array: tuple[int, int, int],
    photons_of_all: bytes,
    cut_off: int,
    first: int,
) -> Done:
    """Replays a part."""
    begin(version)
    done = _native.replay(native_input(block, name), keywords, None, (*array, photons_of_all, cut_off, first))
    return Done(quiet_result(done), done["bins"], done["warnings"])


def _joined(done: list[Done], name: str) -> Replay:
    """Joins the parts to one run."""
    runs = [part.run for part in done]
    # As bytes, to preserve the padding.
    records = numpy.concatenate([run.events.view(f"V{EVENT.itemsize}") for run in runs])
    events = records.view(EVENT)
    order = numpy.lexsort((events["pixel"], events["level"], events["cycle"]))
    events = records[order].view(EVENT)
    first = runs[0]
    statistics = {**first.statistics, **totals(run.statistics for run in runs), "input": name}
    # Every part has the number for the whole recording.
    statistics["cut_off"] = first.statistics["cut_off"]
    bins = [part.bins for part in done if part.bins is not None]
    if bins:
        pixels = statistics["pixels"] - len(statistics["settings"].get("masked", []))
        photons = [sum(of_bin) for of_bin in zip(*bins)]
        statistics["cover_glass"] = _native.cover_glass(first.toml, photons, statistics["cycles"], max(pixels, 0))
    known = [run.confidence for run in runs if run.confidence is not None]
    confidence = numpy.fmax.reduce(known) if known else None
    return Replay(events, Array(*first.array), statistics, first.settings, first.toml, confidence)
