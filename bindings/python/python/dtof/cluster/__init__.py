"""Many machines, with Dask distributed.

Recordings, rows of one recording, or seeds are spread over the workers of a ``distributed.Client``.
The results equal those of a single machine, byte for byte, with any number of workers and even if
workers are lost.

>>> from distributed import Client
>>> from dtof import cluster
>>> with Client(n_workers=2, dashboard_address=None) as client:  # doctest: +SKIP
...     many = cluster.recordings(client, files, out="results", bin_width_ps=250)
...     print(many.totals["events"], many.failed)

The tasks of a worker share its threads (``dask worker --nthreads``), unless ``RAYON_NUM_THREADS``
is set. Tasks release the GIL, so heartbeats continue. A running task that is cancelled, or whose
client is gone, runs to its end; its result is dropped, and its files are complete. A task that has
not begun is dropped.
"""

try:
    import dask.array
    import distributed
except ImportError as error:
    raise ImportError(f"dtof.cluster needs dask: pip install 'dtof[dask]' ({error})") from error

from ._recordings import Recorded, Recordings, recordings
from ._replay import replay
from ._seeds import Seeds, seeds

__all__ = ["Recorded", "Recordings", "Seeds", "recordings", "replay", "seeds"]

del dask, distributed
