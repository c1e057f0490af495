"""Small pictures of meshes for notebooks."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from terrane._mesh import Mesh

# Pixels along the longer side.
SIDE = 240


def shaded(mesh: Mesh) -> bytes:
    """Shaded relief of a mesh as PNG, lit from the north-west."""
    west, south, east, north = mesh.bounds
    step = max(east - west, north - south) / SIDE or 1.0
    x = np.arange(west, east + step / 2, step)
    y = np.arange(north, south - step / 2, -step)
    heights = mesh.interpolate(x[None, :], y[:, None])
    if min(heights.shape) < 2:
        return png(np.full((1, 1, 2), 255, "u1"))
    down, right = np.gradient(heights, step)
    # A slope of 1/2 gives good contrast.
    steep = np.nanpercentile(np.hypot(right, down), 90) if np.isfinite(right).any() else 1.0
    right, down = (part / (2 * steep or 1.0) for part in (right, down))
    light = (1 - right - down) / np.sqrt(3 * (1 + right**2 + down**2))
    gray = np.clip(np.nan_to_num(light, nan=0.0), 0, 1)
    pixels = np.stack([40 + 215 * gray, np.where(np.isfinite(light), 255, 0)], axis=-1)
    return png(pixels.astype("u1"))


def png(pixels: NDArray[np.uint8]) -> bytes:
    """PNG of grey and alpha, (rows, columns, 2)."""
    rows, columns, _ = pixels.shape
    lines = np.zeros((rows, 1 + 2 * columns), "u1")
    lines[:, 1:] = pixels.reshape(rows, -1)

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 4, 0, 0, 0))
    body = chunk(b"IDAT", zlib.compress(lines.tobytes(), 6))
    return b"\x89PNG\r\n\x1a\n" + head + body + chunk(b"IEND", b"")
