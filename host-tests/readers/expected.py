"""The expected contents of an export, computed from the AER file alone."""

from collections import defaultdict, deque
from math import floor

import numpy as np

from aer import Depth

MM_PER_PS = 0.149896229


def pinhole(header, fov):
    """x, y and z of the unit ray of each pixel; fov in degrees, or None."""
    if fov is None:
        longer = max(header.columns, header.rows)
        half = np.tan(np.radians(30)) * np.array([header.columns, header.rows]) / longer
    else:
        half = np.tan(np.radians(fov) / 2)
    pixel = np.arange(header.columns * header.rows)
    column, row = pixel % header.columns, pixel // header.columns
    x = half[0] * (2 * (column + 0.5) / header.columns - 1)
    y = half[1] * (2 * (row + 0.5) / header.rows - 1)
    rays = np.stack([x, y, np.ones(len(pixel))], axis=1)
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def block(header, event):
    """The pixels of an event, row by row."""
    side = 1 << event.level
    row, column = divmod(event.pixel, header.columns)
    assert row % side == 0 and column % side == 0
    return [
        r * header.columns + c
        for r in range(row, min(row + side, header.rows))
        for c in range(column, min(column + side, header.columns))
    ]


def rays(header, fov, events):
    """x, y and z of the unit ray of each event."""
    of_pixels = pinhole(header, fov)
    sums = np.array([of_pixels[block(header, event)].sum(axis=0) for event in events]).reshape(-1, 3)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def nanoseconds(event, laser_hz):
    return event.cycle * 10**9 // laser_hz


def microseconds(event, laser_hz):
    return event.cycle * 10**6 // laser_hz


def range_mm(header, event):
    """Within 0.01 mm, as the core works with fixed-point numbers."""
    own = [header.offsets_mm[pixel] for pixel in block(header, event)] if header.offsets_mm else []
    own = [offset for offset in own if offset is not None]
    mean = sum(own) / len(own) if own else 0.0
    return event.position / 256 * header.bin_width_ps * MM_PER_PS + header.offset_mm + mean


def records(header, events, laser_hz):
    """Value, pixel, flags, level, echo and time of each point."""
    def value(event):
        if isinstance(event, Depth):
            return event.peak_count
        return event.change / 256 * header.bin_width_ps * MM_PER_PS / 1000
    return [
        (value(event), event.pixel, event.flags, event.level, getattr(event, "echo", 1),
         nanoseconds(event, laser_hz)) for event in events
    ]


def changes(header, events, laser_hz, threshold_mm, reference):
    """Time, column, row and polarity of each change of depth, in order of time."""
    step_mm = header.bin_width_ps * MM_PER_PS / 256
    threshold = 3 * floor(threshold_mm / step_mm + 0.5)
    recent = defaultdict(lambda: deque(maxlen=3))
    compared_with = {}
    found = []
    for event in events:
        if isinstance(event, Depth):
            if event.echo > 1:
                continue
            who = event.pixel, event.level
            last = recent[who]
            last.append(event.position)
            if len(last) < 3:
                continue
            mean = sum(last)
            moved = mean - compared_with.setdefault(who, mean)
            changed = abs(moved) > threshold
            if changed or reference == "previous":
                compared_with[who] = mean
            if not changed:
                continue
        else:
            moved = event.change
        for pixel in block(header, event):
            row, column = divmod(pixel, header.columns)
            found.append((microseconds(event, laser_hz), column, row, int(moved > 0)))
    # Events of one microsecond keep their order.
    return sorted(found, key=lambda change: change[0])
