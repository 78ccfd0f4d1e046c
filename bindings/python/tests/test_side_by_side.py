"""The numpy methods are correct, and the page agrees with the stored tables."""

import inspect
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench" / "side_by_side"))

import measure
import methods
import page
import photons
import stored
import with_numpy

import dtof

SMALL = {"pixels": 48, "cycles": 2000, "empty_cycles": 2000}
FRAMES, ASYNCHRONOUS = methods.METHODS[:2], methods.METHODS[2:]


@pytest.fixture(scope="module")
def bright():
    return photons.bright(**SMALL)


def counted(rows):
    """Photons of histograms, all in laser cycle 0 of one."""
    of = np.repeat(np.arange(rows.size), rows.ravel())
    cycle = np.zeros(of.size, "u2")
    return photons.Photons((of // rows.shape[1]).astype("u2"), cycle, of % rows.shape[1], 4)


def test_drawn_photons_are_where_requested():
    random = np.random.default_rng(1)
    background, signal = np.array([0.0, 0.01, 0.0]), np.array([0.5, 0.0, 0.0])
    drawn = photons.draw(random, background, 10_000, 64, signal, np.array([20.25, 0, 0]), 1.5)
    numbers = np.bincount(drawn.pixel, minlength=3)
    assert abs(numbers[0] - 5000) < 5 * np.sqrt(5000) and abs(numbers[1] - 6400) < 5 * np.sqrt(6400)
    assert numbers[2] == 0
    assert (np.diff(drawn.cycle.astype(int)) >= 0).all() and drawn.cycle.max() < 10_000
    bins = drawn.bin[drawn.pixel == 0] + 0.5
    assert abs(bins.mean() - 20.25) < 5 * 1.5 / np.sqrt(5000)
    assert abs(bins.std() - np.hypot(1.5, 1 / np.sqrt(12))) < 0.1


def test_recorded_photons_are_those_of_the_recording(recorded):
    file = recorded("tmf8820_plane_gt/distance_data.json")
    scene = photons.recorded(file, parts=3, cycles=500, empty_cycles=10, added=0.0)
    counts = dtof.load(file)
    zones, truth = counts.counts[:, 0].astype(float), counts.truth_mm[:, 0, 4]
    zones, truth = zones[truth > 29.9], truth[truth > 29.9]
    assert scene.pixels == 149 * 3 and len(scene.empty) == 0
    assert scene.truth_mm[::3] == pytest.approx(truth + 179.5)
    # Half a photon a laser cycle in the brightest zone: so many in each part, in these bins.
    expected = zones[:, 4] / zones.sum(2).max(1, keepdims=True) * 0.5 * 500
    seen = np.bincount(scene.photons.pixel.astype(int) * 128 + scene.photons.bin, minlength=149 * 384)
    seen = seen.reshape(149, 3, 128)
    for part in range(3):
        of_bins, all_bins = seen[:, part].sum(0), expected.sum(0)
        assert (abs(of_bins - all_bins) < 6 * np.sqrt(all_bins + 1)).all()
    assert (seen[:, 0] != seen[:, 1]).any()
    assert abs(np.bincount(scene.photons.cycle, minlength=500) - seen.sum() / 500).max() < 6 * np.sqrt(seen.sum() / 500)


def test_the_centroid_of_known_counts():
    counts = np.full((3, 32), 2)
    counts[0, 9:12] += [10, 20, 10]  # in the middle of bin 10
    counts[1, 9:12] += [0, 30, 10]  # a quarter of a bin later
    counts[2, 0] += 8  # the window is cut off
    found = with_numpy.centroid(counts, np.array([10, 10, 0]), np.full(3, 2.0), 2)
    assert found == pytest.approx([10.5, 10.75, 0.5])


def test_the_highest_three_bins_and_their_background():
    counts = np.full((2, 32), 2)
    counts[0, 9:12] += [10, 20, 10]
    counts[1, 30] += 7
    peak, height, background = with_numpy.highest(counts)
    assert peak.tolist() == [10, 29] and height.tolist() == [46, 13]  # the first of equal ones
    assert background == pytest.approx([2, 2])


def test_a_poisson_threshold_is_the_share_of_cases():
    random = np.random.default_rng(2)
    drawn = random.poisson(2.0, 1_000_000)
    share = with_numpy.stands_clear(drawn, 2.0, 3).mean()
    assert 0.1e-3 < share < 1e-3  # counts are whole: not exactly one in a thousand
    assert with_numpy.stands_clear(np.array([1, 0]), np.array([5e-4, 1.0]), 3).tolist() == [True, False]


@pytest.mark.parametrize("method", methods.METHODS[:3], ids=lambda method: method.name)
def test_each_numpy_method_finds_a_peak_and_nothing_else(method, bright):
    rows = np.zeros((48, 128), int)
    rows[7, 60:63] = [100, 200, 100]
    rows[:, ::8] += 1
    setting = 4 if method.by_exposure else 5
    pixel, cycle, position = method.reports(bright, counted(rows), setting, 8.0)
    assert pixel.tolist() == [7] and cycle.tolist() == [4]
    assert position == pytest.approx([61.5], abs=0.02)


@pytest.mark.parametrize("method", FRAMES, ids=lambda method: method.name)
def test_frames_of_every_length_have_a_threshold_and_are_right(method, bright):
    rows = measure.curve(method, bright)
    assert [row.setting for row in rows] == list(methods.EXPOSURES)
    assert all(row.wrong == 0 and row.error_bins < 0.6 for row in rows)
    # Half of the pixels are right after a frame of 14 laser cycles, or two of ten.
    assert min(row.half for row in rows) <= 20


@pytest.mark.parametrize("method", methods.METHODS[:3], ids=lambda method: method.name)
def test_a_peak_needs_a_minimum_of_photons(method, bright):
    given = {**method.arguments(bright), "min_photons": 6, "exposure": 4, "k": 0.0, "z": 0.0}
    names = inspect.signature(method.function).parameters
    given = {name: value for name, value in given.items() if name in names}
    rows = np.zeros((48, 128), int)
    rows[7, 59:62], rows[9, 59:62], rows[11, 58:63] = [1, 4, 1], [1, 3, 1], [3, 1, 3, 1, 1]
    rows[:, 0] = 1  # some background
    assert method.function(counted(rows), **given)[0].tolist() == [7, 11]


@pytest.mark.parametrize("method", FRAMES, ids=lambda method: method.name)
def test_the_shortest_frames_have_no_threshold_without_a_minimum_of_photons(method, bright):
    without = replace(bright, find_peaks_min_photons=0, frames_min_photons=0)
    for setting in methods.EXPOSURES[:2]:
        with np.errstate(invalid="ignore"):  # a centroid of nothing
            assert measure.lowest_threshold(method, without, setting) is None
        assert measure.lowest_threshold(method, bright, setting) is not None


def test_frames_with_and_without_find_peaks_agree(bright):
    with_scipy, with_arrays = (method.reports(bright, bright.photons, 400, 5.0) for method in FRAMES)
    for mine, other in zip(with_scipy, with_arrays):
        assert mine == pytest.approx(other, abs=0.2)
    assert with_scipy[0].size == 48 * 5


def test_asynchronous_numpy_reports_what_dtof_reports(bright):
    of_numpy, of_dtof = (method.reports(bright, bright.photons, 20, 5.0) for method in ASYNCHRONOUS)
    same = {*zip(of_numpy[0], of_numpy[1])} & {*zip(of_dtof[0], of_dtof[1])}
    assert len(same) > 0.99 * of_numpy[0].size > 0.99 * 48 * 20
    assert of_dtof[0].size == pytest.approx(of_numpy[0].size, rel=0.01)


def test_a_pixel_starts_over_after_a_report_and_at_l2():
    # Two bursts of ten photons in bin 5, and single ones too far apart for a report.
    cycle = np.array([0] * 10 + [8] * 10 + [2500 + 100 * i for i in range(4)] + [4100])
    given = photons.Photons(np.zeros(cycle.size, int), cycle, np.full(cycle.size, 5), 6000)
    pixel, cycle, position = with_numpy.asynchronous(given, 1, 16, 5, 3.0, 2)
    assert cycle.tolist() == [4, 12] and position == pytest.approx([5.5, 5.5])


def test_scores_of_known_reports(bright):
    truth = bright.truth_mm / bright.mm_per_bin
    pixel = np.array([0, 1, 0, 2, 2])
    cycle = np.array([10, 20, 30, 40, 50])
    position = truth[pixel] + [0.3, -0.4, 9.0, 9.0, 0.5]  # two are wrong
    found = measure.scored(bright, (pixel, cycle, position))
    assert found["half"] == found["nine_of_ten"] == np.inf  # 3 of 48 pixels
    assert found["mean"] == pytest.approx((10 + 20 + 50 + 45 * 2000) / 48)
    assert found["error_bins"] == pytest.approx(np.sqrt((0.09 + 0.16 + 0.25) / 3))
    assert found["error_mm"] == pytest.approx(found["error_bins"] * 250 * 0.149896229)
    assert found["wrong"] == pytest.approx(1 / 3)
    all_right = measure.scored(bright, (np.arange(48), np.arange(1, 49), truth))
    assert (all_right["mean"], all_right["half"], all_right["nine_of_ten"]) == (24.5, 24, 44)


@pytest.mark.parametrize("method", methods.METHODS, ids=lambda method: method.name)
def test_thresholds_are_the_lowest_allowed(method, bright):
    threshold = measure.lowest_threshold(method, bright, method.settings[-2])
    below = method.thresholds[max(method.thresholds.index(threshold) - 1, 0)]

    def of(threshold):
        return measure.alarms(method, bright, bright.empty, method.settings[-2], threshold)

    assert of(threshold) <= 1 < of(below) or threshold == method.thresholds[0]


def test_lines_are_counted_without_comments_and_docstrings():
    # fmt: off
    def function(a,
                 b):
        """Of two
        lines."""
        # Not this.

        text = """one
        two"""
        return a, b, text  # but this
    # fmt: on

    assert methods.lines_of(function) == 5
    names = {function.__name__ for function in methods.needed(with_numpy.frames)}
    assert {"frames", "highest", "stands_clear", "joined"} <= names and "asynchronous" not in names


def test_the_page_agrees_with_the_tables():
    rows, speeds = stored.read(stored.ROWS, measure.Row), stored.read(stored.SPEEDS, stored.Speed)
    assert stored.PAGE.read_text(encoding="utf-8") == page.text(rows, speeds)


def test_the_title_of_the_chart_holds():
    rows = stored.read(stored.ROWS, measure.Row)

    def times(scene, within):
        """The mean times of frames and of events, numpy first."""
        found = [measure.times_at(page.of(rows, scene, method.name), within)[0] for method in methods.METHODS]
        return found[:2], found[2:]

    for within in (0.4, 0.3, 0.2):
        frames, (of_numpy, of_dtof) = times("outdoor", within)
        assert max(of_numpy, of_dtof) < 0.8 * min(frames) and of_numpy < 1.2 * of_dtof
    for within in (0.3, 0.2, 0.1):
        frames, events = times("bright", within)
        assert max(frames + events) < 1.2 * min(frames + events)


def test_measured_scenes_replace_stored_ones(tmp_path):
    rows = stored.read(stored.ROWS, measure.Row)
    names = list(page.SCENES)
    new = [row for row in rows if row.scene == "outdoor"][:2]
    new[0].mean = 17.0
    stored.write(tmp_path / "rows.csv", stored.with_others(stored.ROWS, new, names))
    found = stored.read(tmp_path / "rows.csv", measure.Row)
    assert found == [row for row in rows if row.scene != "outdoor" or row in new]


def test_a_changed_figure_is_found(tmp_path, monkeypatch):
    rows = stored.read(stored.ROWS, measure.Row)
    assert stored.differences(rows, {row.scene for row in rows}) == []
    rows[3].error_bins *= 1.001
    (line,) = stored.differences(rows, {row.scene for row in rows})
    assert "error_bins" in line and rows[3].method in line
