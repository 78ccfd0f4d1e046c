"""Arrays and tables of other packages, and results in a notebook."""

import warnings

import numpy
import pytest

import dtof
from dtof import _warn

COUNTS = numpy.random.default_rng(5).poisson(3.0, (4, 6, 32)) + 40 * (numpy.arange(32) == 11)


def same(one, other):
    return (one.events == other.events).all() and one.array == other.array


def test_dimensions_with_names():
    xarray = pytest.importorskip("xarray")
    run = dtof.replay(COUNTS)
    for names in (("row", "column", "bin"), ("y", "x", "bins"), ("rows", "columns", "bins")):
        named = xarray.DataArray(COUNTS, dims=names)
        assert same(dtof.replay(named), run)
        assert same(dtof.replay(named.transpose(names[2], names[1], names[0])), run)
        assert (dtof.load(named.transpose(names[1], names[2], names[0])).counts == dtof.load(COUNTS).counts).all()
    with pytest.raises(dtof.Error, match="dimensions y, x, tof: must be some of .*rename"):
        dtof.replay(xarray.DataArray(COUNTS, dims=("y", "x", "tof")))
    assert same(dtof.replay(xarray.DataArray(COUNTS, dims=("y", "x", "tof")), axes="rows,columns,bins"), run)
    with pytest.raises(
        dtof.Error, match="y, x, time: none is bins, as they are read as rows, columns, captures; rename"
    ):
        dtof.replay(xarray.DataArray(COUNTS, dims=("y", "x", "time")))


def test_photons_in_one_array_or_table():
    pandas = pytest.importorskip("pandas")
    random = numpy.random.default_rng(6)
    cycle = numpy.sort(random.integers(0, 300, 4000))
    bin = numpy.where(random.random(4000) < 0.5, 20, random.integers(0, 128, 4000))
    pixel = random.integers(0, 4, 4000)
    run = dtof.photons(pixel, cycle, bin)
    table = pandas.DataFrame({"bin": bin, "note": "x", "cycle": cycle, "pixel": pixel})
    assert same(dtof.photons(numpy.stack([pixel, cycle, bin], axis=1)), run)
    assert same(dtof.photons(table), run) and same(dtof.photons(table.to_records()), run)
    assert same(dtof.replay(table, cycles=int(cycle[-1]) + 1), run)
    assert same(dtof.photons(table.rename(columns=str.upper)), run)
    assert same(dtof.replay(table.rename(columns={"pixel": "Pixel", "bin": " BIN"})), run)
    with pytest.raises(dtof.Error, match="photons: pixel is there 2 times: rename"):
        dtof.photons(table.rename(columns={"pixel": "Pixel", "note": "PIXEL"}))
    for wrong in (table.drop(columns="bin"), numpy.ones((5, 2), int), numpy.ones((5, 3)), [1, 2, 3], None):
        with pytest.raises(dtof.Error):
            dtof.photons(wrong)
    with pytest.raises(dtof.Error, match="bin is missing: .* not note, cycle, pixel; .*to_numpy"):
        dtof.replay(table.drop(columns="bin"))


def test_sparse_small_floats_and_fortran_order():
    sparse = pytest.importorskip("scipy.sparse")
    flat = COUNTS.reshape(24, 32)
    assert same(dtof.replay(sparse.csr_matrix(flat)), dtof.replay(flat))
    assert same(dtof.replay(COUNTS.astype("float16")), dtof.replay(COUNTS))
    with pytest.raises(dtof.Error, match="a sparse array of .*at most 65536 pixels"):
        dtof.replay(sparse.csr_matrix((70_000, 32)))
    truth = numpy.full((4, 6), 430.0)
    options = {"cycles": 3000, "recorded_cycles": 3000, "bin_width_ps": 250, "sigma_bins": 0.8}
    tables = [dtof.compare(COUNTS, truth=one, **options).methods for one in (truth, numpy.asfortranarray(truth))]
    assert tables[0] == tables[1]


