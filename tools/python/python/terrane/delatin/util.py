"""Helpers for `Delatin`: decoding of heights, scaling of vertices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

ENCODINGS = ["mapbox", "terrarium"]


def decode_ele(png: Any, encoding: str) -> NDArray[np.float64]:
    """Decodes heights (rows, columns) from the colours of an array (rows, columns, 3 or 4) or (3 or 4, columns,
    rows). `encoding` is "mapbox" (terrain-RGB) or "terrarium".

    >>> import numpy as np
    >>> float(decode_ele(np.full((8, 8, 3), (2, 26, 32), "u1"), "mapbox")[0, 0].round(3))
    3776.0
    """
    if encoding not in ENCODINGS:
        raise ValueError(f"encoding must be one of {ENCODINGS}")
    pixels = np.asarray(png)
    pixels = pixels.T if pixels.shape[0] <= 4 else pixels
    red, green, blue = (pixels[:, :, band].astype("f8") for band in range(3))
    if encoding == "mapbox":
        heights: NDArray[np.float64] = (red * 65_536 + green * 256 + blue) / 10 - 10_000
    else:
        heights = red * 256 + green + blue / 256 - 32_768
    return heights


def rescale_positions(
    vertices: Any, bounds: Sequence[float], flip_y: bool = False
) -> NDArray[np.float32]:
    """Vertices with x and y stretched from 0 to their largest to `bounds` (x low, y low, x high, y high), (n, 3) float32;
    with `flip_y` y runs down.

    >>> rescale_positions([[0, 0, 5], [512, 256, 6]], (10, 20, 30, 40)).tolist()
    [[10.0, 20.0, 5.0], [30.0, 30.0, 6.0]]
    """
    positions = np.array(vertices, "f8")
    west, south, east, north = bounds
    largest = positions[:, :2].max()
    across, up = (east - west) / largest, (north - south) / largest
    positions[:, 0] = west + positions[:, 0] * across
    positions[:, 1] = north - positions[:, 1] * up if flip_y else south + positions[:, 1] * up
    return positions.astype("f4")


def latitude_adjustment(lat: float) -> float:
    """Scale of a web-mercator unit at a latitude in degrees: its cosine.

    >>> round(latitude_adjustment(60.0), 3)
    0.5
    """
    return math.cos(math.radians(lat))
