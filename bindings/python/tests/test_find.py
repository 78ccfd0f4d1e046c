"""Calibration, comparison and tuning are those of the program."""

import csv
import json
import shlex

import numpy
import pytest

import dtof


@pytest.fixture(scope="module")
def counts():
    random = numpy.random.default_rng(11)
    counts = random.poisson(20.0, (8, 8, 64)).astype("u4")
    for row in range(8):
        pulse = numpy.exp(-0.5 * ((numpy.arange(64) - 20 - 3 * row - 0.3) / 0.8) ** 2)
        counts[row] += random.poisson(400 * pulse, (8, 64)).astype("u4")
    return counts


OPTIONS = {"recorded_cycles": 20_000, "bin_width_ps": 200}
TEXTS = ["--recorded-cycles", "20000", "--bin-width-ps", "200"]


def test_calibrate(program, tmp_path, counts):
    numpy.save(tmp_path / "counts.npy", counts)
    out = tmp_path / "dtof.toml"
    program("calibrate", "--input", tmp_path / "counts.npy", "--out", out, "--quiet", *TEXTS)
    found = dtof.calibrate(counts, **OPTIONS)
    assert found.toml == out.read_text()
    from_file = dtof.calibrate(tmp_path / "counts.npy", **OPTIONS)
    assert from_file.report == out.with_suffix(".html").read_text()
    assert found.settings["sensor"]["sigma_bins"] == pytest.approx(0.8, abs=0.1)
    assert found.found["hot pixels"] and dict(found.remarks)
    # Saved settings are accepted, and not overwritten.
    found.save(tmp_path / "mine.toml")
    assert dtof.replay(counts, settings=tmp_path / "mine.toml").events.size > 0
    with pytest.raises(dtof.Error, match="mine.toml"):
        found.save(tmp_path / "mine.toml")
    again = dtof.calibrate(counts, settings=tmp_path / "mine.toml", target_mm=1000, **OPTIONS)
    assert "pulse" in again.changes and not found.changes


def test_a_flat_target_gives_the_offset_of_each_pixel():
    random = numpy.random.default_rng(12)
    position = numpy.where(numpy.arange(16) % 4 < 2, 30.2, 30.8).reshape(4, 4, 1)  # 0.6 bins are 18 mm
    pulse = numpy.exp(-0.5 * ((numpy.arange(64) + 0.5 - position) / 0.8) ** 2)
    counts = random.poisson(10 + 2000 * pulse)
    found = dtof.calibrate(counts, target_mm=900, fov=(2, 2), **OPTIONS)
    offsets = numpy.reshape(found.settings["sensor"]["offsets_mm"], (4, 4))
    assert offsets[:, :2].mean() - offsets[:, 2:].mean() == pytest.approx(18, abs=1.5)
    assert "offsets of pixels" in found.found
    # The same as settings, as a list and as an array.
    run = dtof.replay(counts, settings=found, min_count=200)
    assert run.array.offsets_mm == pytest.approx(offsets.ravel(), abs=1 / 256)
    assert numpy.nanmean(abs(dtof.depth_map(run.events, run.array) - 900)) < 6
    for given in (offsets, offsets.ravel().tolist()):
        again = dtof.replay(counts, settings=found, min_count=200, offsets_mm=given)
        assert (again.events == run.events).all()
    assert dtof.replay(counts, offsets_mm=[]).array.offsets_mm is None


def test_compare(program, tmp_path, counts):
    numpy.save(tmp_path / "counts.npy", counts)
    truth = numpy.repeat((20.8 + 3 * numpy.arange(8)) * 200 * 0.149896, 8).reshape(8, 8)
    numpy.save(tmp_path / "truth.npy", truth)
    out = tmp_path / "out"
    program(
        "compare",
        "--input",
        tmp_path / "counts.npy",
        "--truth",
        tmp_path / "truth.npy",
        "--out",
        out,
        "--quiet",
        "--cycles",
        "6000",
        *TEXTS,
    )
    steps = []
    found = dtof.compare(counts, truth=truth, cycles=6000, progress=lambda *step: steps.append(step), **OPTIONS)
    assert found.toml == (out / "dtof.toml").read_text()
    other_order = dtof.compare(counts, truth=numpy.asfortranarray(truth), cycles=6000, **OPTIONS)
    assert other_order.methods == found.methods
    for rows, name in [(found.methods, "methods.csv"), (found.stress, "stress.csv")]:
        with open(out / name) as file:
            assert rows == list(csv.DictReader(file))
    names, shares = zip(*steps)
    assert "tries all methods" in names and found.answer["compared"]
    assert shares[0] == 0 and shares[-1] == 1 and list(shares) == sorted(shares)
    assert numpy.diff(shares).max() < 0.2
    assert found.chart.startswith("<svg")


def test_compare_a_scene(program, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text("""
columns = 4
rows = 4
bins = 32
background = 0.02
[[surface]]
range_mm = 600
reflectivity = 0.5
""")
    out = tmp_path / "out"
    program("compare", "--scene", scene, "--out", out, "--quiet", "--cycles", "7000")
    found = dtof.compare(scene=scene, cycles=7000)
    assert found.toml == (out / "dtof.toml").read_text()


@pytest.mark.parametrize("rule", ["paper", "window"])
def test_tune(program, rule):
    options = {"background": 0.05, "signal": 0.4, "sigma_bins": 0.8, "rule": rule}
    texts = [f"--{key.replace('_', '-')}={value}" for key, value in options.items()]
    found = dtof.tune(**options)
    flags = found["options"]
    assert found == json.loads(program("tune", "--json", *texts))
    assert flags == program("tune", *texts).splitlines()[-1]
    assert shlex.split(flags)[:2] == ["--rule", rule]
