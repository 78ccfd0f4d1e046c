"""A TDC with a dead time, with photons that numpy draws.

Nothing here is shared with the simulator.
"""

from math import erf, sqrt

import numpy
import pytest

import dtof

BINS = 128
PLACE = 80.3
WINDOW = {"rule": "window", "window": 3, "sigma_bins": 1, "x": 4, "l1": 40, "false_alarm": 0.01}


def light(background, signal):
    """Photons a laser cycle in each bin: an even background, and a Gaussian pulse of one bin."""
    below = numpy.array([(1 + erf((bin - PLACE) / sqrt(2))) / 2 for bin in range(BINS + 1)])
    return background / BINS + signal * numpy.diff(below)


def photons(random, rates, cycles):
    """Laser cycle and bin of the first photon of each laser cycle: a TDC is blind for all bins after it."""
    arrived = random.poisson(rates.sum(), cycles)
    edges = numpy.cumsum(rates) / rates.sum()
    bins = numpy.minimum(numpy.searchsorted(edges, random.random(arrived.sum())), BINS - 1)
    # In the order of laser cycles, and of bins within each.
    at, bins = divmod(numpy.sort(numpy.repeat(numpy.arange(cycles), arrived) * BINS + bins), BINS)
    cycle, first = numpy.unique(at, return_index=True)
    return cycle, bins[first]


def test_a_pixel_decides_as_a_replay_and_counts_what_it_cannot_see():
    random = numpy.random.default_rng(4)
    cycle, bin = photons(random, light(5.5, 0.5), 8000)
    done = dtof.photons(numpy.zeros_like(bin), cycle, bin, **WINDOW, dead_time=BINS, cycles=8000)
    pixel = dtof.Pixel(**WINDOW, dead_time=BINS)
    ends = numpy.searchsorted(cycle, numpy.arange(8001))
    events = []
    for now in range(8000):
        pixel.count(bin[ends[now] : ends[now + 1]])
        event = pixel.end_laser_cycles()
        if event is not None:
            events.append(event)
    assert (numpy.array(events, dtype=dtof.EVENT) == done.events).all()
    assert pixel.settings["sensor"]["dead_time"] == BINS
    assert done.statistics["settings"]["dead_time"] == BINS
    assert done.statistics["settings"]["dead_time_from"] == "settings"
    for name in ("ended_full", "blind_looks"):
        assert pixel.statistics[name] == done.statistics[name]
    # The last bins are live in one of 400 laser cycles; without light there are none.
    gated = dtof.Pixel(**WINDOW, dead_time=20, gate=(10, 127))
    for _ in range(2000):
        gated.count([3])
        gated.end_laser_cycles()
    assert gated.statistics["ended_full"] == 1 and gated.statistics["events"] == 0


@pytest.mark.parametrize(
    "options,words",
    [
        ({"dead_time": 20}, ["dead_time 20: is for rule window", "128 bins or more"]),
        ({"dead_time": 20, "rule": "average"}, ["dead_time 20: is for rule window"]),
        ({"dead_time": 1, **WINDOW, "binning": 1}, ["dead_time 1: cannot be used with binning"]),
        ({"dead_time": -1}, ["dead_time -1: must be a whole number from 0 to 65535"]),
        ({"dead_time": 2.5}, ["dead_time 2.5: must be a whole number"]),
        ({"dead_time": "many"}, ["dead_time 'many': is a text; must be: whole number, 0 to 65535"]),
    ],
)
def test_what_cannot_be_used_is_refused(options, words):
    for call in (
        lambda: dtof.photons([0], [0], [5], columns=1, settings={}, **options),
        lambda: dtof.Pixel(**options),
    ):
        with pytest.raises(dtof.Error) as caught:
            call()
        for word in words:
            assert word in str(caught.value)
        assert "\n" not in str(caught.value)


def test_histograms_need_their_laser_cycles():
    counts = numpy.full((1, BINS), 5)
    with pytest.raises(dtof.Error, match="dead_time 20: needs recorded_cycles"):
        dtof.replay(counts, **WINDOW, dead_time=20)
    done = dtof.replay(counts, **WINDOW, dead_time=20, recorded_cycles=1000, cycles=1000)
    assert done.statistics["not_replayed"] == 0
