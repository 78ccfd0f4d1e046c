"""One recording in parts equals the whole, byte for byte."""

import numpy
import pytest

import dtof

pytest.importorskip("distributed")

import dask.array

from clusters import are_equal, counts, refused, saved
from dtof import cluster
from dtof._warn import with_keywords

GLASS = "[sensor]\ngate = [10, 127]\nglass = 0.1\nglass_bins = [0, 0, 0.05, 0.05, 0, 0, 0, 0, 0, 0]\n"

OPTIONS = {
    "plain": {"rule": "paper"},
    "window": {"rule": "window", "sigma_bins": 0.8, "l1": 4, "echoes": 2, "echo_wait": 4},
    "blocks": {"binning": 2, "patience": 16, "alpha": 8, "min_count": 7},
    "frame": {"frame": 500},
    "losses": {"bins": 64, "rebin": 1, "gate": (10, 60), "mask": [1, 70, 110], "cycles": 50},
    "run": {"rule": "paper", "photons_per_cycle": 0.3, "seed": 9, "cycles": 3001, "laser_hz": 5_000_000},
    "length": {"rule": "paper", "recorded_cycles": 900, "rebin": 3, "bins": 32},
}


@pytest.mark.parametrize("name", OPTIONS)
@pytest.mark.filterwarnings("ignore:.*photons in bins that were cut off")
def test_parts_are_the_whole(client, tmp_path, name):
    options = OPTIONS[name]
    # Rows of very different brightness, and the brightest pixel in one part.
    array = counts(rows=20) * numpy.arange(1, 21)[:, None, None]
    expected = dtof.replay(array, **options)
    assert expected.events.size > 100 or name == "losses"
    chunks = dask.array.from_array(array, chunks=((8, 4, 8), -1, -1))
    run = cluster.replay(client, chunks, **options)
    are_equal(run, expected)
    for each, whole in [("parts.aer", run), ("whole.aer", expected)]:
        dtof.write_events(tmp_path / each, whole.events, whole.array)
    assert (tmp_path / "parts.aer").read_bytes() == (tmp_path / "whole.aer").read_bytes()
    file = saved(tmp_path, "counts.npy", array)
    are_equal(cluster.replay(client, file, **options), dtof.replay(file, **options))


def test_the_warning_that_parts_cannot_give(client):
    """The warning about axes. Everything else is the same, including other warnings."""
    array = numpy.moveaxis(counts(rows=16, columns=12), -1, 0)
    with pytest.warns(UserWarning) as warned:
        expected = dtof.replay(array, bin_width_ps=0.25, rule="paper")
    axes = [str(line.message) for line in warned if "first axis looks like" in str(line.message)]
    with pytest.warns(UserWarning) as warned:
        run = cluster.replay(client, dask.array.from_array(array, chunks=(20, -1, -1)), bin_width_ps=0.25, rule="paper")
    assert [str(line.message) for line in warned] == list(map(with_keywords, run.statistics["warnings"]))
    assert len(axes) == 1 and len(run.statistics["warnings"]) == 1
    left = [line for line in expected.statistics["warnings"] if with_keywords(line) not in axes]
    assert run.events.tobytes() == expected.events.tobytes() and run.events.size > 0
    assert run.statistics == {**expected.statistics, "warnings": left}


def test_parts_of_captures_and_other_orders_of_axes(client, tmp_path):
    array = counts(rows=12).reshape(3, 4, 6, 100) * numpy.array([1, 30, 5])[:, None, None, None]
    axes = "captures,rows,columns,bins"
    expected = dtof.replay(array, axes=axes, rule="paper")
    assert expected.statistics["recorded_cycles"][0] < expected.statistics["recorded_cycles"][1]
    for chunks in [(1, -1, -1, -1), (2, -1, -1, -1), (1, 3, -1, -1), -1]:
        run = cluster.replay(client, dask.array.from_array(array, chunks=chunks), axes=axes, rule="paper")
        are_equal(run, expected)
    blocks = {"binning": 1, "alpha": 8}
    run = cluster.replay(client, dask.array.from_array(array, chunks=(1, 2, -1, -1)), axes=axes, **blocks)
    are_equal(run, dtof.replay(array, axes=axes, **blocks))
    # Rows of rows, without names.
    run = cluster.replay(client, dask.array.from_array(array, chunks=(1, 2, -1, -1)), rule="paper")
    are_equal(run, dtof.replay(array, rule="paper"))
    turned = numpy.ascontiguousarray(array.transpose(3, 0, 2, 1))
    axes = "bins,captures,columns,rows"
    run = cluster.replay(client, dask.array.from_array(turned, chunks=(-1, 1, -1, 2)), axes=axes, rule="paper")
    are_equal(run, dtof.replay(turned, axes=axes, rule="paper"))
    file = saved(tmp_path, "turned.npy", turned)
    are_equal(cluster.replay(client, file, axes=axes, rule="paper"), dtof.replay(file, axes=axes, rule="paper"))


def test_parts_of_any_length_are_the_whole(client, tmp_path):
    file = saved(tmp_path, "counts.npy", counts(rows=13))
    expected, told = dtof.replay(file, rule="paper"), []
    for rows in (1, 5, 12, 13, 99):
        are_equal(cluster.replay(client, file, rule="paper", rows=rows), expected)
    cluster.replay(client, file, rule="paper", rows=5, progress=lambda *at: told.append(at))
    assert told == [(done, 6) for done in range(1, 7)]


