"""The live page of a run, by the program."""

import shutil
import urllib.request

import numpy
import pytest

import dtof


@pytest.fixture(scope="module")
def run():
    counts = numpy.full((2, 2, 64), 5) + 300 * (numpy.arange(64) == 30)
    return dtof.replay(counts, laser_hz=1_000_000)


@pytest.fixture
def installed(program, monkeypatch, tmp_path):
    """Puts the program into the path."""
    shutil.copy2(program.name, tmp_path / "dtof")
    monkeypatch.setenv("PATH", str(tmp_path))


def test_a_run_and_a_file_are_shown_until_the_page_is_closed(run, installed, tmp_path):
    file = tmp_path / "events.aer"
    run.write_events(file)
    for page in (run.view(browser=False, speed=0.5), dtof.view(file, browser=False)):
        with page:
            assert urllib.request.urlopen(page.address).status == 200
            assert page.address in page._repr_html_() and page.address in repr(page)
        with pytest.raises(OSError):
            urllib.request.urlopen(page.address)


def test_the_page_opens_in_the_browser(run, installed, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    with run.view() as page:
        assert opened == [page.address]


def test_the_file_of_a_run_is_removed(run, installed, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with run.view(browser=False):
        assert list(tmp_path.glob("dtof-*/events.aer"))
    assert not list(tmp_path.glob("dtof-*"))


def test_an_unknown_laser_rate_is_said(installed):
    run = dtof.replay(numpy.full((2, 64), 5) + 300 * (numpy.arange(64) == 30))
    with pytest.warns(UserWarning, match="the laser rate is not known"):
        run.view(browser=False).close()


def test_mistakes_are_one_line(run, installed, monkeypatch, tmp_path):
    file = tmp_path / "wrong.aer"
    file.write_bytes(b"nothing")
    with pytest.raises(dtof.Error, match="wrong.aer: "):
        dtof.view(file, browser=False)
    with pytest.raises(dtof.Error, match="^speed"):
        run.view(speed=-1, browser=False)
    with pytest.raises(dtof.Error, match="int: must be a run or the name of an AER file"):
        dtof.view(3)
    monkeypatch.setenv("PATH", str(tmp_path / "empty"))
    with pytest.raises(dtof.Error, match="^view needs the program dtof, which is not installed: cargo install"):
        run.view()