def test_results_are_short_and_comparable():
    run = dtof.replay(COUNTS)
    results = [run, dtof.load(COUNTS), dtof.calibrate(COUNTS, recorded_cycles=9000), dtof.Pixels(2, 2)]
    for result in results:
        assert len(repr(result)) < 120 and result == result and hash(result) is not None
        assert result != results[results.index(result) - 1]
    assert run._repr_html_().count("<tr>") == 4 and "data:image/png" in run._repr_html_()
    empty = dtof.replay(numpy.zeros((2, 16), int) + (numpy.arange(16) == 1), cycles=5)
    assert "<img" not in empty._repr_html_()
    assert numpy.diff(run.events["cycle"][::-1]).min() < 0


@pytest.mark.parametrize("format", ["ply", "pcd", "csv"])
def test_export_is_that_of_the_program(program, tmp_path, format):
    run = dtof.replay(COUNTS)
    run.write_events(tmp_path / "events.aer")
    program(
        "export",
        tmp_path / "events.aer",
        "--format",
        format,
        "--out",
        tmp_path / f"a.{format}",
        "--laser-hz",
        "1000000",
    )
    run.export(tmp_path / f"b.{format}", laser_hz=1_000_000)
    assert (tmp_path / f"a.{format}").read_bytes() == (tmp_path / f"b.{format}").read_bytes()
    with pytest.raises(dtof.Error, match="format xyz: must be csv"):
        run.export(tmp_path / "c.xyz")
    assert not list(tmp_path.glob(".dtof*"))


def test_messages_name_keywords():
    for text, expected in [
        ("5 of 9 were left out: --cycles N takes more", "5 of 9 were left out: cycles=N takes more"),
        ("--columns 32 makes 32x32", "columns=32 makes 32x32"),
        ("pass --recorded-cycles N.", "pass recorded_cycles=N."),
        ("--photons-per-cycle 0.5, an assumption", "photons_per_cycle=0.5, an assumption"),
        ("--glass yes, --glass no; --fov HxV says", "glass=True, glass=False; fov=(H, V) says"),
        ("--bin-width-ps takes picoseconds", "bin_width_ps takes picoseconds"),
        ("a -- b --mask does not", "a -- b mask does not"),
        ("--mask none keeps them", 'mask="none" keeps them'),
        ("--axes bins,rows,columns, else", 'axes="bins,rows,columns", else'),
    ]:
        assert _warn.with_keywords(text) == expected
    with pytest.warns(UserWarning, match="bins of 0.25 ps: bin_width_ps takes picoseconds"):
        dtof.replay(COUNTS, bin_width_ps=0.25)
    square = numpy.full((40, 8, 8), 5)
    with pytest.warns(UserWarning, match='40x8x8: .* axes="bins,rows,columns", else axes="rows,columns,bins"'):
        dtof.replay(square)
    with warnings.catch_warnings(record=True) as issued:
        warnings.simplefilter("always")
        dtof.replay(square, axis=0)
    assert not [warning for warning in issued if "40x8x8" in str(warning.message)]
    found = dtof.calibrate(COUNTS)
    assert found.found["offset"].startswith("not found: calibrate target_mm=D gives it")
    texts = [*found.found.values(), *(text for _, text in found.remarks)]
    assert not any("--" in text for text in texts) and any("recorded_cycles=N" in text for text in texts)


def test_photons_that_are_left_out_are_warned_of(tmp_path):
    with pytest.warns(
        UserWarning, match=r"^[\d,]+ of [\d,]+ recorded photons were left out: cycles=N takes more$"
    ) as warned:
        run = dtof.replay(COUNTS, photons_per_cycle=0.005)
    assert run.statistics["not_replayed"] > 0 and warned[0].filename == __file__
    # Any warning names the line of the user.
    with pytest.warns(UserWarning, match="laser rate is not known.* laser_hz says another") as warned:
        run.export(tmp_path / "points.csv")
        dtof.export(tmp_path / "points.csv", run.events, run.array)
    assert [warning.filename for warning in warned] == [__file__] * 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dtof.replay(COUNTS, bin_width_ps=250, photons_per_cycle=0.005, cycles=500)  # as requested
        dtof.replay(COUNTS, bin_width_ps=250, photons_per_cycle=0.005, decide_once=True)
        dtof.photons([0, 0], [3, 20_000], [5, 5], bin_width_ps=250)
