"""Seeds on many machines, the workers themselves, and the pages."""

import os
from pathlib import Path

import numpy
import pytest

import dtof

pytest.importorskip("distributed")

import dask.array

from clusters import PAGE, README, are_equal, blocks, counts, refused, saved
from conftest import ROOT
from dtof import cluster
from dtof.cluster._worker import begin

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
    # Pixels see the wall at their angle; the spread is that of one seed.
    one = trials.statistics[0]["against_truth"]
    assert abs(truth["rms_mm"] / one["rms_mm"] - 1) < 0.2
    rms = [run["against_truth"]["rms_mm"] ** 2 for run in trials.statistics]
    assert truth["rms_mm"] ** 2 == pytest.approx(numpy.average(rms, weights=list(map(len, ranges))))
    bias = [run["against_truth"]["bias_mm"] for run in trials.statistics]
    assert truth["bias_mm"] == pytest.approx(numpy.average(bias, weights=list(map(len, ranges))))


def test_invalid_seeds(client):
    seeds = cluster.seeds
    refused(lambda: seeds(client, SCENE, []), "there are none")
    refused(lambda: seeds(client, SCENE, [1, 2, 1]), "seed 1", "twice")
    refused(lambda: seeds(client, SCENE, [1.5]), "whole numbers")
    refused(lambda: seeds(client, SCENE, 3), "whole numbers")
    refused(lambda: seeds(client, SCENE, [-1]), "seed -1: ")
    refused(lambda: seeds(client, SCENE, [1], seed=3), "give seeds")
    refused(lambda: seeds(client, "none.toml", [1]), "none.toml")
    refused(lambda: seeds(client, "columns = x\n", [1]), "the scene")
    one, two = (seeds(client, SCENE, [1], **{**SMALL, "alpha": alpha}) for alpha in (8, 9))
    refused(lambda: one + one, "seed 1 is in both")
    refused(lambda: one + cluster.Seeds([2], two.statistics, one.scene_sha256), "alpha differs")


def test_runs_of_different_scenes_cannot_be_added(client):
    """Nor runs of different options that summaries do not show."""
    scene = "columns = 4\nrows = 2\nbackground = 0.02\n"
    scene += "[[surface]]\nname = 'wall'\nrange_mm = 1500\nreflectivity = 0.5\n"
    one = cluster.seeds(client, scene, [1], cycles=300)
    others = [
        cluster.seeds(client, scene.replace("1500", "900"), [2], cycles=300),
        cluster.seeds(client, scene, [2], cycles=300, array=(2, 4)),
        cluster.seeds(client, scene, [2], cycles=300, laser_off=True),
    ]
    for other in others:
        refused(lambda: one + other, "different scenes or options", "scene_sha256 differs")
    assert (one + cluster.seeds(client, scene, [2], cycles=300)).seeds == [1, 2]


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
        lambda: cluster.replay(client, file, rule="paper"),
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
    # A worker that joins later checks its own version.
    refused(client.submit(begin, "0.0.9", pure=False).result, "has dtof", "not 0.0.9")


def test_a_cluster_listens_on_this_computer_alone(dask_cluster, client):
    import psutil

    addresses = []
    for started in dask_cluster.processes:
        process = psutil.Process(started.pid)
        for one in [process, *process.children(recursive=True)]:
            sockets = one.net_connections(kind="inet")
            addresses += [socket.laddr.ip for socket in sockets if socket.status == psutil.CONN_LISTEN]
    # A scheduler, and two workers with a nanny each.
    assert len(addresses) >= 5
    assert set(addresses) == {"127.0.0.1"}
    print(f"doors: {len(addresses)} sockets of a Dask cluster listen, all on 127.0.0.1")


# The pages.


@pytest.fixture
def namespace(dask_cluster, client, tmp_path, monkeypatch):
    """Names for the code of the pages, in a folder with all files that they use."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scheduler.json").write_text((dask_cluster.folder / "scheduler.json").read_text())
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
def test_pages_run_unchanged(namespace, page):
    for block in blocks("python", page):
        if page == PAGE or "cluster" in block:
            exec(block, namespace)
    assert len(namespace["many"].results) == 3 and not namespace["many"].failed
    assert Path("results/2/events.aer").exists()
    large = Path("large.npy").absolute()
    expected = dtof.replay(large, settings=dtof.calibrate(large, bin_width_ps=250))
    are_equal(namespace["run"], expected, page == PAGE)
    assert namespace["trials"].totals["events"] > 500
