"""Invalid input is a `dtof.Error` of one line, never a crash."""

import os
import resource
from datetime import datetime

import numpy
import pytest
from hypothesis import given, settings
from hypothesis import strategies as of
from hypothesis.extra import numpy as arrays

import dtof

GOOD = numpy.ones((2, 3, 16), dtype=int)


def refused(call, *words):
    with pytest.raises(dtof.Error) as caught:
        call()
    text = str(caught.value)
    assert text and "\n" not in text, text
    for word in words:
        assert word in text, text
    return text


def counts_with(value, dtype=float):
    counts = numpy.ones((2, 3, 16), dtype=dtype)
    counts[1, 2, 5] = value
    return counts


@pytest.mark.parametrize(
    "value,why",
    [
        (-1.0, "element [1, 2, 5] is negative: -1"),
        (0.5, "element [1, 2, 5] is 0.5, which is not a number of photons"),
        (numpy.nan, "element [1, 2, 5] is NaN"),
        (numpy.inf, "element [1, 2, 5] is inf"),
        (2.0**60, "element [1, 2, 5] is"),
    ],
)
def test_invalid_counts(value, why):
    refused(lambda: dtof.replay(counts_with(value)), "the array: ", why)
    refused(lambda: dtof.load(counts_with(value)), why)
    refused(lambda: dtof.calibrate(counts_with(value)), why)
    refused(lambda: dtof.compare(counts_with(value)), why)


@pytest.mark.parametrize(
    "array",
    [
        counts_with(-3, int),
        numpy.ones((3, 16), dtype=complex),
        numpy.ones((3, 16), dtype=numpy.longdouble),
        numpy.ones((3, 16), dtype=object),
        numpy.full((3, 16), "a"),
        numpy.full((3, 16), b"a"),
        numpy.full((3, 16), datetime(2020, 1, 1), dtype="M8[s]"),
        numpy.ma.masked_array(GOOD, mask=GOOD > 0),
        numpy.zeros((0, 16), dtype=int),
        numpy.zeros((3, 0), dtype=int),
        numpy.zeros((), dtype=int),
        numpy.ones((3, 7), dtype=int),
        numpy.ones((3, 4097), dtype=int),
        numpy.ones((3, 1025), dtype=int),
        numpy.ones((65_537, 8), dtype="u1"),
        numpy.zeros(5, dtype=[("a", "u2")]),
        numpy.zeros((5, 2), dtype=[("pixel", "u2"), ("cycle", "u2"), ("bin", "u2")]),
        numpy.zeros(5, dtype=[("pixel", "f4"), ("cycle", "u2"), ("bin", "u2")]),
        numpy.zeros(5, dtype=[("pixel", "u2", (3,)), ("cycle", "u2"), ("bin", "u2")]),
        numpy.zeros(0, dtype=[("pixel", "u2"), ("cycle", "u2"), ("bin", "u2")]),
        numpy.zeros(5, dtype=[("x" * 9000, "u2")]),
        [[1, 2], [3]],
        None,
        5,
        object(),
        {"counts": 1},
        [],
        b"counts.npy",
    ],
)
def test_invalid_arrays(array):
    refused(lambda: dtof.replay(array))
    refused(lambda: dtof.load(array))


