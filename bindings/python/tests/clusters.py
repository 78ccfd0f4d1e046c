"""A scheduler and two worker processes, started by the commands of docs/clusters.md."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import dask
from distributed import Client

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "clusters.md"
README = ROOT / "bindings" / "python" / "README.md"


def blocks(language, page=PAGE):
    """The blocks of a page, as they stand."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.M | re.S)


class Cluster:
    """Runs the commands in ``folder``."""

    def __init__(self, folder):
        self.folder = folder
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        # Nobody waits long for a worker that was killed.
        options = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "2s"}
        self._env = {**os.environ, "PATH": path, **options}
        self._env.pop("RAYON_NUM_THREADS", None)
        commands = next(block for block in blocks("sh") if "dask scheduler" in block)
        scheduler, *workers = [line.removesuffix("&").split() for line in commands.splitlines()]
        self._worker = workers[0]
        assert len(workers) == 2
        self._processes = [self._start([*scheduler, "--port", "0", "--no-dashboard"])]
        for worker in workers:
            self._processes.append(self._start([*worker, "--no-dashboard"]))
        while not (folder / "scheduler.json").exists():
            time.sleep(0.05)
        dask.config.set({"distributed.comm.timeouts.connect": "2s"})
        self.client = Client(scheduler_file=str(folder / "scheduler.json"))
        self.client.wait_for_workers(2, timeout=60)

    def _start(self, command):
        log = open(self.folder / "log.txt", "ab")
        return subprocess.Popen(
            command, cwd=self.folder, env=self._env, stdout=log, stderr=log, start_new_session=True
        )

    def kill_one(self, that_works=True):
        """Kills a worker process, while it has a task if wanted. Its nanny starts another."""
        pids = self.client.run(os.getpid)
        until = time.monotonic() + 5
        while time.monotonic() < until:
            ready = [worker for worker, tasks in self.client.processing().items() if tasks]
            ready = ready if that_works else list(pids)
            if ready:
                os.kill(pids[ready[0]], signal.SIGKILL)
                return pids[ready[0]]
        raise AssertionError("no worker has a task")

    def all_there(self):
        self.client.wait_for_workers(2, timeout=60)

    def close(self):
        self.client.close()
        for process in self._processes:
            # With what it has started.
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
