"""A single pixel behaves like a pixel of a replay."""

import doctest

import numpy
import pytest

import dtof


@pytest.mark.parametrize(
    "options",
    [
        {"rule": "paper"},
        {"rule": "window", "sigma_bins": 0.6, "l1": 8, "tracking": True},
        {"gate": (10, 100), "echoes": 3, "bin_width_ps": 100, "offset_mm": -20.5},
    ],
)
def test_a_pixel_reports_as_in_a_replay(options):
    random = numpy.random.default_rng(2)
    photons = 6000
    cycle = numpy.sort(random.integers(0, 4000, photons))
    cycle[-1] = 3999
    near = random.random(photons) < 0.2
    bin = numpy.where(near, random.normal(50.3, 0.6, photons).astype(int), random.integers(0, 128, photons))
    run = dtof.photons(3, cycle, bin, settings={}, **options)
    pixel = dtof.Pixel(address=3, **options)
    events = []
    for now in range(4000):
        pixel.count(bin[cycle == now])
        event = pixel.end_laser_cycles()
        if event is not None:
            events.append(event)
    assert (numpy.array(events, dtype=dtof.EVENT) == run.events).all()
    assert len(events) >= 2 and pixel.cycle == 4000
    for name in ("photons", "rejected", "gated_out", "held", "expired"):
        assert pixel.statistics[name] == run.statistics[name]


def test_the_histogram_and_the_exposure_start_over_with_an_event():
    pixel = dtof.Pixel(l1=8, l2=100, x=4)
    pixel.count([5, 5, 9])
    pixel.end_laser_cycles(4)
    assert pixel.exposure == 4
    assert pixel.histogram[[5, 9]].tolist() == [2, 1] and pixel.histogram.sum() == 3
    pixel.count([5] * 20)
    event = pixel.end_laser_cycles(8)
    assert event["peak_bin"] == 5 and event["exposure"] == 12 and event["cycle"] == 11
    assert pixel.exposure == 0 and pixel.histogram.sum() == 0
    assert pixel.settings["detection"]["l2"] == 100


def test_the_examples_of_the_help():
    for module in (dtof, dtof._pixel):
        failed, tried = doctest.testmod(module)
        assert failed == 0 and tried > 0


def test_the_stubs_are_complete():
    import ast
    from pathlib import Path

    stub = ast.parse(Path(dtof.__file__).with_name("_native.pyi").read_text())
    named = {node.name for node in stub.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    there = {name for name in dir(dtof._native) if not name.startswith("_")}
    assert named == there
    (pixel,) = [node for node in stub.body if getattr(node, "name", "") == "Pixel"]
    named = {node.name for node in pixel.body if not node.name.startswith("_")}
    assert named == {name for name in dir(dtof._native.Pixel) if not name.startswith("_")}
    for name in dtof.__all__:
        assert name == "__version__" or getattr(dtof, name).__doc__, name
