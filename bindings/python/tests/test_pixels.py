"""An array of pixels has the events of a list of photons."""

import doctest

import numpy
import pytest

import dtof

WINDOW = {"rule": "window", "sigma_bins": 0.8}


def photons(seed, cycles=600, rows=8, columns=8, bins=64):
    random = numpy.random.default_rng(seed)
    number = 12 * cycles
    cycle = numpy.sort(random.integers(0, cycles, number))
    cycle[-1] = cycles - 1
    pixel = random.integers(0, rows * columns, number)
    near = random.random(number) < 0.5
    bin = numpy.where(near, random.normal(30, 0.8, number).astype(int), random.integers(0, bins, number))
    return pixel, cycle, bin


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    "options",
    [
        {"rule": "paper"},
        {"rule": "average", "alpha": 3.5},
        WINDOW,
        {**WINDOW, "tracking": True},
        {**WINDOW, "neighbours": 8},
        {**WINDOW, "binning": 2, "patience": 30},
        {"echoes": 3},
        {"once_per_bin": True},
        {"mask": [3, 40], "gate": (5, 50)},
        {**WINDOW, "dead_time": 5},
    ],
)
def test_the_events_are_those_of_photons(options, seed):
    pixel, cycle, bin = photons(seed)
    run = dtof.photons(pixel, cycle, bin, columns=8, bins=64, settings={}, **options)
    pixels = dtof.Pixels(8, 8, 64, **options)
    events = []
    for now in range(600):
        at = cycle == now
        events.append(pixels.cycle(pixel[at], bin[at]))
    events = numpy.concatenate(events)
    assert run.events.size > 5 and (events == run.events).all()
    statistics = pixels.statistics
    for name in (
        "photons",
        "events",
        "events_of_blocks",
        "events_confirmed",
        "expired",
        "masked",
        "repeated",
        "gated_out",
        "rejected",
        "held",
        "pixels_reporting",
        "cycles",
    ):
        assert statistics[name] == run.statistics[name], name
    depth = dtof.depth_map(events, pixels.array)
    assert numpy.array_equal(depth, run.depth_map(of="events"), equal_nan=True)


def test_the_histogram_of_an_event():
    pixels = dtof.Pixels(1, 2, 16, keep_histograms=True, l1=4, x=4)
    for _ in range(8):
        events = pixels.cycle([1, 1], [5, 5])
        if events.size:
            break
    (event,) = events
    counts = pixels.histogram(event)
    assert counts[5] == event["peak_count"] and counts.sum() == 2 * event["exposure"]
    assert pixels.cycle(cycles=40).size == 0 and pixels.cycles == event["cycle"] + 41
    older = event.copy()
    older["cycle"] -= 1
    with pytest.raises(dtof.Error, match="is not the last of its pixel"):
        pixels.histogram(older)
    with pytest.raises(dtof.Error, match="keep_histograms True"):
        dtof.Pixels(1, 2).histogram(event)


def test_what_is_wrong_is_refused():
    pixels = dtof.Pixels(2, 2, 16)
    for given, words in [
        (([4], [1]), "pixel 4: there are 4 pixels"),
        (([-1], [1]), "pixel: must be from 0"),
        (([0, 1], [1]), "as long as each other"),
        (([0.5], [1]), "pixel is float64"),
        ((["a"], [1]), "pixel"),
    ]:
        with pytest.raises(dtof.Error, match=words):
            pixels.cycle(*given)
    for cycles in (0, 65_536, None):
        with pytest.raises(dtof.Error, match="cycles"):
            pixels.cycle(cycles=cycles)
    for sizes in [(0, 4), (300, 300), (1.5, 2), (2, 2, 12)]:
        with pytest.raises(dtof.Error):
            dtof.Pixels(*sizes)
    with pytest.raises(dtof.Error, match="frame is unknown"):
        dtof.Pixels(2, 2, frame=90)
    with pytest.raises(dtof.Error, match="mask 4: there are 4 pixels"):
        dtof.Pixels(2, 2, mask=[4])
    assert pixels.cycles == 0 and pixels.statistics["photons"] == 0


def test_the_example_of_the_help():
    failed, tried = doctest.testmod(dtof._pixels)
    assert failed == 0 and tried > 0
