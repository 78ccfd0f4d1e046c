"""Maps and points, compared with the program's exports and with the events."""

import numpy
import pytest

import dtof
from test_events import flags_of


@pytest.fixture(scope="module")
def run():
    random = numpy.random.default_rng(5)
    counts = random.poisson(1.0, (6, 8, 64))
    for row in range(6):
        counts[row, :, 10 + 4 * row] += 20 * (numpy.arange(8) + 1)
    counts[:, :, 55] += 40
    return dtof.replay(counts, echoes=2, rule="window", sigma_bins=0.5, l1=8)


def mean_of_one_surface(ranges):
    """Of those of the last ten ranges that lie on the surface of most; of two with as many the newer."""
    recent = ranges[-10:]
    near = abs(recent[:, None] - recent) <= 3 * 250 * 0.149896
    counts = near.sum(axis=1)
    newest = len(counts) - 1 - counts[::-1].argmax()
    return recent[near[newest]].mean()


def test_the_depth_map_has_the_last_range_of_each_pixel(run):
    events = run.events
    depth = dtof.depth_map(events, run.array, echo="all", mean=False)
    mean = dtof.depth_map(events, run.array, echo="all")
    assert depth.shape == (6, 8)
    for pixel in range(48):
        ranges = events["range_mm"][events["pixel"] == pixel]
        last, recent = numpy.nan, numpy.nan
        if ranges.size:
            last, recent = ranges[-1], mean_of_one_surface(ranges)
        assert depth.flat[pixel] == pytest.approx(last, nan_ok=True)
        assert mean.flat[pixel] == pytest.approx(recent, nan_ok=True)
    first = run.depth_map(echo="first", mean=False)
    assert (first <= run.depth_map(echo="last", mean=False)).all()
    none = dtof.depth_map(events[:0], run.array)
    assert none.shape == (6, 8) and numpy.isnan(none).all()


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"mask": [5], "neighbours": 8, "offsets_mm": [pixel % 5 for pixel in range(64)]},
        {"binning": 2, "photons_per_cycle": 0.01, "patience": 8},
        {"decide_once": True},
        {"rule": "window", "sigma_bins": 0.5, "echoes": 2},
        {"frame": 100},
    ],
)
def test_the_depth_map_is_depth_npy_and_the_points_of_pixels(program, tmp_path, options):
    random = numpy.random.default_rng(6)
    counts = random.poisson(1.4, (8, 8, 64))
    near, far = (numpy.exp(-0.5 * (numpy.arange(64) + 0.5 - place) ** 2) for place in (30.2, 50.7))
    counts[:, :4] += random.poisson(40 * near, (8, 4, 64))
    counts[:, 2:] += random.poisson(30 * far, (8, 6, 64))
    numpy.save(tmp_path / "counts.npy", counts)
    program("replay", tmp_path / "counts.npy", "--out", tmp_path / "out", *flags_of(options))
    run = dtof.replay(counts, **options)
    depth = run.depth_map()
    assert numpy.array_equal(depth, numpy.load(tmp_path / "out/depth.npy"), equal_nan=True)
    assert (~numpy.isnan(depth)).sum() > 30
    if "frame" in options:
        assert run.depth is None and run.confidence is None
    else:
        assert numpy.array_equal(run.confidence, numpy.load(tmp_path / "out/confidence.npy"), equal_nan=True)
        depth = run.depth_map(of="events")
        assert numpy.array_equal(depth, numpy.load(tmp_path / "out/depth-events.npy"), equal_nan=True)
    # One point for each, at that depth.
    points = run.points(one_per_pixel=True)
    assert points["pixel"].tolist() == numpy.flatnonzero(~numpy.isnan(depth)).tolist()
    distance = numpy.sqrt(sum(points[axis].astype(float) ** 2 for axis in "xyz"))
    assert 1000 * distance == pytest.approx(depth[~numpy.isnan(depth)], abs=0.01)
    run.export(tmp_path / "points.ply", one_per_pixel=True)
    text = (tmp_path / "points.ply").read_bytes()
    assert b"\nelement vertex %d\n" % points.size in text and text.endswith(points.tobytes())
    program("export", tmp_path / "out/events.aer", "--format", "ply", "--out", tmp_path / "b.ply", "--one-per-pixel")
    assert (tmp_path / "b.ply").read_bytes() == text


def test_reflectivity_follows_its_formulas(run):
    events = run.events
    by_events = dtof.reflectivity(events, run.array, of="events", echo="all")
    by_signal = run.reflectivity(echo="first")
    mean = run.depth_map(of="events", echo="all")
    for pixel in range(48):
        own = events[events["pixel"] == pixel]
        expected = own.size * mean.flat[pixel] ** 2
        # It takes the range in whole millimetres: 390 or more.
        assert by_events.flat[pixel] == pytest.approx(expected, rel=3e-3)
    # Brighter columns have a higher reflectivity.
    assert numpy.corrcoef(by_signal.mean(axis=0), numpy.arange(8))[0, 1] > 0.8


def test_points_are_those_of_the_export(program, tmp_path, run):
    dtof.write_events(tmp_path / "events.aer", run.events, run.array)
    for options, texts in [
        ({}, []),
        (
            {"fov": (40, 30), "echo": "first", "laser_hz": 1_000_000},
            ["--fov", "40x30", "--echo", "first", "--laser-hz", "1000000"],
        ),
    ]:
        out = tmp_path / f"{len(texts)}.pcd"
        program("export", tmp_path / "events.aer", "--format", "pcd", "--out", out, *texts)
        data = out.read_bytes().split(b"DATA binary\n", 1)[1]
        points = dtof.points(run.events, run.array, **options)
        assert points.tobytes() == data and points.size > 0
    assert (points["z"] > 0).all()


def test_blocks_stand_for_their_pixels():
    random = numpy.random.default_rng(6)
    counts = random.poisson(0.4, (8, 8, 64))
    counts[..., 30] += 3
    run = dtof.replay(counts, binning=2, photons_per_cycle=0.01, patience=8)
    assert (run.events["level"] > 0).any()
    blocks = run.events[run.events["level"] > 0]
    depth = dtof.depth_map(blocks[:1], run.array)
    side = 2 ** int(blocks["level"][0])
    assert (~numpy.isnan(depth)).sum() == side * side
