"""Writes and reads AER files by docs/aer-format.md."""

import struct
import zlib
from typing import NamedTuple


class Header(NamedTuple):
    bins: int
    columns: int
    rows: int
    bin_width_ps: float
    offset_mm: float
    start_us: int = 0
    offsets_mm: tuple = ()  # of each pixel, None if it is left out


class Depth(NamedTuple):
    cycle: int
    pixel: int
    position: int  # 1/256 bin
    peak_count: int = 20
    flags: int = 0
    level: int = 0
    echo: int = 1


class Dynamic(NamedTuple):
    cycle: int
    pixel: int
    position: int  # 1/256 bin
    change: int  # 1/256 bin
    flags: int = 0
    level: int = 0


def write(path, header, events):
    data = bytearray(struct.pack(
        "<8sHHIIIIiQq", b"DTOF-AER", 6 if header.offsets_mm else 5, 64, header.bins, header.columns, header.rows,
        round(header.bin_width_ps * 65536), round(header.offset_mm * 256), 0, header.start_us,
    ).ljust(64, b"\0"))
    for offset in header.offsets_mm:
        data += struct.pack("<i", -2**31 if offset is None else round(offset * 256))
    data += bytes(-len(data) % 16)
    cycle_high = None
    for event in events:
        if event.cycle >> 16 != cycle_high:
            cycle_high = event.cycle >> 16
            data += struct.pack("<QQ", 1 << 52, cycle_high)
        low = event.pixel | (event.cycle & 0xFFFF) << 32 | event.level << 48
        if isinstance(event, Depth):
            peak_bin = event.position >> 8
            offset = event.position & 0xFF
            low |= 44 << 16 | (event.echo - 1) << 50 | peak_bin << 52 | 1 << 62
            high = event.peak_count | 2 << 24 | offset << 48 | event.flags << 58
            data += struct.pack("<QQ", low, high)
        else:
            low |= event.flags << 52 | 2 << 62
            data += struct.pack("<Qii", low, event.position, event.change)
    data += struct.pack("<QQ", zlib.crc32(data) | 2 << 52, len(events))
    open(path, "wb").write(data)


def read(path):
    """The header, and the events up to the end word or the end of a cut file."""
    data = open(path, "rb").read()
    fields = struct.unpack_from("<8sHHIIIIiQq", data)
    magic, version, length, bins, columns, rows, width, offset, _, start_us = fields
    assert magic == b"DTOF-AER" and version in (5, 6), path
    offsets = ()
    if version == 6:
        offsets = struct.unpack_from(f"<{columns * rows}i", data, length)
        offsets = tuple(None if offset == -2**31 else offset / 256 for offset in offsets)
        length += -(-columns * rows // 4) * 16
    events = []
    for at in range(length, len(data) - 15, 16):
        low, high = struct.unpack_from("<QQ", data, at)
        kind, bits_52_to_61 = low >> 62, low >> 52 & 0x3FF
        pixel, cycle_low, level = low & 0xFFFF, low >> 32 & 0xFFFF, low >> 48 & 3
        if kind == 1:
            offset_bins = (high >> 48 & 0x3FF ^ 0x200) - 0x200
            position = bits_52_to_61 * 256 + offset_bins
            echo = (low >> 50 & 3) + 1
            events.append(Depth(time + cycle_low, pixel, position, high & 0xFFFFFF, high >> 58, level, echo))
        elif kind == 2:
            position, change = struct.unpack_from("<ii", data, at + 8)
            events.append(Dynamic(time + cycle_low, pixel, position, change, low >> 52 & 0x3F, level))
        elif bits_52_to_61 == 1:
            time = high << 16
        else:
            break
    return Header(bins, columns, rows, width / 65536, offset / 256, start_us, offsets), events
