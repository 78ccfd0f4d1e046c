"""The commands and the program of docs/clusters.md."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy
import psutil
import pytest

import dtof
from conftest import ROOT


def blocks(language):
    """The code of the page in a language."""
    page = (ROOT / "docs" / "clusters.md").read_text()
    return re.findall(rf"^```{language}\n(.*?)^```$", page, re.M | re.S)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """The folder in which the commands start a cluster, and its processes."""
    folder = tmp_path_factory.mktemp("cluster")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    commands = next(block for block in blocks("sh") if "dask scheduler" in block)
    # Other tests may have schedulers, too.
    commands = commands.replace("dask scheduler", "dask scheduler --port 0")
    with open(folder / "log.txt", "wb") as log:
        started = subprocess.Popen(
            ["sh", "-c", f"{commands}wait"],
            cwd=folder,
            env={**os.environ, "PATH": path},
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
    until = time.monotonic() + 60
    while (folder / "log.txt").read_text().count("Registered to:") < 2:
        assert started.poll() is None and time.monotonic() < until, (folder / "log.txt").read_text()
        time.sleep(0.1)
    yield folder, [psutil.Process(started.pid), *psutil.Process(started.pid).children(recursive=True)]
    os.killpg(started.pid, signal.SIGKILL)
    started.wait()


def test_a_cluster_listens_on_this_computer_alone(cluster):
    addresses = []
    for process in cluster[1]:
        sockets = process.net_connections(kind="inet")
        addresses += [socket.laddr.ip for socket in sockets if socket.status == psutil.CONN_LISTEN]
    # A scheduler, and two workers with a nanny each.
    assert len(addresses) >= 5
    assert set(addresses) == {"127.0.0.1"}
    print(f"doors: {len(addresses)} sockets of a Dask cluster listen, all on 127.0.0.1")


def test_the_program_of_the_page_has_the_events_of_one_machine(cluster):
    folder, processes = cluster
    (folder / "recordings").mkdir()
    random = numpy.random.default_rng(3)
    for number in range(3):
        counts = random.poisson(3.0, size=(4, 6, 100))
        counts[..., 40:43] += random.poisson(90.0, size=(4, 6, 3))
        numpy.save(folder / f"recordings/{number}.npy", counts)
    (folder / "recordings/text.npy").write_text("no array")
    program = "".join(blocks("python"))

    def printed():
        done = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True)
        return done.stdout.splitlines()

    first = printed()
    files = [f"recordings/{number}.npy" for number in range(3)]
    expected = [dtof.replay(folder / file, bin_width_ps=250).events for file in files]
    assert first[:3] == [f"{file}: {events.size} events" for file, events in zip(files, expected)]
    for file, events in zip(files, expected):
        assert events.size > 100
        assert dtof.read_events(folder / f"{file}.aer")[0].tobytes() == events.tobytes()
    assert first[3].startswith("recordings/text.npy: ") and "not an .npy" in first[3]

    namespace = {"dtof": dtof}
    exec(blocks("python")[1].split("trials =")[0], namespace)
    trials = [namespace["trial"](seed) for seed in range(100)]
    assert first[4] == f"{sum(trial['events'] for trial in trials)} events"
    assert first[5] == f"{max(trial['against_truth']['rms_mm'] for trial in trials)} mm at most"

    # One thread for each worker.
    names = [Path(f"/proc/{process.pid}/task").glob("*/comm") for process in processes]
    threads = [sum(name.read_text().startswith("dtof-") for name in of_process) for of_process in names]
    assert set(threads) <= {0, 1} and 1 in threads

    # After an interruption only recordings without events are left.
    assert printed() == first[3:]
