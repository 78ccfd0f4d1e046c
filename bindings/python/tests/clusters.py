"""A scheduler and two worker processes, started by the commands of docs/clusters.md, and helpers for
tests."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import dask
import numpy
import pytest
from distributed import Client

import dtof

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "clusters.md"
README = ROOT / "bindings" / "python" / "README.md"


def blocks(language, page=PAGE):
    """The code blocks of a page in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.M | re.S)


class Cluster:
    """Runs the commands in ``folder``."""

    def __init__(self, folder):
        self.folder = folder
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        # Do not wait long for a killed worker.
        options = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "2s"}
        self._env = {**os.environ, "PATH": path, **options}
        self._env.pop("RAYON_NUM_THREADS", None)
        commands = next(block for block in blocks("sh") if "dask scheduler" in block)
        scheduler, *workers = [line.removesuffix("&").split() for line in commands.splitlines()]
        self._worker = workers[0]
        assert len(workers) == 2
        self.processes = [self._start([*scheduler, "--port", "0", "--no-dashboard"])]
        for worker in workers:
            self.processes.append(self._start([*worker, "--no-dashboard"]))
        while not (folder / "scheduler.json").exists():
            time.sleep(0.05)
        dask.config.set({"distributed.comm.timeouts.connect": "2s"})
        self.client = Client(scheduler_file=str(folder / "scheduler.json"))
        self.client.wait_for_workers(2, timeout=60)

    def _start(self, command):
        with open(self.folder / "log.txt", "ab") as log:
            return subprocess.Popen(
                command, cwd=self.folder, env=self._env, stdout=log, stderr=log, start_new_session=True
            )

    def kill_one(self, busy=True):
        """Kills a worker process, by default while it has a task. Its nanny starts another."""
        pids = self.client.run(os.getpid)
        until = time.monotonic() + 5
        while time.monotonic() < until:
            ready = [worker for worker, tasks in self.client.processing().items() if tasks]
            ready = ready if busy else list(pids)
            if ready:
                os.kill(pids[ready[0]], signal.SIGKILL)
                return pids[ready[0]]
        raise AssertionError("no worker has a task")

    def wait_for_workers(self):
        self.client.wait_for_workers(2, timeout=60)

    def close(self):
        self.client.close()
        for process in self.processes:
            # With its child processes.
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


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


def contents(folder):
    """All files, except temporary files of a killed process."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files if not path.name.endswith(".partial")}
