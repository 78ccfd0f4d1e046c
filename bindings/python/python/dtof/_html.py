"""A depth map as a small picture for notebooks."""

from __future__ import annotations

import base64
import struct
import zlib

import numpy

#: Viridis, from the nearest to the farthest.
_COLOURS = numpy.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]])


def depth_image(depth: numpy.ndarray) -> str:
    """An image of ``depth`` in millimetres; transparent where it is NaN. Outliers take the last colour."""
    known = depth[numpy.isfinite(depth)]
    if known.size == 0:
        return ""
    near, far = numpy.percentile(known, [2, 98])
    share = numpy.clip((depth - near) / max(far - near, 1e-9), 0, 1)
    place = numpy.nan_to_num(share) * (len(_COLOURS) - 1)
    pixels = numpy.zeros((*depth.shape, 4), numpy.uint8)
    for channel in range(3):
        pixels[..., channel] = numpy.interp(place, range(len(_COLOURS)), _COLOURS[:, channel])
    pixels[..., 3] = numpy.where(numpy.isfinite(depth), 255, 0)
    data = base64.b64encode(_png(pixels)).decode()
    style = "width:100%;max-width:256px;image-rendering:pixelated;border:1px solid #888"
    text = f"range {near:,.0f} mm (dark) to {far:,.0f} mm (bright)"
    return f'<img alt="depth map, {text}" style="{style}" src="data:image/png;base64,{data}"><div>{text}</div>'


def _png(pixels: numpy.ndarray) -> bytes:
    rows, columns, _ = pixels.shape
    lines = numpy.zeros((rows, 1 + 4 * columns), numpy.uint8)
    lines[:, 1:] = pixels.reshape(rows, -1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", columns, rows, 8, 6, 0, 0, 0)
    data = zlib.compress(lines.tobytes())
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
