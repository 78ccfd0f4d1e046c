"""Many machines, with Dask distributed.

Recordings, rows of one recording, or seeds are spread over the workers of a ``distributed.Client``.
What comes back is what one machine gives, byte for byte, on any number of workers and whatever of
them are lost on the way.

>>> from distributed import Client
>>> from dtof import cluster
>>> with Client(n_workers=2, dashboard_address=None) as client:  # doctest: +SKIP
...     many = cluster.recordings(client, files, out="results", bin_width_ps=250)
...     print(many.totals["events"], many.failed)

A worker uses as many threads for all of its tasks as it has (``dask worker --nthreads``), unless
``RAYON_NUM_THREADS`` says otherwise. Work leaves its interpreter free, so that its heartbeats go
on. A task that is cancelled, or whose client is gone, runs to its end if it has begun; what comes of
it is dropped, files that it writes appear whole. One that has not begun is forgotten.
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
