"""Many machines give what one gives, byte for byte: a real scheduler and two worker processes."""

import json
import os
import time
from pathlib import Path

import numpy
import pytest

import dtof

pytest.importorskip("distributed")

import dask.array  # noqa: E402
from clusters import PAGE, README, Cluster, blocks  # noqa: E402
from conftest import ROOT  # noqa: E402

from dtof import cluster  # noqa: E402
from dtof.cluster._worker import begin  # noqa: E402

GLASS = "[sensor]\ngate = [10, 127]\nglass = 0.1\nglass_bins = [0, 0, 0.05, 0.05, 0, 0, 0, 0, 0, 0]\n"


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    running = Cluster(tmp_path_factory.mktemp("cluster"))
    yield running
    running.close()


@pytest.fixture
def client(running):
    running.all_there()
    return running.client


def counts(seed=3, rows=4, columns=6, bins=100, bright=90.0):
    random = numpy.random.default_rng(seed)
    counts = random.poisson(3.0, size=(rows, columns, bins))
    counts[..., 40:43] += random.poisson(bright, size=(rows, columns, 3))
    return counts


def saved(folder, name, array):
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    numpy.save(path, array)
    return path


def refused(call, *words):
    with pytest.raises(dtof.Error) as caught:
        call()
    text = str(caught.value)
    assert "\n" not in text and all(word in text for word in words), text


def are_equal(run, expected, by_another_name=False):
    assert run.events.tobytes() == expected.events.tobytes()
    name = {"input": expected.statistics["input"]} if by_another_name else {}
    assert {**run.statistics, **name} == expected.statistics
    assert (run.toml, run.settings, run.array) == (expected.toml, expected.settings, expected.array)


# Many recordings.


def test_recordings_come_in_order_and_their_totals_are_sums(client, tmp_path):
    # The first takes the longest.
    files = [saved(tmp_path, f"{i}.npy", counts(i, rows=40 if i == 0 else 4)) for i in range(5)]
    told = []
    options = {"photons_per_cycle": 0.5, "mask": [2], "gate": (5, 60), "cycles": 300, "bins": 64}
    with pytest.warns(UserWarning, match="4.npy: .* photons in bins that were cut off"):
        many = cluster.recordings(client, files, progress=lambda *at: told.append(at), **options)
        runs = [dtof.replay(file, **options) for file in files]
    assert [one.file for one in many.results] == list(map(str, files)) and not many.failed
    for one, run in zip(many.results, runs):
        are_equal(one.run, run)
    for name, total in many.totals.items():
        assert total == sum(run.statistics[name] for run in runs), name
    assert min(many.totals[key] for key in ("photons", "masked", "not_replayed", "cut_off")) > 0
    # Nothing is lost that is not counted.
    offered = sum(many.totals[key] for key in ("photons", "masked", "not_replayed", "cut_off"))
    assert offered == sum(numpy.load(file).sum() for file in files)
    assert told == [(done, 5) for done in range(1, 6)]
    with pytest.warns(UserWarning):
        assert cluster.recordings(client, files[::-1], **options).totals == many.totals


def test_a_recording_that_cannot_be_read_is_one_error(client, tmp_path):
    good = saved(tmp_path, "good.npy", counts())
    bad = saved(tmp_path, "bad.npy", counts() - 50)
    (tmp_path / "cut.npy").write_bytes(good.read_bytes()[:500])
    files = [bad, good, tmp_path / "none.npy", tmp_path / "cut.npy", tmp_path / "name.xyz"]
    for out in (None, tmp_path):
        many = cluster.recordings(client, files, out=out)
        assert [one.error is None for one in many.results] == [False, True, False, False, False]
        for one in many.failed:
            assert one.error.startswith(one.file) and "\n" not in one.error, one.error
        assert "is negative" in many.results[0].error
        assert many.totals == {
            key: dtof.replay(good).statistics[key] for key in many.totals
        } and many.totals["events"] > 0
    assert "4 failed" in repr(many)
    assert not (tmp_path / "bad").exists()


