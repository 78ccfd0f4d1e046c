"""The client side: checks workers, and waits for results."""

from __future__ import annotations

import os
from collections.abc import Iterable
from importlib import metadata
from typing import Any, Callable, Optional

from distributed import Client, Future, as_completed

from .._native import Error, __version__

Progress = Optional[Callable[[int, int], Any]]

#: Counters of ``statistics`` that are summed over parts.
COUNTERS = (
    "photons",
    "events",
    "events_of_blocks",
    "events_confirmed",
    "pixels",
    "pixels_reporting",
    "held",
    "rejected",
    "saturated",
    "saturated_in_blocks",
    "gated_out",
    "masked",
    "deferred",
    "expired",
    "expired_deferred",
    "ended_full",
    "blind_looks",
    "repeated",
    "not_replayed",
    "cut_off",
)


def totals(statistics: Iterable[dict[str, Any]]) -> dict[str, int]:
    """The sums of all counters."""
    sums = dict.fromkeys(COUNTERS, 0)
    for one in statistics:
        for name in COUNTERS:
            sums[name] += one[name]
    return sums


def check_workers(client: Any, folder: Optional[str] = None) -> None:
    """Checks that workers have this version of dtof, and ``folder``.

    Workers that join later are checked by their tasks.
    """
    if not isinstance(client, Client):
        raise Error(f"client: {type(client).__name__}: must be a distributed.Client")
    if client.asynchronous:
        raise Error("client: is asynchronous: must be synchronous")
    # Only the standard library: a worker may lack dtof.
    for worker, version in client.run(metadata.version, "dtof", on_error="return").items():
        if isinstance(version, metadata.PackageNotFoundError):
            raise Error(f"worker {worker} has no dtof: install it there, too")
        # A worker that was lost meanwhile has no answer.
        if isinstance(version, str):
            check_version(f"worker {worker}", version)
    if folder is None:
        return
    for worker, is_there in client.run(os.path.isdir, folder, on_error="return").items():
        if is_there is False:
            raise Error(f"{folder}: worker {worker} has no such folder: make one that all share")


def check_version(who: str, version: str, expected: str = __version__) -> None:
    """Checks that ``version`` is the expected one."""
    if version != expected:
        raise Error(f"{who} has dtof {version}, not {expected}: install the same everywhere")


def wait_for(client: Client, futures: list[Future[Any]], progress: Progress, keep_errors: bool = False) -> list[Any]:
    """The results of ``futures``, in their order.

    The first error cancels the others and is raised, unless ``keep_errors`` keeps errors as results.
    """
    places = {future.key: place for place, future in enumerate(futures)}
    results: list[Any] = [None] * len(futures)
    done = 0
    try:
        for batch in as_completed(futures).batches():
            for future, result in zip(batch, _results(client, batch)):
                if isinstance(result, Exception) and not keep_errors:
                    raise result
                results[places[future.key]] = result
                # Frees the worker's memory.
                future.release()
                done += 1
                if progress is not None:
                    progress(done, len(futures))
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return results


def _results(client: Client, futures: list[Future[Any]]) -> list[Any]:
    """The results; errors take the place of missing ones."""
    try:
        return list(client.gather(futures))
    except Exception:
        return [_result(future) for future in futures]


def _result(future: Future[Any]) -> Any:
    try:
        return future.result()
    except Exception as error:
        return error


def line(error: BaseException) -> str:
    """An error in one line."""
    text = " ".join(str(error).split())
    return text if isinstance(error, Error) else f"{type(error).__name__}: {text}"
