"""Exports files with dtof, reads them with other projects' readers and compares.

python check.py DTOF SCENE.aer DOCS.md, in an empty folder. SCENE.aer is that of a simulation.
Whatever does not agree, or cannot be read, ends it with a traceback.
"""

import random
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

import aer
import expected
import read

ENDINGS = {"csv": ".csv", "pcd": ".pcd", "ply": ".ply", "mcap": ".mcap", "ros2": "-ros2.mcap", "evt2": ".raw"}
POINTS = ("csv", "pcd", "ply", "mcap", "ros2")


def export(dtof, name, format, options=(), damaged=None):
    """Exports NAME.aer. For a damaged file it must fail and name the damaged byte."""
    out = f"{name}{ENDINGS[format]}"
    done = subprocess.run(
        [dtof, "export", f"{name}.aer", "--format", format, "--out", out, "--quiet", *options],
        capture_output=True, text=True,
    )
    if damaged is None:
        assert done.returncode == 0 and done.stderr == "", done
    else:
        assert done.returncode != 0 and f"byte {damaged}: " in done.stderr, done
        assert done.stderr.count("\n") == 1, done
    return out


def slice_ns(events, laser_hz, slice_us):
    """The length of a slice, and the latest end of the last one."""
    latest = max((event.cycle for event in events), default=0)
    end = (latest + 1) * 10**9 // laser_hz
    if slice_us is not None:
        return slice_us * 1000, end
    return min(max(-(-end // 100_000) * 1000, 10_000), 10_000_000), end


def check_points(header, events, name, laser_hz, fov, decoded, slice_us=None):
    """CSV, PCD, PLY, MCAP and ROS 2 against the AER file, the decoder and each other."""
    columns, rows = read.from_csv(f"{name}.csv")
    assert columns[:4] == ["time_us", "x_m", "y_m", "z_m"], columns
    if decoded is not None:
        assert [columns[4:]] + [row[4:] for row in rows] == decoded
    assert len(rows) == len(events)
    for row, event in zip(rows, events):
        ns = expected.nanoseconds(event, laser_hz)
        assert row[0] == f"{ns // 1000}.{ns % 1000:03}", (row, event)
    point = np.array([row[1:4] for row in rows], dtype=np.float32).reshape(-1, 3)
    ray = expected.rays(header, fov, events)
    metres = np.array([expected.range_mm(header, event) / 1000 for event in events])
    # The core's range is within 0.01 mm of the formula.
    error = np.abs(point - ray * metres[:, None]).max(initial=0)
    assert error < 1.1e-5, error

    expected_records = expected.records(header, events, laser_hz)
    fields = ["x", "y", "z", "intensity", "pixel", "flags", "level", "echo", "t_ns"]
    if events and isinstance(events[0], aer.Dynamic):
        fields[3] = "change"

    def compare(array, order):
        assert len(array) == len(order), (len(array), len(order))
        for index, axis in enumerate("xyz"):
            assert np.array_equal(array[axis], point[order, index])
        value = [expected_records[event][0] for event in order]
        assert np.allclose(array[fields[3]], value, rtol=0, atol=1e-5)
        for index, field in enumerate(fields[4:], start=1):
            assert array[field].tolist() == [expected_records[event][index] for event in order], field

    in_file = list(range(len(events)))
    for names, array in (read.from_pcd(f"{name}.pcd"), read.from_ply(f"{name}.ply")):
        assert names == fields, names
        compare(array, in_file)

    clouds, statistics = read.from_mcap(f"{name}.mcap")
    in_time = sorted(in_file, key=lambda index: events[index].cycle)
    length, end = slice_ns(events, laser_hz, slice_us)
    slices = {}
    for index in in_time:
        slices.setdefault(expected_records[index][-1] // length, []).append(index)
    start = header.start_us * 1000
    assert [time for time, _ in clouds] == [start + number * length for number in slices]
    assert [time for time, _ in statistics] == [time for time, _ in clouds]
    so_far = 0
    for (time, cloud), (_, counts), order in zip(clouds, statistics, slices.values()):
        assert cloud.frame_id == "dtof_optical" and cloud.pose.orientation.w == 1
        assert cloud.timestamp.seconds * 10**9 + cloud.timestamp.nanos == time
        assert [field.name for field in cloud.fields] == fields
        compare(read.points_of(cloud), order)
        so_far += len(order)
        flags = [expected_records[index][2] for index in order]
        duration_s = (min(time - start + length, end) - (time - start)) / 1e9
        assert counts == {
            "timestamp": {"sec": time // 10**9, "nsec": time % 10**9},
            "duration_s": duration_s,
            "events": len(order),
            "events_per_s": len(order) / duration_s,
            "pixels": len({expected_records[index][1] for index in order}),
            "flagged": sum(flag != 0 for flag in flags),
            "saturated": sum(flag & 1 for flag in flags),
            "clipped": sum(flag >> 1 & 1 for flag in flags),
            "deferred": sum(flag >> 2 & 1 for flag in flags),
            "pile_up": sum(flag >> 3 & 1 for flag in flags),
            "tail": sum(flag >> 4 & 1 for flag in flags),
            "blocks": sum(expected_records[index][3] > 0 for index in order),
            "events_so_far": so_far,
        }, counts
    check_ros2(f"{name}-ros2.mcap", fields, clouds)


def check_ros2(path, fields, clouds):
    """The same clouds as in MCAP, at the same times."""
    bag = read.from_ros2(path)
    assert [time for time, _ in bag] == [time for time, _ in clouds]
    for (time, message), (_, cloud) in zip(bag, clouds):
        stamp = message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == time
        assert message.header.frame_id == "dtof_optical"
        assert [field.name for field in message.fields] == fields
        assert message.height == 1 and message.is_dense and not message.is_bigendian
        assert message.row_step == message.width * message.point_step == len(message.data)
        assert np.array_equal(read.points_of_ros2(message), read.points_of(cloud))


def check_evt2(header, events, name, laser_hz, threshold_mm=100, reference="previous"):
    changes = expected.changes(header, events, laser_hz, threshold_mm, reference)
    assert changes, f"{name}: no change of depth, nothing is tested"
    for reader in read.EVT2_READERS:
        found = reader(f"{name}.raw", (header.columns, header.rows))
        assert found == changes, f"{reader.__name__}: {name}: {len(found)} of {len(changes)} events"
    return len(changes)


def check(dtof, name, laser_hz=10_000_000, fov=None, evt2=(), damaged=None):
    """All formats of NAME.aer."""
    header, events = aer.read(f"{name}.aer")
    clock = ["--laser-hz", str(laser_hz)]
    options = clock.copy()
    if fov is not None:
        options += ["--fov", "x".join(map(str, fov))]
    decoded = subprocess.run([dtof, "decode", f"{name}.aer"], capture_output=True, text=True)
    assert (decoded.returncode == 0) == (damaged is None)
    decoded = [line.split(",") for line in decoded.stdout.splitlines()]
    for format in POINTS:
        export(dtof, name, format, options, damaged)
    check_points(header, events, name, laser_hz, fov, decoded)
    changes = 0
    for threshold_mm, reference in evt2 or [(100, "previous")]:
        more = ["--threshold-mm", str(threshold_mm), "--reference", reference]
        export(dtof, name, "evt2", clock + more, damaged)
        changes += check_evt2(header, events, name, laser_hz, threshold_mm, reference)
    print(f"{name}: {len(events)} events, {changes} changes of depth: all readers agree")


def check_rate(dtof):
    """A steady rate is the same in every slice, including the last, which is not full."""
    array = aer.Header(bins=128, columns=64, rows=32, bin_width_ps=250.0, offset_mm=0.0)
    # An event every 2 µs for 25 ms, each at the end of them.
    events = [aer.Depth(20 * number + 19, number % 2048, 40 * 256) for number in range(12_500)]
    aer.write("rate.aer", array, events)
    for slice_us, slices in ((None, 100), (10_000, 3)):
        more = [] if slice_us is None else ["--slice-us", str(slice_us)]
        for format in POINTS:
            export(dtof, "rate", format, more if format in ("mcap", "ros2") else [])
        header, events = aer.read("rate.aer")
        check_points(header, events, "rate", 10_000_000, None, None, slice_us)
        _, statistics = read.from_mcap("rate.mcap")
        assert len(statistics) == slices
        assert all(counts["events_per_s"] == 500_000 for _, counts in statistics), statistics


def check_empty(dtof):
    """Files without events, except for expelliarmus, which cannot read them."""
    array = aer.Header(bins=128, columns=64, rows=32, bin_width_ps=250.0, offset_mm=0.0)
    aer.write("empty.aer", array, [])
    for format in ENDINGS:
        export(dtof, "empty", format)
    check_points(array, [], "empty", 10_000_000, None, None)
    for reader in read.EVT2_READERS:
        if reader is not read.evt2_with_expelliarmus:
            assert reader("empty.raw", (64, 32)) == [], reader.__name__


def check_calibration(dtof, name):
    """The points of a calibration file: rays of any length, and a bias."""
    header, events = aer.read(f"{name}.aer")
    rays = expected.pinhole(header, (50.0, 70.0))
    bias = np.arange(len(rays)) * 0.5 - 7
    rows = [f"[{x!r}, {y!r}, {z!r}, {b!r}]," for (x, y, z), b in zip((rays * 2.5).tolist(), bias.tolist())]
    text = f"columns = {header.columns}\nrows = {header.rows}\npixels = [\n" + "\n".join(rows) + "\n]\n"
    Path("calibration.toml").write_text(text)
    export(dtof, name, "csv", ["--calibration", "calibration.toml"])
    _, rows = read.from_csv(f"{name}.csv")
    pixel = [event.pixel for event in events]
    metres = [expected.range_mm(header, event) - bias[event.pixel] for event in events]
    point = np.array([row[1:4] for row in rows], dtype=float)
    error = np.abs(point - rays[pixel] * np.array(metres)[:, None] / 1000).max()
    assert error < 1.1e-5, error


def late_events(dynamic):
    """Times up to the last of EVT2, with a few events out of order."""
    rng = random.Random(1)
    cycles = [1, 64 * 10, 2**28 * 10 - 1, 2**28 * 10, 2**28 * 10 + 70, 2**30 * 10, 2**33 * 10]
    cycles += [2**28 * 10 + 700 * step for step in range(200)]
    cycles = sorted(cycles) + [2**34 * 10 - 1]
    # Later events may overtake an event.
    for at in range(2, len(cycles) - 2, 7):
        cycles[at], cycles[at + 1] = cycles[at + 1], cycles[at]
    events = []
    for cycle in cycles:
        # 1280 x 51 pixels; the last row cuts some of the blocks.
        pixel, levels = rng.choice([(0, 4), (1279, 1), (1280 * 48, 4), (1280 * 50, 2), (1280 * 51 - 1, 1)])
        level = rng.randrange(levels)
        position = rng.randrange(10 * 256, 118 * 256)
        if dynamic:
            change = rng.choice([-1, 1]) * rng.randrange(1, 50 * 256)
            events.append(aer.Dynamic(cycle, pixel, position, change, rng.randrange(32), level))
        else:
            peak = rng.choice([5, 1023, 2**24 - 1])
            echo = rng.choice([1, 1, 1, 2, 4])
            events.append(aer.Depth(cycle, pixel, position, peak, rng.randrange(32), level, echo))
    return events


def snippets(docs):
    """Runs the Python code of the documentation."""
    texts = re.findall(r"^```python\n(.*?)^```$", Path(docs).read_text(), re.MULTILINE | re.DOTALL)
    assert len(texts) == 6, f"{docs}: {len(texts)} snippets, one a format should be there"
    for text in texts:
        done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True)
        assert done.returncode == 0 and done.stdout, f"{text}\n{done.stderr}"


def main():
    dtof, scene, docs = sys.argv[1:]
    data = Path(scene).read_bytes()
    Path("events.aer").write_bytes(data)
    check(dtof, "events", evt2=[(40, "reported"), (20, "previous")])
    snippets(docs)
    check(dtof, "events", laser_hz=33_333_333, fov=(45.0, 24.5), evt2=[(20, "previous")])
    check_calibration(dtof, "events")
    check_rate(dtof)
    check_empty(dtof)
    # Cut inside a word.
    words = (len(data) - 64) // 16 * 2 // 3
    Path("cut.aer").write_bytes(data[: 64 + 16 * words + 5])
    check(dtof, "cut", evt2=[(20, "previous")], damaged=64 + 16 * words)

    array = aer.Header(bins=128, columns=1280, rows=51, bin_width_ps=250.0, offset_mm=-12.5,
                       start_us=1_790_000_000_123_457)
    offsets = tuple(None if pixel % 5 == 3 else (pixel % 157 - 78) / 4 for pixel in range(1280 * 51))
    for name, dynamic in (("late", False), ("late-changes", True)):
        aer.write(f"{name}.aer", array, late_events(dynamic))
        check(dtof, name)
    aer.write("offsets.aer", array._replace(offsets_mm=offsets), late_events(False))
    check(dtof, "offsets")
    aer.write("too-late.aer", array, [aer.Depth(2**34 * 10, 0, 256)])
    done = subprocess.run(
        [dtof, "export", "too-late.aer", "--format", "evt2", "--out", "too-late.raw"],
        capture_output=True, text=True,
    )
    assert done.returncode != 0 and "EVT2 holds" in done.stderr, done
    assert not Path("too-late.raw").exists()


if __name__ == "__main__":
    main()