def test_warnings_are_about_the_whole_recording(client, tmp_path):
    empty = numpy.zeros((4, 2, 16), dtype=int)
    with pytest.warns(UserWarning, match="no photons: all 8 histograms are empty"):
        run = cluster.replay(client, dask.array.from_array(empty, chunks=(2, -1, -1)), rule="paper")
    with pytest.warns(UserWarning):
        are_equal(run, dtof.replay(empty, rule="paper"))
    half = counts(rows=8)
    half[:4] = 0
    run = cluster.replay(client, dask.array.from_array(half, chunks=(2, -1, -1)), rule="paper")
    are_equal(run, dtof.replay(half, rule="paper"))
    assert run.statistics["warnings"] == []


def test_a_cover_glass_is_monitored_over_all_parts(client, tmp_path):
    settings = tmp_path / "dtof.toml"
    settings.write_text(GLASS)
    array = counts(rows=8, bins=128)
    array[..., 2:4] += 4000
    options = {"recorded_cycles": 10_000, "settings": settings, "mask": list(range(20))}
    run = cluster.replay(client, dask.array.from_array(array, chunks=(2, -1, -1)), **options)
    expected = dtof.replay(array, **options)
    are_equal(run, expected)
    assert expected.statistics["cover_glass"][0] > 2


def test_a_killed_worker_changes_no_part(dask_cluster, client, tmp_path):
    file = saved(tmp_path, "counts.npy", counts(1, 128, 16, 64, 2000))
    options = {"cycles": 20_000, "photons_per_cycle": 0.5, "rule": "paper"}
    killed = []

    def kill(done, _):
        # Of 16 parts: when some are counted, and while they are replayed.
        if done in (5, 18):
            killed.append(dask_cluster.kill_one(busy=done > 16))

    run = cluster.replay(client, file, rows=8, progress=kill, **options)
    are_equal(run, dtof.replay(file, **options))
    assert len(killed) == 2


def test_invalid_recordings_in_parts(client, tmp_path):
    array, replay = counts(rows=8), cluster.replay

    def chunked(*chunks, of=array):
        return dask.array.from_array(of, chunks=chunks)

    refused(lambda: replay(client, array), "ndarray", "must be a dask array")
    refused(lambda: replay(client, chunked(4, 3, -1)), "chunks split the columns", ".rechunk({1: -1})")
    refused(lambda: replay(client, chunked(4, -1, 50)), "chunks split the bins", ".rechunk({2: -1})")
    window = {"rule": "window", "window": 3, "neighbours": 8}
    refused(lambda: replay(client, chunked(4, -1, -1), **window), "neighbours", "as a whole")
    refused(lambda: replay(client, chunked(3, -1, -1), binning=1), "cut blocks of 2x2 pixels", "multiples of 2 rows")
    refused(lambda: replay(client, chunked(4, -1, -1), binning=3), "multiples of 8 rows")
    four = array.reshape(2, 4, 6, 100)
    axes = "captures,rows,columns,bins"
    refused(lambda: replay(client, chunked(2, 2, -1, -1, of=four), axes=axes, rule="paper"), "several captures")
    refused(lambda: replay(client, chunked(4, -1, -1), axes=axes, rule="paper"), "of 3 axes")
    refused(lambda: replay(client, chunked(4, -1, of=array[0])), "2 axes")
    refused(lambda: replay(client, chunked(4, -1, -1), rows=4), "rows is for files")
    unknown = chunked(4, -1, -1)
    refused(lambda: replay(client, unknown[unknown[:, 0, 0] > 1]), "not known")
    refused(lambda: replay(client, chunked(4, -1, -1)[:0]), "empty")
    bad = array.copy()
    bad[5, 2, 7] = -1
    refused(
        lambda: replay(client, chunked(4, -1, -1, of=bad), rule="paper"),
        "the array[4:8, :, :]",
        "[1, 2, 7]",
        "negative",
    )
    refused(lambda: replay(client, chunked(4, -1, -1), alpha=300), "alpha 300: ")
    file = saved(tmp_path, "counts.npy", array)
    for rows in (0, -1, 1.5, "2", True):
        refused(lambda: replay(client, file, rows=rows), "rows", "whole number")
    refused(lambda: replay(client, file, rows=3, binning=1), "multiples of 2")
    refused(lambda: replay(client, tmp_path / "none.npy"), "none.npy")
    numpy.savez(tmp_path / "a.npz", array)
    refused(lambda: replay(client, tmp_path / "a.npz"), "a.npz: an archive")
    (tmp_path / "text.npy").write_text("no array")
    refused(lambda: replay(client, tmp_path / "text.npy"), "text.npy")
    photons = numpy.zeros(5, dtype=[("pixel", "u2"), ("cycle", "u2"), ("bin", "u2")])
    refused(lambda: replay(client, saved(tmp_path, "p.npy", photons)), "holds photons")


def test_a_recording_that_changes_during_a_run_is_refused(client, tmp_path):
    file = saved(tmp_path, "counts.npy", counts(rows=8))

    def change(done, _):
        if done == 2:
            saved(tmp_path, "counts.npy", counts(rows=8) + 1)

    refused(lambda: cluster.replay(client, file, rule="paper", rows=4, progress=change), "did the recording change?")


def test_parts_do_not_show_the_settings_of_the_whole(client, tmp_path):
    file = saved(tmp_path, "counts.npy", counts(rows=8))
    refused(lambda: cluster.replay(client, file, recorded_cycles=900), "settings is needed for a recording in parts")
    found = dtof.calibrate(file, recorded_cycles=900)
    run = cluster.replay(client, file, recorded_cycles=900, settings=found)
    are_equal(run, dtof.replay(file, recorded_cycles=900, settings=found))
