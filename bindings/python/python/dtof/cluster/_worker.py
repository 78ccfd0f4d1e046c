"""The start of every task."""

from __future__ import annotations

import os

from distributed import get_worker

from .. import _native
from ._client import check_version


def begin(version: str) -> None:
    """Checks that client and worker have the same version, and sets the number of threads.

    All tasks of a worker share its threads.
    """
    worker = get_worker()
    check_version(f"worker {worker.address}", _native.__version__, version)
    if "RAYON_NUM_THREADS" not in os.environ:
        _native.use_threads(worker.state.nthreads)
