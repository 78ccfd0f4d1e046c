"""Photons of one laser cycle in one bin count once, in rain that numpy draws.

A drop sends tens of photons back in one laser cycle. Nothing here is shared with the simulator.
"""

import warnings

import numpy
import pytest

import dtof

BINS = 128
PLACE = 80.3
BACKGROUND = 0.05 * BINS
DROP, DROP_EVERY = 30, 200
WINDOW = {"rule": "window", "window": 3, "sigma_bins": 1, "x": 4, "l1": 40, "l2": 2000, "false_alarm": 0.01}


def pulses(random, mean, places):
    """Laser cycle and bin of the photons of a pulse of one bin in each laser cycle, ``mean`` on average."""
    photons = random.poisson(mean, places.size)
    cycle = numpy.repeat(numpy.arange(places.size), photons)
    return cycle, numpy.floor(random.normal(places[cycle], 1)).astype(int)


def drops(random, cycles):
    """Laser cycle and bin of the photons of drops: one in 200 laser cycles, in a random place."""
    wet = numpy.flatnonzero(random.random(cycles) < 1 / DROP_EVERY)
    drop, bin = pulses(random, DROP, random.integers(4, 64, wet.size))
    return wet[drop], bin


def photons(random, cycles):
    """Laser cycle and bin of each photon: an even background, a target, and drops. None is past bin 127."""
    number = random.poisson(BACKGROUND, cycles)
    parts = [
        (numpy.repeat(numpy.arange(cycles), number), random.integers(0, BINS, number.sum())),
        pulses(random, 0.5, numpy.full(cycles, PLACE)),
        drops(random, cycles),
    ]
    cycle, bin = (numpy.concatenate(part) for part in zip(*parts))
    inside = (bin >= 0) & (bin < BINS)
    order = numpy.argsort(cycle[inside], kind="stable")
    return cycle[inside][order], bin[inside][order]


def test_photons_that_repeat_are_as_if_they_were_not_there():
    cycle, bin = photons(numpy.random.default_rng(3), 20_000)
    pixel = numpy.arange(bin.size) % 3
    once = dtof.photons(pixel, cycle, bin, once_per_bin=True, cycles=20_000, columns=3, **WINDOW)
    cycle, pixel, bin = numpy.unique([cycle, pixel, bin], axis=1)
    without = dtof.photons(pixel, cycle, bin, cycles=20_000, columns=3, **WINDOW)
    assert len(once.events) > 50
    assert (once.events == without.events).all()
    assert once.statistics["settings"]["once_per_bin"] is True
    assert without.statistics["settings"]["once_per_bin"] is False
    # Each photon is counted as one of them.
    assert once.statistics["repeated"] > 1000 and without.statistics["repeated"] == 0
    assert once.statistics["photons"] - once.statistics["repeated"] == without.statistics["photons"]


def test_a_pixel_decides_as_a_replay():
    cycle, bin = photons(numpy.random.default_rng(4), 8000)
    options = {**WINDOW, "once_per_bin": True}
    done = dtof.photons(numpy.zeros_like(bin), cycle, bin, cycles=8000, **options)
    pixel = dtof.Pixel(**options)
    ends = numpy.searchsorted(cycle, numpy.arange(8001))
    events = []
    for now in range(8000):
        # In two parts: they are of one laser cycle.
        of_cycle = bin[ends[now] : ends[now + 1]]
        pixel.count(of_cycle[:4])
        pixel.count(of_cycle[4:])
        event = pixel.end_laser_cycles()
        if event is not None:
            events.append(event)
    assert (numpy.array(events, dtype=dtof.EVENT) == done.events).all()
    assert pixel.settings["detection"]["once_per_bin"] is True
    assert pixel.statistics["repeated"] > 500 and len(events) > 20
    for name in ("photons", "rejected", "gated_out", "repeated", "events", "expired"):
        assert pixel.statistics[name] == done.statistics[name]


def test_a_pixel_counts_one_photon_a_bin_up_to_the_end_of_laser_cycles():
    pixel = dtof.Pixel(once_per_bin=True)
    pixel.count([5, 5, 9])
    pixel.count(5)
    # All are of one of the three.
    pixel.end_laser_cycles(3)
    pixel.count([5, 5])
    assert pixel.histogram[[5, 9]].tolist() == [2, 1] and pixel.histogram.sum() == 3
    assert pixel.statistics["repeated"] == 3 and pixel.statistics["photons"] == 6
    every = dtof.Pixel()
    every.count([5, 5, 9])
    assert every.histogram.sum() == 3 and every.statistics["repeated"] == 0


@pytest.mark.parametrize("bins", [8, 16, 32, 1024])
def test_photons_past_the_last_bin_are_rejected_each(bins):
    pixel = dtof.Pixel(bins=bins, once_per_bin=True)
    pixel.count([bins, bins, bins + 1, 65_535, 65_535, 3, 3])
    assert pixel.statistics["rejected"] == 5
    assert pixel.statistics["repeated"] == 1
    assert pixel.histogram.sum() == 1


def test_histograms_and_other_values_are_refused():
    counts = numpy.full((1, BINS), 5)
    with pytest.raises(dtof.Error, match="^once_per_bin needs photons"):
        dtof.replay(counts, once_per_bin=True)
    assert dtof.replay(counts, once_per_bin=False, cycles=100).statistics["repeated"] == 0
    for call in (
        lambda: dtof.photons([0], [0], [5], columns=1, once_per_bin="maybe"),
        lambda: dtof.replay(counts, once_per_bin="maybe"),
        lambda: dtof.Pixel(once_per_bin="maybe"),
    ):
        with pytest.raises(dtof.Error, match="^once_per_bin .maybe.: is a text; must be: True or False"):
            call()


def test_more_than_half_a_photon_in_a_bin_is_warned_of():
    def run(rate, **options):
        number = numpy.random.default_rng(5).poisson([rate, 0.2], (2000, 2))
        cycle, pixel = numpy.repeat(numpy.argwhere(number + 1), number.ravel(), axis=0).T
        return dtof.photons(pixel, cycle, 60, columns=2, cycles=2000, bin_width_ps=250, **options)

    with pytest.warns(UserWarning, match="1 of 2 pixels have .* pixel 0 0.[67].* in bin 60") as warned:
        run(0.7, once_per_bin=True)
    assert len(warned) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(0.7)
        run(0.4, once_per_bin=True)
