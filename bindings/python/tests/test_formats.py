"""The code of the page for each foreign format."""

import os
import re
from importlib import metadata
from pathlib import Path

import h5py
import numpy
import ptufile
import pytest
import scipy.io

import dtof

PAGE = Path(__file__).resolve().parents[1] / "README.md"


def lines_with(word):
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (block,) = [block for block in blocks if word in block]
    code = [line for line in block.splitlines() if line.strip()]
    assert len(code) <= 6, code
    return block


def run_in(folder, code):
    names, before = {}, os.getcwd()
    os.chdir(folder)
    try:
        exec(compile(code, str(PAGE), "exec"), names)
    finally:
        os.chdir(before)
    return names["run"]


@pytest.fixture
def counts():
    random = numpy.random.default_rng(8)
    counts = random.poisson(2.0, (4, 5, 100)).astype("u2")
    counts[..., 30:33] += 80
    return counts


def test_mat(tmp_path, counts):
    scipy.io.savemat(tmp_path / "recording.mat", {"counts": counts, "bin_width_ps": 80.0})
    run = run_in(tmp_path, lines_with("scipy.io.loadmat"))
    assert run.events.tobytes() == dtof.replay(counts, bin_width_ps=80).events.tobytes()


def test_hdf5(tmp_path, counts):
    with h5py.File(tmp_path / "recording.h5", "w") as file:
        file["counts"] = counts
        file["counts"].attrs["bin_width_ps"] = 80.0
    run = run_in(tmp_path, lines_with("h5py.File"))
    assert run.events.tobytes() == dtof.replay(counts, bin_width_ps=80).events.tobytes()


def test_ptu(tmp_path, counts):
    ptufile.imwrite(tmp_path / "recording.ptu", counts, 1e-7, 80e-12)
    run = run_in(tmp_path, lines_with("ptufile.PtuFile"))
    expected = dtof.replay(counts, bin_width_ps=80, rebin=4)
    assert run.array.bin_width_ps == expected.array.bin_width_ps == 320
    assert run.statistics["photons"] > 0
    peaks = numpy.bincount(run.events["peak_bin"]).argmax()
    assert peaks == numpy.bincount(expected.events["peak_bin"]).argmax() == 7


def test_the_first_lines_of_the_page(tmp_path, counts):
    numpy.save(tmp_path / "counts.npy", counts)
    run = run_in(tmp_path, lines_with("numpy.load"))
    assert run.events.size > 50


def test_the_package_has_its_licences():
    package = metadata.distribution("dtof")
    names = package.metadata.get_all("License-File")
    assert sorted(names) == ["LICENSE-APACHE", "LICENSE-MIT"]
    for name in names:
        text = (PAGE.parents[2] / name).read_text()
        assert package.read_text(f"licenses/{name}") == text and len(text) > 1000


def test_csv_and_archives(tmp_path, counts):
    numpy.savez_compressed(tmp_path / "counts.npz", counts=counts, other=counts[:1])
    loaded = dtof.load(tmp_path / "counts.npz", array="counts")
    assert loaded.counts.shape == (1, 4, 5, 128)
    assert (loaded.counts[0, ..., :100] == counts).all() and loaded.gate == (0, 99)
    (tmp_path / "photons.csv").write_text("pixel,cycle,bin\n0,0,3\n2,5,3\n2,5,9\n")
    loaded = dtof.load(tmp_path / "photons.csv")
    assert loaded.counts.shape == (1, 1, 3, 128) and loaded.cycles == 6
    assert loaded.counts.sum() == 3 and loaded.counts[0, 0, 2, 9] == 1
    assert dtof.load(tmp_path / "photons.csv", cycles=5).counts.sum() == 1
