"""Many recordings on many machines: the same results as one by one, even if workers are lost."""

import json
import os
from pathlib import Path

import numpy
import pytest

import dtof

pytest.importorskip("distributed")

from clusters import are_equal, contents, counts, refused, saved
from dtof import cluster
from dtof.cluster._folder import Folder


def test_recordings_come_in_order_and_their_totals_are_sums(client, tmp_path):
    # The first takes the longest.
    files = [saved(tmp_path, f"{i}.npy", counts(i, rows=40 if i == 0 else 4)) for i in range(5)]
    messages = []
    options = {"photons_per_cycle": 0.5, "mask": [2], "gate": (5, 60), "cycles": 300, "bins": 64}
    with pytest.warns(UserWarning, match="4.npy: .* photons in bins that were cut off"):
        many = cluster.recordings(client, files, progress=lambda *at: messages.append(at), **options)
        runs = [dtof.replay(file, **options) for file in files]
    assert [one.file for one in many.results] == list(map(str, files)) and not many.failed
    for one, run in zip(many.results, runs):
        are_equal(one.run, run)
    for name, total in many.totals.items():
        assert total == sum(run.statistics[name] for run in runs), name
    assert min(many.totals[key] for key in ("photons", "masked", "not_replayed", "cut_off")) > 0
    # Every loss is counted.
    offered = sum(many.totals[key] for key in ("photons", "masked", "not_replayed", "cut_off"))
    assert offered == sum(numpy.load(file).sum() for file in files)
    assert messages == [(done, 5) for done in range(1, 6)]
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
        assert (
            many.totals == {key: dtof.replay(good).statistics[key] for key in many.totals} and many.totals["events"] > 0
        )
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
    # A folder with any table or picture of another run is refused.
    more = {path.name for path in theirs.iterdir()} - {path.name for path in ours.iterdir()}
    assert {"events.csv", "report.html", "depth-mean.svg"} < more
    before = contents(theirs)
    (tmp_path / "one").mkdir()
    for name in sorted(more):
        (tmp_path / "one" / name).write_bytes(before[name])
        again = cluster.recordings(client, [file], out=tmp_path, names=["one"], alpha=6)
        error = again.results[0].error
        assert f"{tmp_path / 'one'}: has {name} of another run" in error and "\n" not in error
        assert contents(tmp_path / "one") == {name: before[name]}
        (tmp_path / "one" / name).unlink()
    again = cluster.recordings(client, [file], out=tmp_path, names=["theirs"], alpha=6)
    assert "of another run" in again.results[0].error
    assert contents(theirs) == before


def test_results_of_an_earlier_run_are_kept(client, tmp_path):
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
    # Everything an interrupted run can leave.
    (out / "0" / "summary.json").unlink()
    events = (out / "1" / "events.aer").read_bytes()
    (out / "1" / "events.aer").write_bytes(events[:-16])
    assert kept() == [False, False, True] and contents(out) == before
    (out / "1" / "events.aer").unlink()
    assert kept() == [True, False, True] and contents(out) == before
    (out / "1" / "dtof.toml").unlink()
    assert kept() == [True, False, True] and contents(out) == before
    # A damaged file, of the same size.
    for name in ("events.aer", "dtof.toml"):
        damaged = bytearray(before[f"2/{name}"])
        damaged[-3] ^= 1
        (out / "2" / name).write_bytes(damaged)
        assert kept() == [True, True, False] and contents(out) == before
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
    # The events in the other format are removed.
    assert not (tmp_path / "a" / "events.aer").exists()
    assert cluster.recordings(client, [file], out=tmp_path, events="npy").results[0].is_kept
    assert not cluster.recordings(client, [file], out=tmp_path).results[0].is_kept


def test_kept_files_are_checked_in_both_formats(client, tmp_path):
    file = saved(tmp_path, "in/a.npy", counts())
    first = cluster.recordings(client, [file], out=tmp_path, events="npy").results[0]
    place = tmp_path / "a" / "events.npy"
    events = place.read_bytes()
    place.write_bytes(events[:-1] + bytes([events[-1] ^ 1]))
    again = cluster.recordings(client, [file], out=tmp_path, events="npy").results[0]
    assert not first.is_kept and not again.is_kept and place.read_bytes() == events


def test_kept_results_repeat_their_warnings(client, tmp_path):
    empty = saved(tmp_path, "in/empty.npy", counts() * 0)
    files = [saved(tmp_path, "in/cut.npy", counts()), empty]
    messages = []
    for _ in range(2):
        with pytest.warns(UserWarning) as warned:
            many = cluster.recordings(client, files, out=tmp_path, bins=64)
        messages.append([str(warning.message) for warning in warned])
    assert all(one.is_kept for one in many.results) and messages[0] == messages[1]
    cut_off = f"{many.results[0].statistics['cut_off']:,}"
    assert "," in cut_off and f"{cut_off} photons in bins" in messages[0][0]
    assert "histograms are empty" in messages[0][1]


