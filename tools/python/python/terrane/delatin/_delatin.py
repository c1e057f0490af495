"""The class."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrane._errors import usage
from terrane._numbers import checked
from terrane._operations import tin


class Delatin:
    """A mesh of an array of heights, with the parameters and properties of pydelatin's class.

    Heights are converted to float32, and errors are in their units, before `z_scale` and `z_exag`. Differences: the
    same error needs fewer vertices, because redundant ones are removed; voids (NaN) become holes; if both an error
    and a number are passed, the number is met and the error as far as possible; `blur` is a true Gaussian; the bottom
    of a solid has the triangles of its top.

    Parameters
    ----------
    arr
        Heights, (height, width), or flat in C order with `height` and `width`.
    z_scale, z_exag
        Factors of the heights of vertices.
    max_error
        The largest distance of a sample from the mesh.
    max_triangles, max_points
        Largest number of triangles or vertices.
    base_height
        Depth of the bottom of a solid below 0; 0 for no solid.
    level, invert, blur, gamma
        Scale heights to 0 to 1; invert them; blur with this standard deviation in cells; raise to a power.
    border_size, border_height
        Width of a border in samples, and its height.
    """

    def __init__(
        self,
        arr: Any,
        *,
        height: int | None = None,
        width: int | None = None,
        z_scale: float = 1,
        z_exag: float = 1,
        max_error: float = 0.001,
        max_triangles: int | None = None,
        max_points: int | None = None,
        base_height: float = 0,
        level: bool = False,
        invert: bool = False,
        blur: int = 0,
        gamma: float = 0,
        border_size: int = 0,
        border_height: float = 1,
    ) -> None:
        checked(
            height=height,
            width=width,
            z_scale=z_scale,
            z_exag=z_exag,
            max_error=max_error,
            max_triangles=max_triangles,
            max_points=max_points,
            base_height=base_height,
            blur=blur,
            gamma=gamma,
            border_size=border_size,
            border_height=border_height,
        )
        heights = np.asarray(arr)
        if heights.ndim != 2:
            if height is None or width is None:
                raise usage("Height and width must be passed when arr is not 2D")
            heights = heights.reshape(height, width)
        heights = prepared(heights.astype("f4", copy=False), level, invert, blur, gamma)
        if border_size > 0:
            heights = np.pad(heights, border_size, constant_values=border_height)
        mesh = tin(heights, max_error=max_error)
        if max_triangles and len(mesh.triangles) > max_triangles:
            mesh = tin(heights, max_triangles=max_triangles)
        if max_points and len(mesh.vertices) > max_points:
            mesh = tin(heights, max_vertices=max_points)
        vertices = mesh.vertices * (1.0, 1.0, z_scale * z_exag)
        vertices[:, 1] += heights.shape[0] - 1
        self._vertices: NDArray[np.float32] = vertices.astype("f4")
        self._triangles: NDArray[np.uint32] = mesh.triangles
        self._error = mesh.error
        if base_height > 0:
            bottom = -base_height * z_scale * z_exag
            self._vertices, self._triangles = solid(self._vertices, self._triangles, bottom)

    @property
    def vertices(self) -> NDArray[np.float32]:
        """Positions, (n, 3): x is the column, y the row counted from the last, z the scaled height."""
        return self._vertices

    @property
    def triangles(self) -> NDArray[np.uint32]:
        """Corners, (m, 3), as indices of vertices."""
        return self._triangles

    @property
    def error(self) -> float:
        """The largest distance of a sample from the mesh."""
        return self._error


def prepared(
    heights: NDArray[np.float32], level: bool, invert: bool, blur: int, gamma: float
) -> NDArray[np.float32]:
    """Heights after `level`, `invert`, `blur` and `gamma`, in this order."""
    if level:
        low, high = np.nanmin(heights), np.nanmax(heights)
        heights = (heights - low) / (high - low) if high > low else heights
    if invert:
        heights = 1 - heights
    if blur > 0:
        reach = np.arange(-4 * blur, 4 * blur + 1)
        weights = np.exp(-0.5 * (reach / blur) ** 2)
        for axis in (0, 1):
            sides = [(4 * blur, 4 * blur) if along == axis else (0, 0) for along in (0, 1)]
            wide = np.pad(heights, sides, mode="edge")
            heights = np.apply_along_axis(np.convolve, axis, wide, weights / weights.sum(), "valid")
    if gamma > 0:
        heights = np.power(heights, gamma)
    return heights.astype("f4", copy=False)


def solid(
    vertices: NDArray[np.float32], triangles: NDArray[np.uint32], bottom: float
) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """The surface closed by walls and a bottom."""
    count = np.uint32(len(vertices))
    below = vertices.copy()
    below[:, 2] = bottom
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype("u8")
    forth, back = edges[:, 0] << 32 | edges[:, 1], edges[:, 1] << 32 | edges[:, 0]
    rim = edges[~np.isin(forth, back)].astype("u4")
    start, end = rim.T
    walls = np.concatenate(
        [
            np.stack([end, start, start + count], axis=1),
            np.stack([end, start + count, end + count], axis=1),
        ]
    )
    all_triangles = np.concatenate([triangles, triangles[:, ::-1] + count, walls]).astype("u4")
    return np.concatenate([vertices, below]), all_triangles
