"""The speed of the package relative to the program, with a photon list and with histograms.

    python bench/speed.py PROGRAM [PHOTONS]

PHOTONS is 100 million by default. Fails below 0.8 of the program's speed. Both use all cores; the
fastest of three runs counts.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy

import dtof

PIXELS, BINS = 64 * 64, 128
MIN_RATIO = 0.8


def fastest(run):
    times = []
    for _ in range(3):
        begun = time.perf_counter()
        run()
        times.append(time.perf_counter() - begun)
    return min(times)


def histograms(photons):
    random = numpy.random.default_rng(1)
    counts = random.poisson(0.5 * photons / PIXELS / BINS, (64, 64, BINS)).astype("u4")
    counts[..., 60] += int(0.5 * photons / PIXELS)
    return counts


def photon_list(photons):
    random = numpy.random.default_rng(1)
    records = numpy.empty(photons, dtype=[("pixel", "<u2"), ("cycle", "<u4"), ("bin", "<u2")])
    records["cycle"] = numpy.arange(photons) // PIXELS  # a photon a pixel and laser cycle
    records["pixel"] = random.integers(0, PIXELS, photons, dtype="u2")
    is_signal = random.random(photons, dtype="f4") < 0.5
    records["bin"] = numpy.where(is_signal, 60, random.integers(0, BINS, photons, dtype="u2"))
    return records


def main():
    program = sys.argv[1]
    photons = int(float(sys.argv[2])) if len(sys.argv) > 2 else 100_000_000
    with tempfile.TemporaryDirectory() as folder:
        # Settings, so that none are looked for in the recording.
        settings = Path(folder) / "defaults.toml"
        settings.write_text("")
        options = {"settings": settings, "cycles": 10_000_000, "columns": 64}
        failed = False
        for name, make in [("histograms", histograms), ("photon list", photon_list)]:
            array = make(photons)
            file = Path(folder) / "input.npy"
            numpy.save(file, array)
            texts = [f"--{key}={value}" for key, value in options.items()]
            command = [program, "replay", "--input", file, "--out", Path(folder) / "out", "--no-csv", "--quiet", *texts]
            theirs = fastest(lambda: subprocess.run(command, check=True))
            calls = {"array": lambda: dtof.replay(array, **options)}
            if name == "photon list":
                columns = [array[field].copy() for field in ("pixel", "cycle", "bin")]
                calls["columns"] = lambda: dtof.photons(*columns, **options)
            for call, run in calls.items():
                ours = fastest(run)
                ratio = theirs / ours
                failed |= ratio < MIN_RATIO
                print(
                    f"{name} ({call}): program {theirs:.2f} s, package {ours:.2f} s, {ratio:.2f} of its speed",
                    flush=True,
                )
    sys.exit(failed)


if __name__ == "__main__":
    main()
