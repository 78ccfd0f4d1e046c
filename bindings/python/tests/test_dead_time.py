"""Right events and false alarms of a TDC with a dead time, with photons that numpy draws.

The TDC is blind for ``dead_time`` bins after each photon. Nothing here is shared with the simulator.
"""

import math
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


def photons(random, rates, cycles, dead_time, pixels=1):
    """Pixel, laser cycle and bin of each photon that the TDC is live for."""
    arrived = random.poisson(rates.sum(), pixels * cycles)
    edges = numpy.cumsum(rates) / rates.sum()
    bins = numpy.minimum(numpy.searchsorted(edges, random.random(arrived.sum())), BINS - 1)
    # In the order of laser cycles, and of bins within each.
    at, bins = divmod(numpy.sort(numpy.repeat(numpy.arange(arrived.size), arrived) * BINS + bins), BINS)
    kept = numpy.zeros(at.size, dtype=bool)
    # The next photon of each laser cycle that has more, the photon after its last, and the first live bin.
    end = numpy.cumsum(arrived)
    place = end - arrived
    live_from = numpy.zeros(arrived.size, dtype=int)
    while True:
        more = (place < end) & (live_from < BINS)
        place, end, live_from = place[more], end[more], live_from[more]
        if place.size == 0:
            break
        is_live = bins[place] >= live_from
        kept[place[is_live]] = True
        live_from[is_live] = bins[place[is_live]] + 1 + dead_time
        place += 1
    at, bins = at[kept], bins[kept]
    order = numpy.argsort(at % cycles, kind="stable")
    return (at // cycles)[order], (at % cycles)[order], bins[order]


def interval(count, of):
    """The interval of Wilson for a share, that of 95 %."""
    share, z = count / of, 1.96
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z * sqrt(share * (1 - share) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    return middle - half, middle + half


def run(seed, background, signal, dead_time, cycles, pixels=1, **options):
    random = numpy.random.default_rng(seed)
    pixel, cycle, bin = photons(random, light(background, signal), cycles, dead_time, pixels)
    options = {**WINDOW, "cycles": cycles, "dead_time": dead_time, **options}
    return dtof.photons(pixel, cycle, bin, **options)


def test_the_generator_blinds_for_the_dead_time():
    random = numpy.random.default_rng(1)
    for dead_time in (1, 20, BINS):
        pixel, cycle, bin = photons(random, light(6, 0.5), 2000, dead_time, 2)
        one = (pixel[1:] == pixel[:-1]) & (cycle[1:] == cycle[:-1])
        assert (bin[1:] - bin[:-1])[one].min(initial=dead_time + 1) > dead_time
    # Only the first photon: 1 - exp(-6.5) of the laser cycles have one.
    assert abs(pixel.size / 4000 - (1 - math.exp(-6.5))) < 0.005


@pytest.mark.parametrize(
    "background,dead_time,cycles,most",
    [
        (5.5, BINS, 2_000_000, 1900),
        (2.5, BINS, 300_000, 130),
        (5.5, 20, 200_000, 100),
    ],
)
def test_events_are_right_under_strong_light(background, dead_time, cycles, most):
    done = run(2, background, 0.5, dead_time, cycles, l2=2000)
    error = done.events["depth_bins"] - PLACE
    wrong = numpy.abs(error) > 3
    right = error[~wrong]
    low, high = interval(wrong.sum(), wrong.size)
    print(
        f"{background} + 0.5 photons, dead for {dead_time}: {wrong.sum()} of {wrong.size} wrong "
        f"({100 * low:.2f} to {100 * high:.2f} %), {cycles / right.size:.0f} laser cycles a right "
        f"event, mean error {right.mean():+.3f} bins"
    )
    assert wrong.mean() <= 0.012
    assert cycles / right.size <= most
    assert abs(right.mean()) <= 0.15
    assert done.statistics["settings"]["dead_time"] == dead_time
    assert done.statistics["settings"]["dead_time_from"] == "settings"


@pytest.mark.parametrize("dead_time", [20, BINS])
def test_false_alarms_are_as_many_as_wanted(dead_time):
    cycles, pixels = 100_000, 30
    done = run(3, 6, 0, dead_time, cycles, pixels, columns=pixels, l2=1000)
    alarms, empty = len(done.events), done.statistics["expired"]
    low, high = interval(alarms, alarms + empty)
    print(
        f"dead for {dead_time}: {alarms} of {alarms + empty} exposures with a false alarm, "
        f"{100 * low:.2f} to {100 * high:.2f} %"
    )
    assert alarms + empty >= 3000
    assert alarms / (alarms + empty) <= 0.013


def test_a_pixel_decides_as_a_replay_and_counts_what_it_cannot_see():
    random = numpy.random.default_rng(4)
    _, cycle, bin = photons(random, light(5.5, 0.5), 8000, BINS)
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
