"""Long work: progress, Ctrl-C, other threads, other processes."""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from pathlib import Path

import numpy
import pytest

import dtof


def long_work(progress=None):
    """Takes minutes unless it is interrupted."""
    counts = numpy.full((64, 64, 128), 200_000, dtype="u4")
    return dtof.replay(counts, cycles=1_000_000, photons_per_cycle=2, progress=progress)


def test_ctrl_c_ends_it_within_half_a_second():
    sent = interrupt_after(1.5)
    with pytest.raises(KeyboardInterrupt):
        long_work()
    assert time.monotonic() - sent[0] < 0.5


def dim_tune(rule, progress=None):
    """Takes seconds or minutes unless it is interrupted."""
    return dtof.tune(background=0.01, signal=0.004, sigma_bins=1, l2=50_000, x=11, rule=rule, progress=progress)


def long_calibration(progress=None):
    """Takes seconds unless it is interrupted."""
    counts = numpy.full((8, 8, 1024), 40_000)
    counts[..., 300] += 50_000
    return dtof.calibrate(counts, recorded_cycles=100_000, progress=progress)


LONG = {
    "compare": lambda: dtof.compare(
        numpy.random.default_rng(1).poisson(9.0, (16, 16, 128)) + 200 * (numpy.arange(128) == 40), sigma_bins=0.5
    ),
    "paper": lambda: dim_tune("paper"),
    "average": lambda: dim_tune("average"),
    "window": lambda: dim_tune("window"),
    "calibrate": long_calibration,
}


def interrupt_after(seconds):
    """Sends Ctrl-C to this process; the list gets the time of that."""
    sent = []

    def interrupt():
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(seconds, interrupt).start()
    return sent


@pytest.mark.parametrize("work", LONG)
def test_ctrl_c_ends_every_kind_of_work(work):
    sent = interrupt_after(0.3)
    with pytest.raises(KeyboardInterrupt):
        LONG[work]()
    assert time.monotonic() - sent[0] < 0.5


def working():
    """The threads of this process that work."""
    found = set()
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(OSError):  # it has ended
            if (task / "comm").read_text() == "dtof\n":
                found.add(task.name)
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted in /proc")
@pytest.mark.parametrize("work", sorted(set(LONG) - {"compare"}))
def test_nothing_works_on_unseen(work):
    while working():  # a comparison that was interrupted
        time.sleep(0.1)
    interrupt_after(0.3)
    with pytest.raises(KeyboardInterrupt):
        LONG[work]()
    # Of the processor: other programs may keep this one waiting.
    begun = time.process_time()
    while working():
        assert time.process_time() - begun < 0.5
        time.sleep(0.01)


@pytest.mark.parametrize("work", [lambda progress: dim_tune("average", progress), long_calibration])
def test_progress_comes_in_the_first_second(work):
    class Enough(Exception):
        pass

    calls = []

    def progress(done, total):
        calls.append((time.monotonic(), done, total))
        if 0 < done < total:
            raise Enough

    begun = time.monotonic()
    with pytest.raises(Enough):
        work(progress)
    # At first that nothing is done yet.
    assert calls[0][0] - begun < 1 and calls[0][1] < calls[0][2]


def test_progress_is_called_in_the_calling_thread_until_the_end():
    told = []
    counts = numpy.full((16, 16, 64), 50)
    dtof.replay(counts, progress=lambda *at: told.append((at, threading.get_ident())))
    ats = [at for at, _ in told]
    assert {thread for _, thread in told} == {threading.get_ident()}
    assert ats == sorted(ats) and ats[-1][0] == ats[-1][1] > 0
    steps = []
    scene = 'columns = 8\nrows = 8\nbackground = 0.02\n[[surface]]\nkind = "plane"\n'
    with contextlib.suppress(dtof.Error):
        dtof.compare(scene=scene, progress=lambda step, share: steps.append((step, share)))
    assert all(isinstance(step, str) and 0 <= share <= 1 for step, share in steps)


def test_an_exception_in_progress_ends_the_work():
    class Stop(Exception):
        pass

    def progress(done, total):
        if done:
            raise Stop

    begun = time.monotonic()
    with pytest.raises(Stop):
        long_work(progress)
    assert time.monotonic() - begun < 20
    with pytest.raises(TypeError):
        dtof.replay(numpy.full((2, 16), 9), progress=3)


def test_other_threads_continue():
    turns = []
    stop = threading.Event()

    def count():
        while not stop.is_set():
            turns.append(time.monotonic())
            time.sleep(0.005)

    thread = threading.Thread(target=count)
    thread.start()
    begun = time.monotonic()
    dtof.replay(numpy.full((64, 64, 128), 300), photons_per_cycle=2)
    ended = time.monotonic()
    stop.set()
    thread.join()
    during = [turn for turn in turns if begun < turn < ended]
    assert len(during) > 0.2 * (ended - begun) / 0.005


def test_threads_and_processes_give_the_same_events():
    expected = _events()
    results = []
    threads = [threading.Thread(target=lambda: results.append(_events())) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [expected] * 4
    # After a fork the threads of the parent are gone.
    for method in ("fork", "spawn"):
        with multiprocessing.get_context(method).Pool(2) as pool:
            assert pool.map_async(_events, [0, 1]).get(timeout=60) == [expected] * 2


def _events(_=0):
    return dtof.replay(numpy.full((8, 8, 32), 60) + 300 * (numpy.arange(32) == 9)).events.tobytes()
