"""Grid to mesh, and its proof."""

from __future__ import annotations

import os
import tempfile
from typing import Any

from terrane._errors import refuse_existing, usage
from terrane._mesh import Mesh
from terrane._numbers import checked, number
from terrane._settings import Features, Path, settings, system
from terrane._source import opened

# What a mesh may have to reach.
GOALS = ("max_error", "max_vertices", "max_triangles")


def asked(**options: Any) -> dict[str, Any]:
    """What a mesh is to be, as the library takes it, but for the files it keeps to."""
    if all(options[goal] is None for goal in GOALS):
        raise usage(
            "the mesh has nothing to reach", "pass max_error, max_vertices or max_triangles"
        )
    given = {name: options[name] for name in (*GOALS, "min_angle", "tile")}
    return {**options, **checked(**given)}


def kept(files: dict[str, str | None]) -> dict[str, str | None]:
    """The files that a mesh keeps to."""
    return {name: files[name] for name in ("keep_points", "breaklines")}


def tin(
    src: Any,
    max_error: float | None = None,
    *,
    max_vertices: int | None = None,
    max_triangles: int | None = None,
    bound: str = "samples",
    band: int | None = None,
    nodata: float | None = None,
    transform: Any = None,
    crs: Any = None,
    clip: Features | None = None,
    water: Features | None = None,
    keep_points: Features | None = None,
    breaklines: Features | None = None,
    strict: bool = False,
    drop: bool = True,
    fit: bool = False,
    data_dependent: bool = False,
    min_angle: float | None = None,
    tile: int = 512,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
) -> Mesh:
    """A triangle mesh of a grid of heights, no valid sample further from it, vertically, than `max_error`.

    Made by greedy insertion in tiles with shared boundary vertices. The result depends on nothing but the heights,
    these options and `tile`: not on threads or memory.

    Parameters
    ----------
    src
        A path, a list of paths (one mosaic), the name of a synthetic terrain ("synth:rough,size=513"), an array of
        two dimensions (rows, columns) of any type of number, masked or not, a dataset of rasterio, or a DataArray or
        Dataset of xarray. NaN, infinities, masked samples and nodata are voids.
    max_error, max_vertices, max_triangles
        What to reach, one of them: the largest vertical distance of a sample, in units of the heights; or the least
        one that so many vertices or triangles allow.
    bound
        "samples", or "surface": no point of a line between two neighbouring samples is further, either.
    band, nodata
        Which band of a file or dataset, from 1; the value for voids instead of what the data say.
    transform, crs
        Of arrays: where they lie, as rasterio has it (six numbers, of corners of cells), and the reference system.
        Without a transform x is the column and y the row with its sign changed.
    clip, water, keep_points, breaklines
        Polygons to clip to; water to make level; features whose nearest samples stay vertices; lines that edges
        follow. Each is the path of a file, a geometry of shapely or several, a GeoSeries or a GeoDataFrame; those
        without a reference system are in that of the grid.
    strict, drop, fit, data_dependent, min_angle, tile
        One insertion at a time; drop redundant vertices; let vertices lie off their samples, or triangles be any
        that keep the error, where that takes fewer; the smallest angle, in degrees; cells along a tile.
    threads, memory, progress
        Worker threads (all cores); most memory, in bytes or as "512M"; a function of stage, done and total, or tqdm.

    Raises
    ------
    terrane.Error
        With kind, file, place and remedy; also a ValueError, OSError or MemoryError.

    Examples
    --------
    >>> import numpy as np, terrane
    >>> row, col = np.mgrid[0:100, 0:200]
    >>> mesh = terrane.tin(np.sin(row / 20) * col / 10, max_error=0.1)
    >>> len(mesh.vertices) < 800 and mesh.error <= 0.1
    True
    >>> terrane.tin("synth:rough,size=257", max_vertices=500).crs
    'EPSG:32631'
    """
    goal = asked(
        max_error=max_error,
        max_vertices=max_vertices,
        max_triangles=max_triangles,
        bound=bound,
        strict=strict,
        drop=drop,
        fit=fit,
        data_dependent=data_dependent,
        min_angle=min_angle,
        tile=tile,
    )
    run = settings(threads, memory, progress)
    with opened(
        src,
        band=band,
        nodata=nodata,
        transform=transform,
        crs=crs,
        clip=clip,
        water=water,
        keep_points=keep_points,
        breaklines=breaklines,
    ) as (grid, files):
        return Mesh(grid.tin({**goal, **kept(files)}, run))