@pytest.mark.parametrize(
    "options,words",
    [
        ({"alpha": 300}, ["alpha 300: must be a number from 0 to 255.996"]),
        ({"alpha": numpy.nan}, ["alpha nan: "]),
        ({"alpha": "many"}, ["alpha 'many': is a text; must be: number, 0 to 255.996"]),
        ({"rule": "window", "sigma_bins": 1, "neighbours": "8"}, ["neighbours '8': is a text; must be: 0, 4 or 8"]),
        ({"alpha": []}, ["alpha needs a value"]),
        ({"alpha": [3.0]}, ["alpha [3.0]: is a list; must be: number, 0 to 255.996"]),
        ({"l1": {80}}, ["l1 [80]: is a list; must be: whole number, 0 to 65535"]),
        ({"tracking": numpy.array([True])}, ["tracking", "is a list; must be: True or False"]),
        ({"rule": ["paper"]}, ["rule ['paper']: is a list; must be: paper, average or window"]),
        ({"l1": numpy.array(70_000)}, ["l1 70000: must be a whole number from 0 to 65535"]),
        ({"alpha": None, "nonsense": 3}, ["nonsense is unknown"]),
        ({"z": 4, "false_alarm": 0.01, "rule": "window", "sigma_bins": 1}, ["z cannot be used with false_alarm"]),
        ({"rule": "best"}, ["best", "paper"]),
        ({"l1": 50, "l2": 20}, ["l2 20: must be greater than l1 50"]),
        ({"gate": (3, 99)}, ["gate 3..99: with 16 bins"]),
        ({"gate": 3}, ["gate 3: must be FIRST..LAST"]),
        ({"gate": (1, 2, 3)}, ["gate 1..2..3: "]),
        ({"mask": [6]}, ["mask 6: there are 6 pixels"]),
        ({"mask": [-1]}, ["mask -1: "]),
        ({"bins": 12}, ["must be a power of two"]),
        ({"cycles": 0}, ["cycles 0: "]),
        ({"cycles": 2**70}, ["cycles 1180591620717411303424: "]),
        ({"seed": -1}, ["seed -1: "]),
        ({"axes": "rows,columns"}, ["one axis must be the bins"]),
        ({"axes": "bins"}, ["axes bins: has 1 names, but the array"]),
        ({"axis": 3}, ["axis 3"]),
        ({"axis": 0, "axes": "rows,columns,bins"}, ["give one of them"]),
        ({"array": "counts"}, ["array is for .npz files"]),
        ({"settings": "no.toml"}, ["no.toml"]),
        ({"settings": {"alpha": 4}}, ["settings: alpha belongs in [detection]"]),
        ({"settings": {"detection": {"alfa": 4}}}, ["settings: alfa is unknown in [detection]; is it alpha?"]),
        ({"settings": {"detection": {"l1": 50, "l2": 20}}}, ["settings: l2 20: must be greater than l1 50"]),
        (
            {"settings": {"detection": {"l1": {}}}},
            ["settings: l1: dict: must be a number, a text, True, False or a list"],
        ),
        ({"settings": "[sensor]\nbins = \n"}, ["settings: line 2"]),
        ({"settings": 3}, ["settings: int: must be the name of a file, its text, a dict"]),
        ({"mask": numpy.array([True, False])}, ["numpy.flatnonzero"]),
        ({"photons_per_cycle": 0}, ["photons_per_cycle 0: "]),
        ({"photons_per_cycle": 1, "recorded_cycles": 9}, ["photons_per_cycle cannot be used with recorded_cycles"]),
        ({"echo_wait": 3}, ["echo_wait is for echoes of 2 or more"]),
        ({"rule": "paper", "tracking": True}, ["tracking is for rule window"]),
        ({"help": True}, ["help is unknown"]),
        ({"input": "x.npy"}, ["input is unknown"]),
        ({"quiet": True}, ["quiet is unknown"]),
        ({"half_widths": (9, 9)}, ["half_widths 9,9: "]),
        ({"columns": 4}, ["columns 4: "]),
    ],
)
def test_invalid_options(options, words):
    refused(lambda: dtof.replay(GOOD, **options), *words)


def test_the_line_is_that_of_the_program(program, tmp_path):
    """With keywords instead of flags."""
    numpy.save(tmp_path / "counts.npy", counts_with(-1.0))
    for options in [
        {},
        {"alpha": 300},
        {"l1": 50, "l2": 20},
        {"rule": "best"},
        {"gate": "3"},
        {"echo_wait": 3},
        {"false_alarm": 0.01, "z": 4},
    ]:
        flag = {name: "--" + name.replace("_", "-") for name in options}
        texts = [f"{flag[name]}={value}" for name, value in options.items()]
        line = program("replay", "--input", tmp_path / "counts.npy", "--out", tmp_path / "out", *texts, check=False)
        text = refused(lambda: dtof.replay(tmp_path / "counts.npy", **options))
        for name in ["l1", "echoes"]:
            flag.setdefault(name, f"--{name}")
        for name, of_program in flag.items():
            line = line.replace(of_program, name)
        assert line == f"error: {text}\n"


