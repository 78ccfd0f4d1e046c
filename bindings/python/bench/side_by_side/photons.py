"""Single photons whose true distances are known: two simulated scenes and a recording.

Photons are ideal: Poisson counts, no dead time, a pulse that does not change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

import dtof

MM_PER_PS = 0.149896229  # half the speed of light
# The minimum of photons in the three highest bins of a frame, the best of 5, 6, 7 and 10: in general, and
# for find_peaks on the recording.
FRAMES_MIN_PHOTONS, FIND_PEAKS_MIN_PHOTONS = 6, 10
HALF_WIDTHS = 1.75, 4.0  # dtof's window for the recording, in bins


@dataclass(frozen=True)
class Photons:
    """One element per photon, in order of laser cycle."""

    pixel: np.ndarray
    cycle: np.ndarray
    bin: np.ndarray
    cycles: int

    def __len__(self) -> int:
        return self.pixel.size


@dataclass(frozen=True)
class Scene:
    """Photons of targets and background, and photons of background only."""

    name: str
    description: str
    pixels: int
    bins: int
    bin_width_ps: float
    sigma_bins: float  # of the pulse
    truth_mm: np.ndarray  # of each pixel
    photons: Photons
    empty: Photons  # to find thresholds
    empty_again: Photons  # to count false alarms
    centroid_half_width: int  # bins each side of the peak in numpy's centroid: the better of 2 and 3
    find_peaks_min_photons: int = FRAMES_MIN_PHOTONS  # of a frame, with find_peaks
    frames_min_photons: int = FRAMES_MIN_PHOTONS  # of a frame, with arrays
    half_widths: Optional[tuple[float, float]] = None  # dtof's window for a pulse that falls slowly
    fit_offset: bool = False  # if the offset of the sensor is unknown

    @property
    def mm_per_bin(self) -> float:
        return self.bin_width_ps * MM_PER_PS


def draw(random, background, cycles, bins, signal=None, position=None, sigma=1.0) -> Photons:
    """Photons of each pixel: ``background`` a bin and laser cycle, ``signal`` a laser cycle."""
    numbers = random.poisson(background * bins * cycles)
    pixel = np.repeat(np.arange(numbers.size, dtype="u2"), numbers)
    bin = random.integers(0, bins, pixel.size, dtype="u2")
    if signal is not None:
        numbers = random.poisson(signal * cycles)
        of = np.repeat(np.arange(numbers.size, dtype="u2"), numbers)
        arrived = np.floor(random.normal(position[of], sigma))
        seen = (arrived >= 0) & (arrived < bins)
        pixel = np.concatenate([pixel, of[seen]])
        bin = np.concatenate([bin, arrived[seen].astype("u2")])
    return in_order(random, pixel, bin, cycles)


def in_order(random, pixel, bin, cycles) -> Photons:
    """Gives every photon a random laser cycle, and sorts them by it."""
    cycle = random.integers(0, cycles, pixel.size, dtype="u2")
    order = np.argsort(cycle, kind="stable")
    return Photons(pixel[order], cycle[order], bin[order], cycles)


def simulated(
    name, description, seed, range_mm, background, signal, bin_width_ps, centroid_half_width, cycles, empty_cycles
):
    bins, sigma = 128, 1.0
    random = np.random.default_rng(seed)
    position = range_mm / (bin_width_ps * MM_PER_PS)
    return Scene(
        name=name,
        description=description,
        pixels=range_mm.size,
        bins=bins,
        bin_width_ps=bin_width_ps,
        sigma_bins=sigma,
        truth_mm=range_mm,
        photons=draw(random, background, cycles, bins, signal, position, sigma),
        empty=draw(random, background, empty_cycles, bins),
        empty_again=draw(random, background, empty_cycles, bins),
        centroid_half_width=centroid_half_width,
    )


def bright(pixels=1024, cycles=4000, empty_cycles=8000) -> Scene:
    """A room: every pixel has a bright target."""
    random = np.random.default_rng(1)
    return simulated(
        "bright",
        "a room; 0.3 to 1 signal photons a laser cycle, background of 0.005 a bin; bins of 250 ps",
        2,
        random.uniform(500, 4300, pixels),
        np.full(pixels, 0.005),
        np.exp(random.uniform(np.log(0.3), np.log(1), pixels)),
        250.0,
        3,
        cycles,
        empty_cycles,
    )


def outdoor(pixels=1024, cycles=6000, empty_cycles=8000) -> Scene:
    """Outdoors: sunlight is reflected like the laser, and far dark surfaces are dim."""
    random = np.random.default_rng(3)
    range_mm = random.uniform(6000, 18_000, pixels)
    reflectivity = np.exp(random.uniform(np.log(0.1), np.log(0.8), pixels))
    return simulated(
        "outdoor",
        "6 to 18 m, reflectivity of 0.1 to 0.8: 0.03 to 2 signal photons a laser cycle, "
        "background of 0.01 to 0.045 a bin; bins of 1 ns",
        4,
        range_mm,
        0.005 + 0.05 * reflectivity,
        0.97 * reflectivity * (10_000 / range_mm) ** 2,
        1000.0,
        2,
        cycles,
        empty_cycles,
    )


def scenes(file):
    """A function for each scene."""
    return {"bright": bright, "outdoor": outdoor, "recording": lambda: recorded(file)}


def recorded(file, parts=8, cycles=4000, empty_cycles=8000, added=0.01) -> Scene:
    """The centre zone of a TMF8820 in front of a plane, from 30 mm on.

    Every recorded photon gets a random laser cycle of its capture, as in ``dtof replay``; the
    brightest zone has half a photon per laser cycle. A pixel is one of ``parts`` disjoint parts of a
    capture. Background is added, because the recording has almost none.
    """
    log = dtof.load(file)
    zones, truth = log.counts[:, 0], log.truth_mm[:, 0, 4]
    zones, truth = zones[truth > 29.9], truth[truth > 29.9]
    random = np.random.default_rng(5)
    lasted = zones.sum(2).max(1) / 0.5
    share = np.minimum(cycles / lasted, 1 / parts)
    # The parts of a histogram, and the rest.
    shares = np.column_stack([share] * parts + [1 - parts * share])
    split = random.multinomial(zones[:, 4].astype("i8"), shares[:, None])[..., :parts]  # captures, bins, parts
    counts = split.transpose(0, 2, 1).reshape(-1, log.counts.shape[-1])
    pixels, bins = counts.shape
    of = np.repeat(np.arange(counts.size), counts.ravel())
    background = np.full(pixels, added)
    sun = draw(random, background, cycles, bins)
    return Scene(
        name="recording",
        description=f"a TMF8820 and a plane at 30 to 400 mm, {len(truth)} captures of {parts} parts; "
        f"background of {added} a bin added; bins of 92.1 ps",
        pixels=pixels,
        bins=bins,
        bin_width_ps=log.bin_width_ps,
        sigma_bins=1.0,
        truth_mm=np.repeat(truth - log.offset_mm, parts),
        photons=in_order(
            random,
            np.concatenate([sun.pixel, (of // bins).astype("u2")]),
            np.concatenate([sun.bin, (of % bins).astype("u2")]),
            cycles,
        ),
        empty=draw(random, background, empty_cycles, bins),
        empty_again=draw(random, background, empty_cycles, bins),
        centroid_half_width=2,
        find_peaks_min_photons=FIND_PEAKS_MIN_PHOTONS,
        half_widths=HALF_WIDTHS,
        fit_offset=True,
    )
