"""The events are those of the program, byte for byte."""

import csv
import json

import numpy
import pytest

import dtof

OPTIONS = {
    "plain": {},
    "window": {"rule": "window", "sigma_bins": 0.8, "l1": 4, "echoes": 2, "echo_wait": 4},
    "blocks": {"binning": 2, "patience": 16, "rule": "paper", "alpha": 8, "min_count": 7},
    "frame": {"frame": 500},
    "sensor": {"bin_width_ps": 92.1, "offset_mm": -179.5, "gate": (2, 90), "mask": [0, 5]},
    "offsets": {"offsets_mm": [-78.0, 12.5, *range(22)], "mask": [2], "binning": 1, "patience": 16, "l1": 60},
    "run": {"photons_per_cycle": 0.3, "seed": 9, "cycles": 3001, "laser_hz": 5_000_000},
    "bins": {"rebin": 3, "bins": 32},
}


def counts(rows=4, columns=6, bins=100):
    random = numpy.random.default_rng(3)
    counts = random.poisson(3.0, size=(rows, columns, bins))
    counts[..., 40:43] += random.poisson(90.0, size=(rows, columns, 3))
    return counts


def flags_of(options):
    """Keywords as flags, independently of the package."""
    texts = []
    for key, value in options.items():
        if key == "gate":
            value = f"{value[0]}..{value[1]}"
        elif isinstance(value, (list, tuple)):
            value = ",".join(map(str, value))
        texts += [f"--{key.replace('_', '-')}", str(value)]
    return [text for text in texts if text != "True"]


