"""What every task does first."""

from __future__ import annotations

import os

from distributed import get_worker

from .. import _native
from ._client import check_version


def begin(version: str) -> None:
    """Checks that client and worker are of one version, and takes as many threads as the worker has.

    Tasks of a worker share these threads, as many as tasks run at a time.
    """
    worker = get_worker()
    check_version(f"worker {worker.address}", _native.__version__, version)
    if "RAYON_NUM_THREADS" not in os.environ:
        _native.use_threads(worker.state.nthreads)