@pytest.mark.parametrize(
    "options,line",
    [
        ({"rule": "window", "window": 9}, "window 9: must be a whole number from 1 to 7"),
        ({"rule": "window", "z": 4, "false_alarm": 0.01}, "z cannot be used with false_alarm"),
        ({"x": 50, "l1": 40}, "x 50: must not be greater than l1 40"),
        ({"rule": "window", "window": 3, "neighbours": 8, "binning": 1}, "neighbours cannot be used with binning"),
        ({"tracking": True}, "tracking is for rule window"),
        ({"gate": (4, 9)}, "gate 4..9: with 16 bins: the range gate leaves fewer than 8 bins"),
        ({"alfa": 4}, "alfa is unknown; is it alpha?"),
        ({"rule": "window"}, "rule window needs window or sigma_bins"),
    ],
)
def test_a_mistake_is_the_line_of_the_program_with_keywords(options, line):
    """The test of the program's flags and files, `mistakes`, has the same."""
    assert refused(lambda: dtof.replay(GOOD, settings={}, **options)) == line


@pytest.mark.parametrize(
    "photons,words",
    [
        (([0, 0], [5, 4], [1, 1]), ["record 1", "cycle 4 comes after cycle 5"]),
        (([0, -1], [1, 2], [1, 1]), ["record 1", "negative"]),
        (([0, 70_000], [1, 2], [1, 1]), ["pixel 70000"]),
        (([0, 0], [1, 2], [1, 128]), ["bin 128 is past the last of 128 bins"]),
        (([0.0, 0.0], [1, 2], [1, 1]), ["pixel is float64"]),
        (([0, 0], [1, 2], [True, False]), ["bin is bool"]),
        (([0, 0], [1, 2, 3], [1, 1]), ["as long as each other"]),
        ((0, 0, 0), ["one axis"]),
        (([[0]], [[1]], [[1]]), ["2 axes"]),
        (([], [], []), ["photons"]),
        (([0, 2**70], [1, 2], [1, 1]), ["pixel"]),
        ((None, None, None), ["pixel"]),
        ((numpy.ma.masked_array([1], [True]), [1], [1]), ["masked"]),
    ],
)
def test_invalid_photons(photons, words):
    refused(lambda: dtof.photons(*photons), *words)


@pytest.mark.parametrize("first", [0, 2**63 + 5])
def test_laser_cycles_that_wrapped_are_named(first):
    """A run would take all laser cycles before them, as many as ``cycles`` says."""
    cycle = numpy.array([first, first + 1], dtype="u8") - numpy.uint64(3)
    photons = numpy.zeros(2, dtype=[("pixel", "u2"), ("cycle", "u8"), ("bin", "u2")])
    photons["cycle"] = cycle
    why = f"record 0: cycle {cycle[0]} is 2^63 or more"
    for take, name in [(dtof.photons, "photons"), (dtof.replay, "the array")]:
        refused(lambda: take(photons, cycles=10**15), f"{name}: {why}", "wrapped")