def equals_the_program(run, folder, path):
    """Compares all results with the folder of the program."""
    dtof.write_events(path, run.events, run.array)
    assert path.read_bytes() == (folder / "events.aer").read_bytes()
    with open(folder / "events.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == run.events.size
    for name in rows[0] if rows else ():
        written = numpy.array([float(row[name]) for row in rows])
        tolerance = {"depth_bins": 5.1e-5, "range_mm": 5.1e-4}.get(name, 0)
        assert (abs(run.events[name] - written) <= tolerance).all(), name
    summary = json.loads((folder / "summary.json").read_text())
    for key in set(summary) - {"input", "export_with"}:
        assert run.statistics[key] == summary[key], key
    assert run.toml == (folder / "dtof.toml").read_text()


@pytest.mark.parametrize("name", OPTIONS)
def test_histograms(program, tmp_path, name):
    array = counts()
    numpy.save(tmp_path / "counts.npy", array)
    options = OPTIONS[name]
    out = tmp_path / "out"
    program("replay", "--input", tmp_path / "counts.npy", "--out", out, "--quiet", *flags_of(options))
    equals_the_program(dtof.replay(array, **options), out, tmp_path / "array.aer")
    run = dtof.replay(tmp_path / "counts.npy", **options)
    equals_the_program(run, out, tmp_path / "file.aer")
    assert run.events.size >= 24


@pytest.mark.parametrize("dtype", ["u1", "f2", "<u2", ">u2", "<i4", ">i8", "<f4", ">f8", "u8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_every_type_and_order_is_the_same_array(dtype, order):
    array = numpy.minimum(counts(), 255)
    expected = dtof.replay(array).events
    given = numpy.array(array, dtype=dtype, order=order)
    assert dtof.replay(given).events.tobytes() == expected.tobytes()
    assert dtof.replay(given.tolist()).events.tobytes() == expected.tobytes()


def test_bits_are_counts():
    array = counts() > 4
    assert dtof.replay(array).events.tobytes() == dtof.replay(array.astype(int)).events.tobytes()
    assert (dtof.load(array).counts[0, ..., :100] == array).all()


@pytest.mark.parametrize("mask", [[], (), numpy.flatnonzero([0, 0])])
def test_a_mask_may_be_empty(mask):
    run = dtof.replay(counts(), mask=mask)
    assert run.statistics["masked"] == 0
    assert run.events.tobytes() == dtof.replay(counts()).events.tobytes()


def test_an_empty_mask_leaves_that_of_the_settings(tmp_path):
    (tmp_path / "hot.toml").write_text("[sensor]\nmasked = [1]\n")
    masked = [
        dtof.replay(counts(), settings=tmp_path / "hot.toml", **more).statistics["masked"]
        for more in [{}, {"mask": []}, {"mask": None}, {"mask": [0]}]
    ]
    assert masked[0] == masked[1] == masked[2] > 0
    assert dtof.replay(counts(), mask=[0]).statistics["masked"] == masked[3]


def test_the_bins_may_be_any_axis():
    array = counts()
    expected = dtof.replay(array).events.tobytes()
    for axis in (0, 1, -2):
        assert dtof.replay(numpy.moveaxis(array, -1, axis), axis=axis).events.tobytes() == expected
    turned = array.transpose(2, 0, 1)
    for axes in ("bins,rows,columns", ["bins", "rows", "columns"]):
        assert dtof.replay(turned, axes=axes).events.tobytes() == expected
    # A view that is not contiguous.
    wide = numpy.zeros((4, 12, 200), dtype=int)
    wide[:, ::2, ::2] = array
    assert dtof.replay(wide[:, ::2, ::2]).events.tobytes() == expected


def photon_list(photons=20_000):
    random = numpy.random.default_rng(4)
    cycle = numpy.sort(random.integers(0, 5000, photons))
    pixel = random.integers(0, 12, photons)
    bin = numpy.where(random.random(photons) < 0.3, 60, random.integers(0, 128, photons))
    return pixel, cycle, bin


@pytest.mark.parametrize("options", [{}, {"columns": 4, "binning": 1}, {"bins": 64, "rebin": 2}])
def test_photons(program, tmp_path, options):
    pixel, cycle, bin = photon_list()
    dtype = [("bin", ">i8"), ("extra", "f4"), ("cycle", "<u8"), ("pixel", "u1")]
    records = numpy.zeros(pixel.size, dtype=dtype)
    records["pixel"], records["cycle"], records["bin"] = pixel, cycle, bin
    numpy.save(tmp_path / "photons.npy", records)
    out = tmp_path / "out"
    program("replay", "--input", tmp_path / "photons.npy", "--out", out, "--quiet", *flags_of(options))
    equals_the_program(dtof.replay(records, **options), out, tmp_path / "records.aer")
    run = dtof.photons(pixel, cycle, bin, **options)
    run.statistics["recording"].setdefault("fields not read", "extra")  # there are none
    equals_the_program(run, out, tmp_path / "columns.aer")


def test_one_number_may_stand_for_all_photons():
    _, cycle, bin = photon_list()
    one = dtof.photons(3, cycle, bin).events
    assert one.tobytes() == dtof.photons(numpy.full(cycle.size, 3), cycle, bin).events.tobytes()
    assert set(one["pixel"]) == {3}


def test_photons_may_be_far_apart():
    run = dtof.photons([0] * 5, [0, 1, 2, 3, 10**9 + 2], [9] * 5, cycles=100)
    assert run.statistics["photons"] == 4 and run.statistics["not_replayed"] == 1
    with pytest.raises(
        dtof.Error, match="cycle 1000000003 comes 1,000,000,000 laser cycles after the photon before it"
    ):
        dtof.photons([0] * 5, [0, 1, 2, 3, 10**9 + 3], [9] * 5, cycles=100)


def test_photons_are_replayed_to_the_last(tmp_path):
    given = [1, 1, 1], [1, 20_000, 30_000], [3, 3, 3]
    run = dtof.photons(*given)
    assert run.statistics["photons"] == 3 and run.statistics["not_replayed"] == 0
    # Its settings repeat the run, and may request fewer cycles.
    toml = tmp_path / "dtof.toml"
    toml.write_text(run.toml)
    numpy.save(
        tmp_path / "photons.npy",
        numpy.array(list(zip(*given)), dtype=[("pixel", "u2"), ("cycle", "u4"), ("bin", "u2")]),
    )
    again = dtof.replay(tmp_path / "photons.npy", settings=toml)
    assert again.statistics["photons"] == 3 and again.toml == run.toml
    toml.write_text("[run]\ncycles = 20_001\n")
    for options in [{"settings": toml}, {"cycles": 20_001}]:
        statistics = dtof.photons(*given, **options).statistics
        assert statistics["photons"] == 2 and statistics["not_replayed"] == 1


def test_the_tmf8820_log(program, tmp_path, recorded):
    log = recorded("tmf8820_plane_gt/distance_data.json")
    options = {"photons_per_cycle": 0.5, "rule": "window", "sigma_bins": 0.75, "l1": 4, "x": 4}
    out = tmp_path / "out"
    program("replay", "--input", log, "--out", out, "--quiet", *flags_of(options))
    run = dtof.replay(log, **options)
    equals_the_program(run, out, tmp_path / "log.aer")
    assert run.events.size > 100_000
    loaded = dtof.load(log)
    assert loaded.counts.shape == (159, 1, 9, 128) and loaded.bin_width_ps == pytest.approx(92.1, 1e-5)
    raw = json.loads(log.read_text())
    hists = numpy.array([capture["hists"] for capture in raw])
    assert (loaded.counts == hists.reshape(loaded.counts.shape)).all()
    truth = numpy.array([capture["dist_to_plane"] for capture in raw]) * 1000
    assert numpy.allclose(loaded.truth_mm[:, 0, 4], truth)
    assert numpy.isnan(numpy.delete(loaded.truth_mm, 4, axis=2)).all()


def test_the_tmf8829_log(program, tmp_path, recorded):
    log = recorded("tmf8829_log/tmf8829_log.json.gz")
    out = tmp_path / "out"
    program("replay", "--input", log, "--out", out, "--quiet")
    equals_the_program(dtof.replay(log), out, tmp_path / "log.aer")


def test_a_scene(program, tmp_path):
    from conftest import ROOT

    scene = ROOT / "scenes" / "fan.toml"
    options = {"cycles": 3000, "array": (8, 6), "l1": 60, "seed": 2}
    out = tmp_path / "out"
    texts = ["--cycles", "3000", "--array", "8x6", "--l1", "60", "--seed", "2"]
    program("simulate", "--scene", scene, "--out", out, "--quiet", *texts)
    run = dtof.simulate(scene, **options)
    equals_the_program(run, out, tmp_path / "file.aer")
    text = dtof.simulate(scene.read_text(), **options)
    assert text.events.tobytes() == run.events.tobytes()
    assert dtof.simulate(scene, laser_off=True, **options).events.size < run.events.size


def test_settings_of_a_run_repeat_it(tmp_path):
    array = counts()
    first = dtof.replay(array, rule="window", sigma_bins=0.7, l1=8, photons_per_cycle=0.4)
    (tmp_path / "dtof.toml").write_text(first.toml)
    again = dtof.replay(array, settings=tmp_path / "dtof.toml")
    assert again.events.tobytes() == first.events.tobytes()
    assert again.settings == first.settings and first.settings["detection"]["l1"] == 8


def test_events_are_read_as_they_were_written(tmp_path):
    run = dtof.replay(counts(), binning=1, echoes=2, laser_hz=7)
    dtof.write_events(tmp_path / "a.aer", run.events, run.array)
    events, array = dtof.read_events(tmp_path / "a.aer")
    assert events.tobytes() == run.events.tobytes() and array == run.array
    # Other types of the same fields, and others beside them.
    wide = numpy.zeros(events.size, [(name, "f8") for name in (*events.dtype.names, "other")])
    for name in events.dtype.names:
        wide[name] = events[name]
    dtof.write_events(tmp_path / "b.aer", wide, array)
    assert (tmp_path / "b.aer").read_bytes() == (tmp_path / "a.aer").read_bytes()
    dtof.write_events(tmp_path / "none.aer", events[:0], array)
    assert dtof.read_events(tmp_path / "none.aer")[0].size == 0


def test_events_have_one_layout_on_every_machine():
    fields = [dtof.EVENT.fields[name] for name in dtof.EVENT.names]
    assert [at for _, at in fields] == [0, 8, 10, 12, 16, 24, 32, 36, 40, 41, 42]
    assert dtof.EVENT.itemsize == 48
    # Explicit, independent of the alignment of a compiler.
    assert not dtof.EVENT.isalignedstruct


def test_every_loss_is_counted():
    array = counts()
    statistics = dtof.replay(array, bins=64, gate=(10, 60), mask=[1], cycles=50).statistics
    offered = sum(statistics[key] for key in ("photons", "masked", "not_replayed", "cut_off"))
    assert offered == array.sum()
    assert min(statistics[key] for key in ("gated_out", "masked", "not_replayed", "cut_off")) > 0


def test_suspicious_recordings_give_a_warning():
    with pytest.warns(UserWarning, match="no photons: all 2 histograms are empty"):
        dtof.replay(numpy.zeros((2, 16), dtype=int))
    with pytest.warns(UserWarning, match="bins of 0.25 ps"):
        dtof.replay(counts(), bin_width_ps=0.25)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(
    "name,options",
    [
        ("replay", {}),
        ("load", {}),
        ("calibrate", {}),
        ("compare", {"within": 1000, "cycles": 6000}),
    ],
)
def test_a_warning_names_the_line_that_called(name, options):
    with pytest.warns(UserWarning, match="photons in bins that were cut off") as warned:
        getattr(dtof, name)(counts(2, 2), bins=64, **options)
    assert {warning.filename for warning in warned} == {__file__}


def test_a_brighter_cover_glass_is_reported(program, tmp_path):
    (tmp_path / "dtof.toml").write_text(
        "[sensor]\ngate = [10, 127]\nglass = 0.1\nglass_bins = [0.0, 0.0, 0.05, 0.05, 0, 0, 0, 0, 0, 0]\n"
    )
    array = counts(bins=128)
    array[..., 2:4] += 4000
    numpy.save(tmp_path / "counts.npy", array)
    options = {"recorded_cycles": 10_000, "settings": tmp_path / "dtof.toml"}
    out = tmp_path / "out"
    program("replay", "--input", tmp_path / "counts.npy", "--out", out, "--quiet", *flags_of(options))
    run = dtof.replay(array, **options)
    equals_the_program(run, out, tmp_path / "a.aer")
    assert run.statistics["cover_glass"][0] > 2
