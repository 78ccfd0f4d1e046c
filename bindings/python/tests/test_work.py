"""Long work: progress, Ctrl-C, other threads, other processes."""

import multiprocessing
import os
import signal
import threading
import time

import numpy
import pytest

import dtof


def long_work(progress=None):
    """Takes minutes unless it is interrupted."""
    counts = numpy.full((64, 64, 128), 200_000, dtype="u4")
    return dtof.replay(counts, cycles=1_000_000, photons_per_cycle=2, progress=progress)


def test_ctrl_c_ends_it_within_a_second():
    sent = []

    def interrupt():
        time.sleep(1.5)
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        long_work()
    assert time.monotonic() - sent[0] < 1
    thread.join()


@pytest.mark.parametrize("long", [
    lambda: dtof.compare(numpy.random.default_rng(1).poisson(9.0, (16, 16, 128))
                         + 200 * (numpy.arange(128) == 40), sigma_bins=0.5),
    lambda: dtof.tune(background=0.01, signal=0.02, sigma_bins=1, l2=50_000, x=11, rule="average"),
])
def test_ctrl_c_ends_every_kind_of_work(long):
    begun = time.monotonic()
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        long()
    assert time.monotonic() - begun < 1.3


def test_progress_is_called_in_the_calling_thread_until_the_end():
    told = []
    counts = numpy.full((16, 16, 64), 50)
    dtof.replay(counts, progress=lambda *at: told.append((at, threading.get_ident())))
    ats = [at for at, _ in told]
    assert {thread for _, thread in told} == {threading.get_ident()}
    assert ats == sorted(ats) and ats[-1][0] == ats[-1][1] > 0
    steps = []
    scene = "columns = 8\nrows = 8\nbackground = 0.02\n[[surface]]\nkind = \"plane\"\n"
    try:
        dtof.compare(scene=scene, progress=steps.append)
    except dtof.Error:
        pass
    assert all(isinstance(step, str) for step in steps)


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