def test_invalid_files(tmp_path):
    for name, bytes in [
        ("a.npy", b""),
        ("b.npy", b"\x93NUMPY"),
        ("c.json", b"{"),
        ("d.csv", b"x"),
        ("e.npz", b"PK"),
        ("f.txt", b""),
        ("g.json.gz", b"\x1f\x8b"),
    ]:
        (tmp_path / name).write_bytes(bytes)
        refused(lambda: dtof.replay(tmp_path / name), name)
        refused(lambda: dtof.load(tmp_path / name), name)
    refused(lambda: dtof.replay(tmp_path / "none.npy"), "none.npy")
    refused(lambda: dtof.replay(tmp_path), str(tmp_path))
    refused(lambda: dtof.replay("-"))
    refused(lambda: dtof.replay("a\0b.npy"))
    refused(lambda: dtof.read_events(tmp_path / "a.npy"), "a.npy", "not an AER file")
    refused(lambda: dtof.simulate(tmp_path / "none.toml"), "none.toml")
    refused(lambda: dtof.simulate("surfaces = 3\n\n"), "the scene")
    refused(lambda: dtof.compare(), "a recording or a scene is needed")
    refused(lambda: dtof.compare(GOOD, scene="x.toml"))
    refused(lambda: dtof.tune(), "needed: background; signal or snr; sigma_bins or sigma_ps")


def test_invalid_events(tmp_path):
    run = dtof.replay(numpy.full((2, 2, 16), 3) + 60 * (numpy.arange(16) == 8))
    path = tmp_path / "a.aer"
    assert run.events.size > 1
    for field, value, words in [
        ("pixel", 4, "pixel 4 of 4"),
        ("peak_bin", 16, "bin"),
        ("peak_bin", 2000, "peak_bin 2000"),
        ("depth_bins", 99.0, "depth_bins 99"),
        ("depth_bins", numpy.nan, "depth_bins NaN"),
        ("depth_bins", 8.001, "depth_bins"),
        ("level", 4, "level 4"),
        ("level", 2, "level"),
        ("echo", 0, "echo 0"),
        ("echo", 5, "echo 5"),
        ("flags", 255, "flags 255"),
        ("peak_count", 2**32 - 1, "peak_count"),
        ("background", 2**32 - 1, "background"),
    ]:
        events = run.events.copy()
        events[field][1] = value
        if field != "level" or value != 2:
            refused(lambda: dtof.write_events(path, events, run.array), "event 1", words)
            refused(lambda: dtof.depth_map(events, run.array), "event 1", words)
            refused(lambda: dtof.points(events, run.array), "event 1", words)
    for array in [
        run.array._replace(rows=0),
        run.array._replace(rows=70_000),
        run.array._replace(bin_width_ps=-1.0),
        run.array._replace(bin_width_ps=numpy.nan),
        run.array._replace(offset_mm=1e30),
        run.array._replace(bin_width_ps=0.0),
        run.array._replace(bin_width_ps=1e-9),
        run.array._replace(bin_width_ps=92.1),
        run.array._replace(bin_width_ps=65535.9),
        run.array._replace(offset_mm=0.1),
        # Multiples, with which no range is found.
        run.array._replace(bin_width_ps=2.0**-16),
        run.array._replace(bin_width_ps=65535.0),
        run.array._replace(offsets_mm=[0.0] * 3),
        run.array._replace(offsets_mm=[0.1] * 4),
        run.array._replace(offsets_mm=[0.0, 0.0, 0.0, 8.38e6]),
        run.array._replace(bins=0),
        run.array._replace(bins=24),
        run.array._replace(bins=2048),
        run.array._replace(bins=4_000_000_000),
    ]:
        refused(lambda: dtof.write_events(path, run.events, array))
        refused(lambda: dtof.depth_map(run.events, array))
    refused(lambda: dtof.write_events(tmp_path / "no" / "a.aer", run.events, run.array), "no")
    refused(lambda: dtof.write_events(tmp_path, run.events, run.array))
    for events in [numpy.zeros(3), numpy.zeros(3, [("cycle", "u8")]), run.events.reshape(1, -1), None]:
        refused(lambda: dtof.write_events(path, events, run.array), "events")
    refused(lambda: dtof.points(run.events, run.array, fov=(0, 40)), "fov 0x40: ")
    refused(lambda: dtof.points(run.events, run.array, echo="best"), "echo best: must be first, last, strongest or all")
    refused(lambda: dtof.reflectivity(run.events, run.array, of="nothing"))
    assert os.listdir(tmp_path) == []