def write_tin(
    src: Any,
    path: Path,
    max_error: float | None = None,
    *,
    max_vertices: int | None = None,
    max_triangles: int | None = None,
    bound: str = "samples",
    band: int | None = None,
    nodata: float | None = None,
    transform: Any = None,
    crs: Any = None,
    clip: Features | None = None,
    water: Features | None = None,
    keep_points: Features | None = None,
    breaklines: Features | None = None,
    strict: bool = False,
    drop: bool = True,
    fit: bool = False,
    data_dependent: bool = False,
    min_angle: float | None = None,
    tile: int = 512,
    format: str | None = None,
    split: int | None = None,
    to_crs: Any = None,
    shift_grid: Path | None = None,
    geoid: Path | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    memory: int | str | None = None,
    temp_dir: Path | None = None,
    progress: Any = None,
) -> dict[str, Any]:
    """Makes the mesh of `tin` and writes it while it is made, whatever its size, within the memory allowed. The file
    appears whole or not at all. Returns what `terrane tin --json` tells.

    `format` is one by its name instead of that of the path's ending; `split` writes a folder with a mesh for every so
    many by so many tiles. `to_crs` is the reference system to write in, such as "EPSG:4979"; `shift_grid` a file (NTv2) that
    leads from one datum to another, `geoid` one (GTX or GeoTIFF) that leads from heights above sea level to those above the
    ellipsoid, or back. All that is decided is decided before, in the system of the grid. All else is as for `tin`.

    >>> import os, tempfile, terrane
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "mesh.ply")
    ...     report = terrane.write_tin("synth:rough,size=257", path, max_error=5.0)
    ...     report["vertices"] < 257 * 257, terrane.verify(path, "synth:rough,size=257").ok
    (True, True)
    """
    refuse_existing(os.fspath(path), overwrite)
    goal = asked(
        max_error=max_error,
        max_vertices=max_vertices,
        max_triangles=max_triangles,
        bound=bound,
        strict=strict,
        drop=drop,
        fit=fit,
        data_dependent=data_dependent,
        min_angle=min_angle,
        tile=tile,
    )
    run = settings(threads, memory, progress, temp_dir)
    target = system(to_crs, shift_grid, geoid)
    parts = number("split", split)
    with opened(
        src,
        band=band,
        nodata=nodata,
        transform=transform,
        crs=crs,
        clip=clip,
        water=water,
        keep_points=keep_points,
        breaklines=breaklines,
    ) as (grid, files):
        goal |= kept(files)
        return grid.write_tin(os.fspath(path), goal, format, parts, target, overwrite, run)


class Report:
    """What a proof found. True where it is `ok`."""

    def __init__(self, told: dict[str, Any]) -> None:
        self._told = told

    @property
    def ok(self) -> bool:
        """All that was promised was looked at, and is kept."""
        return bool(self._told["passed"] and self._told["judged"])

    @property
    def max_error(self) -> float | None:
        """The largest vertical distance of a sample (or point) from the mesh."""
        error: float | None = self._told.get("max_error")
        return error

    @property
    def surface_error(self) -> float | None:
        """The largest distance of any point of the lines between neighbouring samples; None of clouds."""
        error: float | None = self._told.get("surface_error")
        return error

    @property
    def failures(self) -> list[str]:
        """What is broken, and where."""
        return list(self._told["failures"])

    @property
    def not_judged(self) -> list[str]:
        """What was promised and not looked at."""
        return list(self._told["not_judged"])

    def as_dict(self) -> dict[str, Any]:
        """All of it, as `terrane verify --json` tells it."""
        return dict(self._told)

    def __bool__(self) -> bool:
        return self.ok

    def __repr__(self) -> str:
        told = "; ".join(self.failures or self.not_judged) or f"max_error {self.max_error:.6g}"
        return f"<terrane.Report: {'ok' if self.ok else 'not ok'}, {told}>"


def verify(
    mesh: Mesh | Path,
    src: Any,
    max_error: float | None = None,
    *,
    bound: str | None = None,
    min_angle: float | None = None,
    keep_points: Features | None = None,
    breaklines: Features | None = None,
    band: int | None = None,
    nodata: float | None = None,
    transform: Any = None,
    crs: Any = None,
    clip: Features | None = None,
    water: Features | None = None,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
) -> Report:
    """Proves a mesh, in memory or in a file, against the grid it was made from, by code of its own.

    Meshes of terrane state their tolerance, bound and smallest angle; for others, or other ones, pass them. `src` and what
    says how it is read are as for `tin`. A broken promise is no error: see `Report.ok`, `failures` and `not_judged`.

    >>> import numpy as np, terrane
    >>> heights = np.random.default_rng(1).normal(size=(40, 60)).astype("f4")
    >>> report = terrane.verify(terrane.tin(heights, max_error=0.5), heights)
    >>> report.ok, report.max_error <= 0.5, report.surface_error >= report.max_error
    (True, True, True)
    >>> terrane.verify(terrane.tin(heights, max_error=0.5), heights + 1, max_error=0.5).ok
    False
    """
    error, angle = number("max_error", max_error), number("min_angle", min_angle)
    run = settings(threads, memory, progress)
    if not isinstance(mesh, Mesh | str | os.PathLike):
        raise usage(f"a {type(mesh).__name__} is no mesh", "pass a terrane.Mesh or a path")
    with opened(
        src,
        band=band,
        nodata=nodata,
        transform=transform,
        crs=crs,
        clip=clip,
        water=water,
        keep_points=keep_points,
        breaklines=breaklines,
    ) as (grid, files):
        points, lines = kept(files).values()
        if not isinstance(mesh, Mesh):
            return Report(grid.verify(os.fspath(mesh), error, bound, angle, points, lines, run))
        with tempfile.TemporaryDirectory(prefix="terrane-") as folder:
            path = os.path.join(folder, "mesh.ply")
            mesh.write(path)
            told = grid.verify(path, error, bound, angle, points, lines, run)
        return Report({**told, "mesh": "in memory"})
