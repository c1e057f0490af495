"""Meshes in memory."""

from __future__ import annotations

import base64
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrane import _picture, _terrane
from terrane._errors import refuse_existing, warn
from terrane._settings import Path
from terrane._source import lattice_of


class Mesh:
    """An immutable triangle mesh in memory, as made by `terrane.tin`.

    Vertices are samples of the grid, except with `fit_heights`; triangles are vertex indices, counter-clockwise seen from
    above.

    >>> import numpy as np, terrane
    >>> heights = np.fromfunction(lambda row, col: np.sin(col / 5) * 10, (64, 64))
    >>> mesh = terrane.tin(heights, max_error=0.5)
    >>> mesh.vertices.shape[1], mesh.triangles.dtype, bool(mesh.error <= 0.5)
    (3, dtype('uint32'), True)
    """

    __slots__ = ("__weakref__", "_mesh")

    def __init__(self, mesh: _terrane.Mesh) -> None:
        self._mesh = mesh

    @property
    def vertices(self) -> NDArray[np.float64]:
        """Positions (x, y, z) in units of the grid: (n, 3) float64, a read-only view."""
        return self._mesh.vertices

    @property
    def triangles(self) -> NDArray[np.uint32]:
        """Vertex indices: (m, 3) uint32, a read-only view."""
        return self._mesh.triangles

    @property
    def error(self) -> float:
        """The largest vertical distance of a valid sample from the mesh, in units of the heights."""
        return self._mesh.error

    @property
    def rmse(self) -> float:
        """Root mean square of these distances."""
        return self._mesh.rmse

    @property
    def tolerance(self) -> float:
        """The error bound: as requested, or as achieved for a number of vertices or triangles."""
        return self._mesh.tolerance

    @property
    def shortfall(self) -> str | None:
        """Requirements that are not met, in words: triangles with small angles, or breaklines without edges."""
        return self._mesh.shortfall

    @property
    def crs(self) -> str | None:
        """CRS for pyproj: "EPSG:32631", or WKT."""
        return self._mesh.crs

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Smallest x and y, and largest x and y."""
        low, high = self.vertices[:, :2].min(axis=0), self.vertices[:, :2].max(axis=0)
        return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))

    def interpolate(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Heights of the surface at positions: `x` and `y` are numbers or arrays that broadcast. NaN outside the
        mesh; exact at vertices.

        >>> import numpy as np, terrane
        >>> mesh = terrane.tin(np.arange(25.0).reshape(5, 5), max_error=0)
        >>> mesh.interpolate([0.5, 9.0], -1.0)
        array([5.5, nan])
        """
        all_x, all_y = np.broadcast_arrays(np.asarray(x, "f8"), np.asarray(y, "f8"))
        flat = [np.require(part, "f8", ("C", "A")) for part in (all_x, all_y)]
        return self._mesh.heights(*flat).reshape(all_x.shape)

    def sample_like(self, like: Any) -> NDArray[np.float64]:
        """Heights at the cell centres of another grid, (rows, columns), NaN outside the mesh. `like` is a rasterio
        dataset, an xarray DataArray or Dataset, an array, or a pair of a shape and a transform. Without a transform,
        x is the column and y the negative row, as in a mesh of an array."""
        (height, width), place = lattice_of(like)
        # Geotransform of the outer corner of the first cell.
        x0, a, b, y0, d, e = (-0.5, 1.0, 0.0, 0.5, 0.0, -1.0) if place is None else place
        rows, cols = np.arange(height)[:, None] + 0.5, np.arange(width)[None, :] + 0.5
        return self.interpolate(x0 + a * cols + b * rows, y0 + d * cols + e * rows)

    def write(self, path: Path, overwrite: bool = False) -> int:
        """Writes the mesh to a file atomically, in the format of its ending (PLY, OBJ, STL, GLB, 3MF and others), and
        returns the size in bytes. GLB, STL and 3MF hold float32 heights: if rounding exceeds the tolerance, a warning
        is issued and the file states the larger bound (`write_tin` keeps the tolerance)."""
        name = os.fspath(path)
        refuse_existing(name, overwrite)
        bound = self._mesh.tolerance_in(name)
        if bound > self.tolerance:
            warn(
                f"{name}: float32 heights are up to {bound:.9g} from the samples ({self.tolerance:.9g} is allowed), and "
                "the file states that; pass float32 heights, or use write_tin, which rounds first"
            )
        return self._mesh.write(name, overwrite)

    def to_trimesh(self) -> Any:
        """The mesh as a `trimesh.Trimesh` with the same vertex order."""
        import trimesh

        return trimesh.Trimesh(self.vertices, self.triangles, process=False)

    def to_pyvista(self) -> Any:
        """The mesh as a `pyvista.PolyData`."""
        import pyvista

        return pyvista.PolyData.from_regular_faces(self.vertices, self.triangles.astype("i8"))

    def to_meshio(self) -> Any:
        """The mesh as a `meshio.Mesh`."""
        import meshio

        return meshio.Mesh(self.vertices, [("triangle", self.triangles)])

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Plots the mesh coloured by height with matplotlib; options are passed to `tripcolor`. Returns the axes."""
        from matplotlib import pyplot

        ax = pyplot.gca() if ax is None else ax
        x, y, z = self.vertices.T
        options = {"shading": "gouraud", "cmap": "terrain", **options}
        ax.tripcolor(x, y, z, triangles=self.triangles, **options)
        ax.set_aspect("equal")
        return ax

    def __repr__(self) -> str:
        crs = "" if self.crs is None else f", {self.crs[:40]}"
        return (
            f"<terrane.Mesh: {len(self.vertices):,} vertices, {len(self.triangles):,} triangles, "
            f"error {self.error:.6g} of {self.tolerance:.6g}{crs}>"
        )

    def _repr_html_(self) -> str:
        picture = base64.b64encode(_picture.shaded(self)).decode()
        told = repr(self).strip("<>").removeprefix("terrane.")
        return f'<div>{told}<br/><img alt="hillshade" src="data:image/png;base64,{picture}"/></div>'

    def __reduce__(self) -> tuple[Any, ...]:
        return restored, (np.array(self.vertices), np.array(self.triangles), self._mesh.state())


def restored(
    vertices: NDArray[np.float64], triangles: NDArray[np.uint32], state: dict[str, Any]
) -> Mesh:
    """Restores a pickled mesh."""
    return Mesh(_terrane.Mesh.restore(vertices, triangles, state))