def test_invalid_steps():
    pixel = dtof.Pixel()
    for bin in (-1, 70_000, 1.5, "a", [[1]], None, numpy.nan):
        refused(lambda: pixel.count(bin))
    for cycles in (0, -1, 65_536, 1.5, None, True):
        refused(lambda: pixel.end_laser_cycles(cycles))
    for options in (
        {"bins": 12},
        {"bins": 0},
        {"bins": 2048},
        {"address": 70_000},
        {"bins": "x"},
        {"binning": 1},
        {"rule": "window", "window": 3, "neighbours": 8},
        {"mask": [3]},
        {"l1": 9, "l2": 3},
        {"frame": 3},
    ):
        refused(lambda: dtof.Pixel(**options))
    assert pixel.statistics["photons"] == 0
    pixel.count(1023)
    assert pixel.statistics["rejected"] == 1


ANY = of.one_of(
    of.none(),
    of.booleans(),
    of.integers(),
    of.floats(),
    of.text(max_size=8),
    of.lists(of.integers(-3, 70_000), max_size=4),
    of.tuples(of.floats(), of.floats()),
)
NAMES = [
    "rule",
    "alpha",
    "window",
    "z",
    "false_alarm",
    "estimator",
    "half_widths",
    "min_count",
    "l1",
    "l2",
    "x",
    "binning",
    "patience",
    "neighbours",
    "tracking",
    "once_per_bin",
    "counter_bits",
    "echoes",
    "echo_wait",
    "gate",
    "mask",
    "sigma_bins",
    "frame",
    "axes",
    "array",
    "columns",
    "rebin",
    "bins",
    "bin_width_ps",
    "offset_mm",
    "offsets_mm",
    "photons_per_cycle",
    "recorded_cycles",
    "laser_hz",
    "seed",
]


@settings(deadline=None, max_examples=150)
@given(of.dictionaries(of.sampled_from(NAMES), ANY, max_size=4))
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_any_options_give_events_or_an_error(options):
    try:
        run = dtof.replay(GOOD, cycles=60, **options)
    except dtof.Error as error:
        assert "\n" not in str(error) and "fault of dtof" not in str(error)
    else:
        assert run.events.dtype == dtof.EVENT


@settings(deadline=None, max_examples=150)
@given(
    arrays.arrays(
        dtype=of.one_of(arrays.scalar_dtypes(), arrays.unicode_string_dtypes(), arrays.array_dtypes()),
        shape=arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=20),
    )
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_any_array_gives_events_or_an_error(array):
    for take in (dtof.replay, dtof.load):
        try:
            take(array, cycles=60)
        except dtof.Error as error:
            assert "\n" not in str(error) and "fault of dtof" not in str(error)


@settings(deadline=None, max_examples=100)
@given(of.binary(max_size=200), of.sampled_from([".npy", ".npz", ".csv", ".json", ".aer", ".toml"]))
def test_any_file_gives_events_or_an_error(tmp_path_factory, bytes, end):
    path = tmp_path_factory.mktemp("any") / f"any{end}"
    path.write_bytes(bytes)
    take = {".aer": dtof.read_events, ".toml": dtof.simulate}.get(end, dtof.replay)
    if end == ".toml":
        take = lambda path: dtof.simulate(path, cycles=10, array=(2, 2))  # noqa: E731
    try:
        take(path)
    except dtof.Error as error:
        assert "\n" not in str(error) and "fault of dtof" not in str(error)


def test_a_file_stays_if_a_new_one_cannot_be_written(tmp_path):
    run = dtof.replay(numpy.full((8, 8, 16), 3) + 60 * (numpy.arange(16) == 8))
    path = tmp_path / "a.aer"
    run.write_events(path)
    before = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for room in [0, 16, len(before) // 2, len(before) - 1]:
        # Like a disk with so much room.
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
        try:
            refused(lambda: run.write_events(path), "a.aer: File too large")
            refused(lambda: run.write_events(tmp_path / "new.aer"), "new.aer: File too large")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert [file.name for file in tmp_path.iterdir()] == ["a.aer"], room
        assert path.read_bytes() == before, room