def test_no_file_of_others_is_replaced(client, tmp_path):
    file = saved(tmp_path, "in/a.npy", counts())
    out = tmp_path / "out"
    for name, text in [
        ("events.aer", b"mine"),
        ("events.npy", b"mine"),
        ("dtof.toml", b"a = 1\n"),
        ("summary.json", b"{}"),
        ("summary.json", b"[1"),
    ]:
        (out / "a").mkdir(parents=True, exist_ok=True)
        (out / "a" / name).write_bytes(text)
        many = cluster.recordings(client, [file], out=out)
        assert name in many.results[0].error and "move it away" in many.results[0].error
        assert contents(out) == {f"a/{name}": text}
        (out / "a" / name).unlink()
    # Nor an input file.
    settings = out / "a" / "dtof.toml"
    settings.write_text(dtof.replay(file).toml)
    before = contents(out)
    many = cluster.recordings(client, [file], out=out, settings=settings)
    assert "is an input file" in many.results[0].error and contents(out) == before


def test_a_worker_that_is_killed_changes_nothing(dask_cluster, client, tmp_path):
    """Killed halfway through a task: its files come from another worker."""
    files = [saved(tmp_path, f"in/{i}.npy", counts(i, 16, 16, 64, 2000)) for i in range(8)]
    options = {"cycles": 20_000, "photons_per_cycle": 0.5}
    folders = [tmp_path / "whole", tmp_path / "lost"]
    for folder in folders:
        folder.mkdir()
    cluster.recordings(client, files, out=folders[0], **options)
    killed = []

    def kill(done, _):
        if done == 3:
            killed.append(dask_cluster.kill_one())

    many = cluster.recordings(client, files, out=folders[1], progress=kill, **options)
    assert len(killed) == 1 and not many.failed
    assert contents(folders[1]) == contents(folders[0]) and len(contents(folders[0])) == 24
    dask_cluster.wait_for_workers()
    assert killed[0] not in client.run(os.getpid).values()
    run = dtof.replay(files[5], **options)
    dtof.write_events(tmp_path / "single.aer", run.events, run.array)
    assert (folders[1] / "5" / "events.aer").read_bytes() == (tmp_path / "single.aer").read_bytes()


def test_an_interrupted_run_is_continued(client, tmp_path):
    class Stop(Exception):
        pass

    def stop(done, _):
        if done == 2:
            raise Stop

    files = [saved(tmp_path, f"in/{i}.npy", counts(i)) for i in range(40)]
    with pytest.raises(Stop):
        cluster.recordings(client, files, out=tmp_path, progress=stop)
    many = cluster.recordings(client, files, out=tmp_path)
    kept = sum(one.is_kept for one in many.results)
    assert 2 <= kept < 40 and not many.failed
    for file, one in zip(files, many.results):
        events, _ = dtof.read_events(Path(one.folder) / "events.aer")
        assert events.tobytes() == dtof.replay(file).events.tobytes()


def test_a_task_that_runs_twice_at_a_time_is_no_error(tmp_path, monkeypatch):
    file = str(saved(tmp_path, "in/a.npy", counts()))
    run = dtof.replay(file)
    ours = Folder(str(tmp_path / "a"), "aer", file, [])
    Folder(str(tmp_path / "a"), "npy", file, []).write(run)
    remove, removed = os.remove, []

    def after_the_other(place):
        if os.path.exists(place):
            removed.append(os.path.basename(place))
            remove(place)
        remove(place)

    monkeypatch.setattr(os, "remove", after_the_other)
    ours.write(run)
    assert removed == ["summary.json", "events.npy"] and ours.kept_statistics() == run.statistics


def test_invalid_lists_of_recordings(client, tmp_path):
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
    for name in ("..", "", "/a", "a/../b", "a//b", "a\0", "..\\b", "a\\..\\..\\b"):
        refused(lambda: recordings(client, [file], out=tmp_path, names=[name]), "names")
    refused(lambda: recordings(client, [file], names=["a"]), "give out")
    refused(lambda: recordings(client, [file], out=tmp_path / "none"), "none", "no such folder")
    refused(lambda: recordings(client, [file], events="csv"), "'csv'", "aer, npy")
    refused(lambda: recordings(client, [file], alpha=300), "alpha 300: ")
    refused(lambda: recordings(client, [file], nonsense=1), "nonsense is unknown")
    refused(lambda: recordings(None, [file]), "must be a distributed.Client")
    assert "no.toml" in recordings(client, [file], settings="no.toml").results[0].error
    both = recordings(client, [file, other], out=tmp_path, names=["x/1", "x/2"])
    assert not both.failed and (tmp_path / "x" / "2" / "summary.json").exists()
