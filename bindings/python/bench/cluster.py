"""The speed of two workers relative to one, with many recordings and with one in parts.

    python bench/cluster.py [PHOTONS]

PHOTONS is the total number (100 million). A worker has one thread. Events of many recordings are
written to a folder. Those of one recording in parts, 48 bytes for 40 photons here, return to the client
through the scheduler. The fastest of three runs counts. Fails if two workers have less than 1.6 times
the speed of one with many recordings, or 1.3 times with one. Needs two idle cores.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy
from distributed import Client, LocalCluster

from dtof import cluster

FILES, PIXELS, BINS = 16, (32, 32), 128
MIN_RATIO = {"many recordings": 1.6, "one in parts": 1.3}


def recordings(folder, photons):
    random = numpy.random.default_rng(1)
    each = photons / FILES / PIXELS[0] / PIXELS[1]
    files = []
    for number in range(FILES):
        counts = random.poisson(0.5 * each / BINS, (*PIXELS, BINS)).astype("u4")
        counts[..., 60] += int(0.5 * each)
        files.append(Path(folder) / f"{number}.npy")
        numpy.save(files[-1], counts)
    one = Path(folder) / "one.npy"
    numpy.save(one, numpy.concatenate([numpy.load(file) for file in files]))
    return files, one


def speeds(workers, files, one, folder):
    """Photons a second."""
    options = {"rule": "paper", "cycles": 10_000_000, "photons_per_cycle": 1}
    found = []

    def many():
        # A new folder: no results are reused.
        with tempfile.TemporaryDirectory(dir=folder) as out:
            return cluster.recordings(client, files, out=out, **options).totals

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None) as local,
        Client(local) as client,
    ):
        for replay in (many, lambda: cluster.replay(client, one, rows=32, **options).statistics):
            seconds = []
            for _ in range(3):
                begun = time.perf_counter()
                photons = replay()["photons"]
                seconds.append(time.perf_counter() - begun)
            found.append(photons / min(seconds))
    return found


def main():
    photons = int(float(sys.argv[1])) if len(sys.argv) > 1 else 100_000_000
    with tempfile.TemporaryDirectory() as folder:
        inputs = recordings(folder, photons)
        one, two = (speeds(workers, *inputs, folder) for workers in (1, 2))
    failed = False
    for (name, least), alone, both in zip(MIN_RATIO.items(), one, two):
        failed |= both / alone < least
        print(
            f"{name}: one worker {alone / 1e6:.1f}, two {both / 1e6:.1f} million photons a second, "
            f"ratio {both / alone:.2f}"
        )
    sys.exit(failed)


if __name__ == "__main__":
    main()