def test_folders_hold_what_the_program_writes(program, client, tmp_path):
    file = saved(tmp_path, "counts.npy", counts())
    theirs = tmp_path / "theirs"
    program("replay", "--input", file, "--out", theirs, "--quiet", "--alpha", "5")
    many = cluster.recordings(client, [file], out=tmp_path, alpha=5)
    ours = tmp_path / "counts"
    assert many.results[0].folder == str(ours) and many.results[0].run is None
    for name in ("events.aer", "dtof.toml"):
        assert (ours / name).read_bytes() == (theirs / name).read_bytes()
    summary, expected = (json.loads((of / "summary.json").read_text()) for of in (ours, theirs))
    assert summary.pop("request")["options"] == ["--alpha=5"]
    del expected["export_with"], summary["export_with"]
    assert summary == expected
    # Results of the program are replaced as it would.
    again = cluster.recordings(client, [file], out=tmp_path, names=["theirs"], alpha=6)
    assert not again.failed and not again.results[0].is_kept
    events, _ = dtof.read_events(theirs / "events.aer")
    assert events.tobytes() == dtof.replay(file, alpha=6).events.tobytes()


def contents(folder):
    """All files, less those that a killed process left."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in files
        if not path.name.endswith(".partial")
    }


def test_what_is_finished_is_not_done_again(client, tmp_path):
    files = [saved(tmp_path, f"in/{i}.npy", counts(i)) for i in range(3)]
    out = tmp_path / "out"
    out.mkdir()
    settings = tmp_path / "dtof.toml"
    settings.write_text("[detection]\nalpha = 5.0\n")

    def kept(**options):
        many = cluster.recordings(client, files, out=out, settings=settings, **options)
        assert not many.failed
        expected = [dtof.replay(file, settings=settings, **options) for file in files]
        assert [one.statistics for one in many.results] == [run.statistics for run in expected]
        return [one.is_kept for one in many.results]

    assert kept() == [False] * 3
    before = contents(out)
    assert kept() == [True] * 3 and contents(out) == before
    # Whatever an interrupted run can leave.
    (out / "0" / "summary.json").unlink()
    events = (out / "1" / "events.aer").read_bytes()
    (out / "1" / "events.aer").write_bytes(events[:-16])
    assert kept() == [False, False, True] and contents(out) == before
    (out / "1" / "events.aer").unlink()
    assert kept() == [True, False, True] and contents(out) == before
    # Another request.
    assert kept(l1=20) == [False] * 3 and contents(out) != before
    settings.write_text("[detection]\nalpha = 6.0\n")
    assert kept(l1=20) == [False] * 3
    saved(tmp_path, "in/2.npy", counts(7))
    assert kept(l1=20) == [True, True, False]


def test_events_may_be_arrays(client, tmp_path):
    file = saved(tmp_path, "in/a.npy", counts())
    cluster.recordings(client, [file], out=tmp_path)
    many = cluster.recordings(client, [file], out=tmp_path, events="npy")
    events = numpy.load(tmp_path / "a" / "events.npy")
    assert events.tobytes() == dtof.replay(file).events.tobytes() and not many.results[0].is_kept
    # Events of other settings do not stay beside it.
    assert not (tmp_path / "a" / "events.aer").exists()
    assert cluster.recordings(client, [file], out=tmp_path, events="npy").results[0].is_kept
    assert not cluster.recordings(client, [file], out=tmp_path).results[0].is_kept


def test_no_file_of_others_is_replaced(client, tmp_path):
    file = saved(tmp_path, "in/a.npy", counts())
    out = tmp_path / "out"
    for name, text in [
        ("events.aer", b"mine"), ("events.npy", b"mine"), ("dtof.toml", b"a = 1\n"),
        ("summary.json", b"{}"), ("summary.json", b"[1"),
    ]:
        (out / "a").mkdir(parents=True, exist_ok=True)
        (out / "a" / name).write_bytes(text)
        many = cluster.recordings(client, [file], out=out)
        assert name in many.results[0].error and "move it away" in many.results[0].error
        assert contents(out) == {f"a/{name}": text}
        (out / "a" / name).unlink()
    # Nor one that is read.
    settings = out / "a" / "dtof.toml"
    settings.write_text(dtof.replay(file).toml)
    before = contents(out)
    many = cluster.recordings(client, [file], out=out, settings=settings)
    assert "is a file that is read" in many.results[0].error and contents(out) == before


def test_a_worker_that_is_killed_changes_nothing(running, client, tmp_path):
    """Killed at its work, half-way: its files come from another worker."""
    files = [saved(tmp_path, f"in/{i}.npy", counts(i, 16, 16, 64, 2000)) for i in range(8)]
    options = {"cycles": 20_000, "photons_per_cycle": 0.5}
    folders = [tmp_path / "whole", tmp_path / "lost"]
    for folder in folders:
        folder.mkdir()
    cluster.recordings(client, files, out=folders[0], **options)
    killed = []

    def kill(done, _):
        if done == 3:
            killed.append(running.kill_one())

    many = cluster.recordings(client, files, out=folders[1], progress=kill, **options)
    assert len(killed) == 1 and not many.failed
    assert contents(folders[1]) == contents(folders[0]) and len(contents(folders[0])) == 24
    running.all_there()
    assert killed[0] not in client.run(os.getpid).values()
    run = dtof.replay(files[5], **options)
    dtof.write_events(tmp_path / "single.aer", run.events, run.array)
    assert (folders[1] / "5" / "events.aer").read_bytes() == (tmp_path / "single.aer").read_bytes()


def test_an_interrupted_run_is_continued(client, tmp_path):
    class Enough(Exception):
        pass

    def stop(done, _):
        if done == 2:
            raise Enough

    files = [saved(tmp_path, f"in/{i}.npy", counts(i)) for i in range(40)]
    with pytest.raises(Enough):
        cluster.recordings(client, files, out=tmp_path, progress=stop)
    many = cluster.recordings(client, files, out=tmp_path)
    kept = sum(one.is_kept for one in many.results)
    assert 2 <= kept < 40 and not many.failed
    for file, one in zip(files, many.results):
        events, _ = dtof.read_events(Path(one.folder) / "events.aer")
        assert events.tobytes() == dtof.replay(file).events.tobytes()


# One recording in parts.

OPTIONS = {
    "plain": {},
    "window": {"rule": "window", "sigma_bins": 0.8, "l1": 4, "echoes": 2, "echo_wait": 4},
    "blocks": {"binning": 2, "patience": 16, "alpha": 8, "min_count": 7},
    "frame": {"frame": 500},
    "losses": {"bins": 64, "rebin": 1, "gate": (10, 60), "mask": [1, 70, 110], "cycles": 50},
    "run": {"photons_per_cycle": 0.3, "seed": 9, "cycles": 3001, "laser_hz": 5_000_000},
    "length": {"recorded_cycles": 900, "rebin": 3, "bins": 32},
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


def test_parts_of_captures_and_other_orders_of_axes(client, tmp_path):
    array = counts(rows=12).reshape(3, 4, 6, 100) * numpy.array([1, 30, 5])[:, None, None, None]
    axes = "captures,rows,columns,bins"
    expected = dtof.replay(array, axes=axes)
    assert expected.statistics["recorded_cycles"][0] < expected.statistics["recorded_cycles"][1]
    for chunks in [(1, -1, -1, -1), (2, -1, -1, -1), (1, 3, -1, -1), -1]:
        run = cluster.replay(client, dask.array.from_array(array, chunks=chunks), axes=axes)
        are_equal(run, expected)
    blocks = {"binning": 1, "alpha": 8}
    run = cluster.replay(client, dask.array.from_array(array, chunks=(1, 2, -1, -1)), axes=axes, **blocks)
    are_equal(run, dtof.replay(array, axes=axes, **blocks))
    # Rows of rows, without names.
    run = cluster.replay(client, dask.array.from_array(array, chunks=(1, 2, -1, -1)))
    are_equal(run, dtof.replay(array))
    turned = numpy.ascontiguousarray(array.transpose(3, 0, 2, 1))
    axes = "bins,captures,columns,rows"
    run = cluster.replay(client, dask.array.from_array(turned, chunks=(-1, 1, -1, 2)), axes=axes)
    are_equal(run, dtof.replay(turned, axes=axes))
    file = saved(tmp_path, "turned.npy", turned)
    are_equal(cluster.replay(client, file, axes=axes), dtof.replay(file, axes=axes))


def test_parts_of_any_length_are_the_whole(client, tmp_path):
    file = saved(tmp_path, "counts.npy", counts(rows=13))
    expected, told = dtof.replay(file), []
    for rows in (1, 5, 12, 13, 99):
        are_equal(cluster.replay(client, file, rows=rows), expected)
    cluster.replay(client, file, rows=5, progress=lambda *at: told.append(at))
    assert told == [(done, 6) for done in range(1, 7)]


def test_what_is_surely_wrong_is_told_of_the_whole(client, tmp_path):
    empty = numpy.zeros((4, 2, 16), dtype=int)
    with pytest.warns(UserWarning, match="no photons: all 8 histograms are empty"):
        run = cluster.replay(client, dask.array.from_array(empty, chunks=(2, -1, -1)))
    with pytest.warns(UserWarning):
        are_equal(run, dtof.replay(empty))
    half = counts(rows=8)
    half[:4] = 0
    run = cluster.replay(client, dask.array.from_array(half, chunks=(2, -1, -1)))
    are_equal(run, dtof.replay(half))
    assert run.statistics["warnings"] == []


def test_a_cover_glass_is_watched_over_all_parts(client, tmp_path):
    settings = tmp_path / "dtof.toml"
    settings.write_text(GLASS)
    array = counts(rows=8, bins=128)
    array[..., 2:4] += 4000
    options = {"recorded_cycles": 10_000, "settings": settings, "mask": list(range(20))}
    run = cluster.replay(client, dask.array.from_array(array, chunks=(2, -1, -1)), **options)
    expected = dtof.replay(array, **options)
    are_equal(run, expected)
    assert expected.statistics["cover_glass"][0] > 2


def test_a_killed_worker_changes_no_part(running, client, tmp_path):
    file = saved(tmp_path, "counts.npy", counts(1, 128, 16, 64, 2000))
    options = {"cycles": 20_000, "photons_per_cycle": 0.5}
    killed = []

    def kill(done, _):
        # Of 16 parts: when some are counted, and while they are replayed.
        if done in (5, 18):
            killed.append(running.kill_one(that_works=done > 16))

    run = cluster.replay(client, file, rows=8, progress=kill, **options)
    are_equal(run, dtof.replay(file, **options))
    assert len(killed) == 2


# Seeds.

SCENE = (ROOT / "scenes" / "fan.toml").read_text()
SMALL = {"cycles": 300, "array": (4, 4), "alpha": 8}


def test_seeds_in_parts_equal_all_at_once(client):
    told = []
    whole = cluster.seeds(client, SCENE, range(100), progress=lambda *at: told.append(at), **SMALL)
    assert told[-1] == (10, 10)
    parts = [cluster.seeds(client, SCENE, range(at, at + 10), **SMALL) for at in range(0, 100, 10)]
    # In any order.
    sums = parts[7]
    for part in parts[:7] + parts[:7:-1]:
        sums = sums + part
    assert (sums.seeds, sums.statistics) == (whole.seeds, whole.statistics)
    assert (sums.totals, sums.against_truth) == (whole.totals, whole.against_truth)
    single = [dtof.simulate(SCENE, seed=seed, **SMALL) for seed in range(100)]
    assert whole.statistics == [run.statistics for run in single]
    assert whole.totals["events"] == sum(run.events.size for run in single) > 1000


def test_errors_of_all_seeds_are_those_of_all_events(client):
    """Against one mean over all events of a still wall, from the formula."""
    scene = "columns = 4\nrows = 4\nbackground = 0.02\n"
    scene += "[[surface]]\nname = 'wall'\nrange_mm = 1500\nreflectivity = 0.5\n"
    trials = cluster.seeds(client, scene, range(5, 25), cycles=3000)
    ranges = [dtof.simulate(scene, seed=seed, cycles=3000).events["range_mm"] for seed in range(5, 25)]
    truth = trials.against_truth
    assert truth["false_alarms"] == 0 and truth["events"] == sum(map(len, ranges)) > 500
    assert truth["surfaces"] == [{"name": "wall", **{k: v for k, v in truth.items() if k != "surfaces"}}]
    # Pixels see the wall at their slant; the spread is that of one seed's.
    one = trials.statistics[0]["against_truth"]
    assert abs(truth["rms_mm"] / one["rms_mm"] - 1) < 0.2
    rms = [run["against_truth"]["rms_mm"] ** 2 for run in trials.statistics]
    assert truth["rms_mm"] ** 2 == pytest.approx(numpy.average(rms, weights=list(map(len, ranges))))
    bias = [run["against_truth"]["bias_mm"] for run in trials.statistics]
    assert truth["bias_mm"] == pytest.approx(numpy.average(bias, weights=list(map(len, ranges))))


# Workers.


def test_a_task_has_as_many_threads_as_its_worker(client, tmp_path):
    files = [saved(tmp_path, f"{i}.npy", counts(i)) for i in range(8)]

    def threads():
        names = [path.read_text() for path in Path("/proc/self/task").glob("*/comm")]
        return sum(name.startswith("dtof-") for name in names)

    cluster.recordings(client, files)
    assert set(client.run(threads).values()) == {1} == set(client.nthreads().values())


def test_workers_without_dtof_or_of_another_version(client, tmp_path):
    file = saved(tmp_path, "counts.npy", counts())
    worker = next(iter(client.run(os.getpid)))

    def change(to):
        def hide():
            from importlib import metadata

            metadata.kept = getattr(metadata, "kept", metadata.version)

            def version(name):
                if to is None:
                    raise metadata.PackageNotFoundError(name)
                return to

            metadata.version = metadata.kept if to == "" else version

        client.run(hide, workers=[worker])

    calls = [
        lambda: cluster.recordings(client, [file]),
        lambda: cluster.replay(client, file),
        lambda: cluster.seeds(client, SCENE, [1], **SMALL),
    ]
    try:
        for to, words in [(None, "has no dtof"), ("0.0.9", "has dtof 0.0.9, not")]:
            change(to)
            for call in calls:
                refused(call, worker, words)
    finally:
        change("")
    for call in calls:
        call()
    # A worker that comes later looks by itself.
    refused(client.submit(begin, "0.0.9", pure=False).result, "has dtof", "not 0.0.9")


# What is wrong is one line.


def test_what_is_no_list_of_recordings(client, tmp_path):
    file = saved(tmp_path, "in/a.npy", counts())
    (tmp_path / "in" / "link.npy").symlink_to(file)
    other = saved(tmp_path, "other/a.npy", counts())
    recordings = cluster.recordings
    refused(lambda: recordings(client, []), "files: there are none")
    refused(lambda: recordings(client, str(file)), "put it in a list")
    refused(lambda: recordings(client, [counts()]), "names of files")
    refused(lambda: recordings(client, [file, str(file)]), "is given twice")
    refused(lambda: recordings(client, [file, tmp_path / "in" / "link.npy"]), "is given twice")
    refused(lambda: recordings(client, [file, other], out=tmp_path), str(other), str(file), "give names")
    refused(lambda: recordings(client, [file, other], out=tmp_path, names=["a"]), "1 for 2")
    for name in ("..", "", "/a", "a/../b", "a//b", "a\0"):
        refused(lambda: recordings(client, [file], out=tmp_path, names=[name]), "names")
    refused(lambda: recordings(client, [file], names=["a"]), "say out")
    refused(lambda: recordings(client, [file], out=tmp_path / "none"), "none", "no such folder")
    refused(lambda: recordings(client, [file], events="csv"), "'csv'", "aer, npy")
    refused(lambda: recordings(client, [file], alpha=300), "--alpha")
    refused(lambda: recordings(client, [file], nonsense=1), "--nonsense")
    refused(lambda: recordings(None, [file]), "must be a distributed.Client")
    assert "no.toml" in recordings(client, [file], settings="no.toml").results[0].error
    both = recordings(client, [file, other], out=tmp_path, names=["x/1", "x/2"])
    assert not both.failed and (tmp_path / "x" / "2" / "summary.json").exists()


def test_what_is_no_recording_in_parts(client, tmp_path):
    array, replay = counts(rows=8), cluster.replay

    def chunked(*chunks, of=array):
        return dask.array.from_array(of, chunks=chunks)

    refused(lambda: replay(client, array), "ndarray", "must be a dask array")
    refused(lambda: replay(client, chunked(4, 3, -1)), "chunks split the columns", ".rechunk({1: -1})")
    refused(lambda: replay(client, chunked(4, -1, 50)), "chunks split the bins", ".rechunk({2: -1})")
    refused(lambda: replay(client, chunked(3, -1, -1), binning=1), "cut blocks of 2x2 pixels", "multiples of 2 rows")
    refused(lambda: replay(client, chunked(4, -1, -1), binning=3), "multiples of 8 rows")
    four = array.reshape(2, 4, 6, 100)
    axes = "captures,rows,columns,bins"
    refused(lambda: replay(client, chunked(2, 2, -1, -1, of=four), axes=axes), "several captures")
    refused(lambda: replay(client, chunked(4, -1, -1), axes=axes), "of 3 axes")
    refused(lambda: replay(client, chunked(4, -1, of=array[0])), "2 axes")
    refused(lambda: replay(client, chunked(4, -1, -1), rows=4), "rows is for files")
    unknown = chunked(4, -1, -1)
    refused(lambda: replay(client, unknown[unknown[:, 0, 0] > 1]), "not known")
    refused(lambda: replay(client, chunked(4, -1, -1)[:0]), "empty")
    bad = array.copy()
    bad[5, 2, 7] = -1
    refused(lambda: replay(client, chunked(4, -1, -1, of=bad)), "the array[4:8, :, :]", "[1, 2, 7]", "negative")
    refused(lambda: replay(client, chunked(4, -1, -1), alpha=300), "--alpha")
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


def test_a_recording_that_changes_meanwhile_is_refused(client, tmp_path):
    file = saved(tmp_path, "counts.npy", counts(rows=8))

    def change(done, _):
        if done == 2:
            saved(tmp_path, "counts.npy", counts(rows=8) + 1)

    refused(lambda: cluster.replay(client, file, rows=4, progress=change), "did the recording change?")


def test_what_are_no_seeds(client):
    seeds = cluster.seeds
    refused(lambda: seeds(client, SCENE, []), "there are none")
    refused(lambda: seeds(client, SCENE, [1, 2, 1]), "seed 1", "twice")
    refused(lambda: seeds(client, SCENE, [1.5]), "whole numbers")
    refused(lambda: seeds(client, SCENE, 3), "whole numbers")
    refused(lambda: seeds(client, SCENE, [-1]), "--seed")
    refused(lambda: seeds(client, SCENE, [1], seed=3), "say seeds")
    refused(lambda: seeds(client, "none.toml", [1]), "none.toml")
    refused(lambda: seeds(client, "columns = x\n", [1]), "the scene")
    one, two = (seeds(client, SCENE, [1], **{**SMALL, "alpha": alpha}) for alpha in (8, 9))
    refused(lambda: one + one, "seed 1 is in both")
    refused(lambda: one + cluster.Seeds([2], two.statistics), "alpha differs")


# The pages.


@pytest.fixture
def desk(running, client, tmp_path, monkeypatch):
    """A folder with all that the pages name."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scheduler.json").write_text((running.folder / "scheduler.json").read_text())
    files = [saved(tmp_path, f"recordings/{i}.npy", counts(i)) for i in range(3)]
    saved(tmp_path, "large.npy", counts(rows=40))
    large = dask.array.from_array(counts(rows=40), chunks=(16, -1, -1))
    dask.array.to_npy_stack(str(tmp_path / "stack"), large)
    (tmp_path / "results").mkdir()
    scene = next(block for block in blocks("python") if "scene = " in block)
    (tmp_path / "scene.toml").write_text(scene.split('"""')[1])
    names = {"numpy": numpy, "files": files}
    yield names
    names["client"].close()


@pytest.mark.parametrize("page", [PAGE, README], ids=["page", "readme"])
def test_pages_run_as_they_stand(desk, page):
    for block in blocks("python", page):
        if page == PAGE or "cluster" in block:
            exec(block, desk)
    assert len(desk["many"].results) == 3 and not desk["many"].failed
    assert Path("results/2/events.aer").exists()
    are_equal(desk["run"], dtof.replay(Path("large.npy").absolute(), bin_width_ps=250), page == PAGE)
    assert desk["trials"].totals["events"] > 500
