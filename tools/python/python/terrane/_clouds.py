"""Point clouds to grids."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrane import _beside, _terrane
from terrane._errors import refuse_existing, usage
from terrane._mesh import Mesh
from terrane._numbers import needed, number, numbers
from terrane._settings import Path, settings
from terrane._source import crs_text, names_of
from terrane._tin import Report

# The dimensions of records of laspy and PDAL that filters ask for, by their names there.
MARKS = {
    "classes": ("classification", "Classification"),
    "numbers": ("return_number", "ReturnNumber"),
    "returns": ("number_of_returns", "NumberOfReturns"),
}
FLAGS = {
    1: ("synthetic", "Synthetic"),
    2: ("key_point", "KeyPoint"),
    4: ("withheld", "Withheld"),
    8: ("overlap", "Overlap"),
}


def cloud_of(
    points: Any,
    *,
    crs: Any = None,
    classes: Iterable[int] | None = None,
    returns: str | int | None = None,
    keep_withheld: bool = False,
    bounds: Sequence[float] | None = None,
    z_range: Sequence[float] | None = None,
    where: str | None = None,
    every: int | None = None,
    salvage: bool = False,
) -> _terrane.Cloud:
    """The cloud that `points` stands for, and what is wanted of it."""
    wanted = {
        "classes": numbers("classes", classes),
        "returns": None if returns is None else str(returns),
        "keep_withheld": keep_withheld,
        "bounds": numbers("bounds", bounds, 4),
        "z_range": finite(numbers("z_range", z_range, 2)),
        "where": where,
        "every": number("every", every),
        "salvage": salvage,
    }
    names = names_of(points)
    if names is not None:
        if crs is not None:
            raise usage("files say themselves where they lie, without a crs", "leave it out")
        return _terrane.Cloud.open(names, wanted)
    positions, marks, own = columns(points)
    text = crs_text(own if crs is None else crs)
    classed, nth, counts, flags = (marks.get(name) for name in (*MARKS, "flags"))
    return _terrane.Cloud.array(positions, classed, nth, counts, flags, text, wanted)


def finite(ends: list[float] | None) -> list[float] | None:
    """The ends of a range, those that are infinite as far off as numbers go: plans cannot say more."""
    most = sys.float_info.max
    return None if ends is None else [max(-most, min(end, most)) for end in ends]


def columns(points: Any) -> tuple[NDArray[np.float64], dict[str, NDArray[np.uint8]], Any]:
    """Positions (n, 3), what else is known of points, and the reference system."""
    if hasattr(points, "point_format"):
        header = getattr(points, "header", None)
        crs = None if header is None else header.parse_crs()
        return (*record(points, of_laspy(points), "x", "y", "z"), crs)
    names = getattr(getattr(points, "dtype", None), "names", None)
    if names is not None:
        axes = ("X", "Y", "Z") if "X" in names else ("x", "y", "z")

        def of(name: str) -> Any:
            return points[name] if name in names else None

        if any(of(axis) is None for axis in axes):
            raise usage(f"an array with the columns {', '.join(names)} has no x, y and z")
        return (*record(points, of, *axes), None)
    array = np.asarray(points)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise usage(
            f"an array of {array.dtype} of shape {array.shape} is no list of points",
            "pass paths, an array of three columns, or records of laspy or PDAL",
        )
    return np.require(array, "f8", ("C", "A")), {}, None


def of_laspy(points: Any) -> Callable[[str], Any]:
    """What records of laspy hold by a name, None where they do not."""
    known = {"x", "y", "z", *points.point_format.dimension_names}
    return lambda name: getattr(points, name) if name in known else None


def record(
    points: Any, of: Any, *axes: str
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.uint8]]]:
    """Positions and marks of records."""
    positions = np.column_stack([np.asarray(of(axis), "f8") for axis in axes])
    marks = {}
    for name, spelled in MARKS.items():
        found = first(of, spelled)
        if found is not None:
            marks[name] = np.require(found, "u1", ("C", "A"))
    flags = np.zeros(len(positions), "u1")
    for bit, spelled in FLAGS.items():
        found = first(of, spelled)
        if found is not None:
            flags |= np.where(found != 0, bit, 0).astype("u1")
    if flags.any():
        marks["flags"] = flags
    return positions, marks


def first(of: Callable[[str], Any], names: Iterable[str]) -> NDArray[Any] | None:
    """What there is by the first of some names that there is."""
    found = next((values for values in map(of, names) if values is not None), None)
    return None if found is None else np.asarray(found)


class GridResult:
    """A grid made of points: `data` is (bands, rows, columns) float64, NaN where there is nothing; `names` has what
    each band is; `transform` six numbers in rasterio's order, `crs` text that pyproj reads, `report` what was done."""

    def __init__(self, folder: tempfile.TemporaryDirectory[str], report: dict[str, Any]) -> None:
        self._folder, self.report = folder, report
        self._path = os.path.join(folder.name, "grid.tif")
        self.names: list[str] = [band["name"] for band in report["bands"]]
        bands = []
        for place in range(1, len(self.names) + 1):
            reading = {"band": place, "nodata": None, "clip": None, "water": None}
            band = _terrane.Grid.open([self._path], reading)
            info = band.info
            bands.append(band.heights().reshape(info["height"], info["width"]))
        self.data: NDArray[np.float64] = np.stack(bands)
        x, a, b, y, d, e = info["place"]
        self.transform: tuple[float, ...] = (a, b, x, d, e, y)
        self.crs: str | None = info["crs"]
        self._wkt: str | None = info["wkt"]

    def write(self, path: Path, overwrite: bool = False) -> None:
        """Writes it into a file, whole or not at all: all bands as a GeoTIFF; one in any format that
        `terrane convert` writes."""
        name = os.fspath(path)
        refuse_existing(name, overwrite)
        if not name.lower().endswith((".tif", ".tiff")):
            if len(self.names) > 1:
                raise usage(f"{len(self.names)} bands are for a GeoTIFF", "write a .tif")
            reading = {"band": 1, "nodata": None, "clip": None, "water": None}
            grid = _terrane.Grid.open([self._path], reading)
            grid.run("convert", name, {"overwrite": overwrite}, settings(None, None))
            return
        new = f"{name}.{os.getpid()}.new"
        try:
            shutil.copyfile(self._path, new)
            os.replace(new, name)
        finally:
            if os.path.exists(new):
                os.unlink(new)

    def to_xarray(self) -> Any:
        """The same as an `xarray.DataArray` with band, y and x, its transform and its reference system in the coordinate
        `spatial_ref`, as CF and rioxarray have it."""
        import xarray

        a, b, x, d, e, y = self.transform
        if b or d:
            raise usage("a grid that is turned has no coordinates of columns and rows")
        _, rows, cols = self.data.shape
        system = {} if self._wkt is None else {"crs_wkt": self._wkt, "spatial_ref": self._wkt}
        place = {"GeoTransform": " ".join(map(repr, (x, a, b, y, d, e)))}
        coords = {
            "band": self.names,
            "y": y + e * (np.arange(rows) + 0.5),
            "x": x + a * (np.arange(cols) + 0.5),
            "spatial_ref": ((), 0, {**system, **place}),
        }
        array = xarray.DataArray(self.data, dims=("band", "y", "x"), coords=coords)
        array.encoding["grid_mapping"] = "spatial_ref"
        return array

    def __reduce__(self) -> tuple[Any, ...]:
        with open(self._path, "rb") as file:
            return unpacked, (file.read(), self.report)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """A band by its name, (rows, columns)."""
        band: NDArray[np.float64] = self.data[self.names.index(name)]
        return band

    def __repr__(self) -> str:
        bands, rows, cols = self.data.shape
        return f"<terrane.GridResult: {', '.join(self.names)}; {bands} x {rows} x {cols}>"


def unpacked(file: bytes, report: dict[str, Any]) -> GridResult:
    """A grid out of a pickle."""
    folder = tempfile.TemporaryDirectory(prefix="terrane-")
    with open(os.path.join(folder.name, "grid.tif"), "wb") as new:
        new.write(file)
    return GridResult(folder, report)


def made(cloud: _terrane.Cloud, asked: dict[str, Any], run: Any) -> GridResult:
    """The grid that is asked for, made by way of a temporary file."""
    folder = tempfile.TemporaryDirectory(prefix="terrane-")
    report = cloud.grid(os.path.join(folder.name, "grid.tif"), asked, False, run)
    return GridResult(folder, report)


def asked_of(
    cell: float | None,
    *,
    stat: str | Sequence[str] | None = None,
    model: str | None = None,
    bounds: Sequence[float] | None = None,
    like: Path | None = None,
    radius: float | None = None,
    max_edge: float | None = None,
    fill: int = 0,
    water: str | None = None,
    canopy: str | None = None,
    format: str | None = None,
) -> dict[str, Any]:
    """What a grid is to be, as the library takes it."""
    return {
        "cell": number("cell", cell),
        "stats": stat if stat is None or isinstance(stat, str) else ",".join(stat),
        "model": model,
        "bounds": numbers("bounds", bounds, 4),
        "like": None if like is None else os.fspath(like),
        "radius": number("radius", radius),
        "max_edge": number("max_edge", max_edge),
        "fill": number("fill", fill),
        "water": water,
        "canopy": canopy,
        "format": format,
        "creation": [],
    }


def grid(
    points: Any,
    cell: float = 1.0,
    stat: str | Sequence[str] = "mean",
    *,
    classes: Iterable[int] | None = None,
    returns: str | int | None = None,
    keep_withheld: bool = False,
    z_range: Sequence[float] | None = None,
    where: str | None = None,
    every: int | None = None,
    salvage: bool = False,
    crs: Any = None,
    bounds: Sequence[float] | None = None,
    like: Path | None = None,
    radius: float | None = None,
    max_edge: float | None = None,
    fill: int = 0,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
) -> GridResult:
    """A grid of points: a band for each statistic of those in a cell. Corners of cells are at multiples of their size, and
    nothing depends on the order of points.

    Parameters
    ----------
    points
        Paths (LAS, LAZ, COPC, text; many are one cloud; "tiles/*.laz"), an array (n, 3) of x, y and z, records of
        laspy or PDAL, or the name of a synthetic cloud ("synth:cloud,size=100").
    cell
        The side of a cell, in units of the reference system.
    stat
        Statistics: "mean", "count:class=6", "p95:above=2", "max:attribute=intensity", "tin" ... as `terrane grid --stat`
        has them. Points in memory have classes and returns, and no other attributes.
    classes, returns, keep_withheld, z_range, where, every
        Only points of these classes; only "first", "last" or "only" returns, or those of a number; with those that are
        marked as withheld; within these heights; of which a condition is true, such as "intensity > 100 and
        point_source in (3, 7)"; every so many.
    salvage
        Give up what cannot be read, and count it, instead of failing.
    crs
        The reference system of points in memory.
    bounds, like
        All cells that a box (x low, y low, x high, y high) overlaps; the cells of a grid in a file.
    radius, max_edge, fill
        Of idw and nearest; the longest edge of triangles; voids filled from cells at most so far away.
    threads, memory, progress
        As for `tin`.

    Examples
    --------
    >>> import numpy as np, terrane
    >>> points = np.random.default_rng(1).uniform(0, 100, size=(5000, 3))
    >>> grid = terrane.grid(points, cell=10.0, stat=["mean", "count"])
    >>> grid.data.shape, grid["count"].sum()
    ((2, 10, 10), np.float64(5000.0))
    """
    cloud = cloud_of(
        points,
        crs=crs,
        classes=classes,
        returns=returns,
        keep_withheld=keep_withheld,
        z_range=z_range,
        where=where,
        every=every,
        salvage=salvage,
    )
    asked = asked_of(
        cell, stat=stat, bounds=bounds, like=like, radius=radius, max_edge=max_edge, fill=fill
    )
    return made(cloud, asked, settings(threads, memory, progress))


def model(points: Any, name: str, cell: float | None, options: dict[str, Any]) -> GridResult:
    """A model of the terrain."""
    crs, salvage = options.pop("crs", None), options.pop("salvage", False)
    where = options.pop("where", None)
    run = settings(*(options.pop(other, None) for other in ("threads", "memory", "progress")))
    known = {"bounds", "like", "radius", "max_edge", "fill", "water", "canopy"}
    unknown = sorted(options.keys() - known)
    if unknown:
        raise TypeError(f"{name}() got an unexpected keyword argument {unknown[0]!r}")
    cloud = cloud_of(points, crs=crs, where=where, salvage=salvage)
    with _beside.files(lambda: cloud.info["crs"], water=options.pop("water", None)) as files:
        return made(cloud, asked_of(cell, model=name, water=files["water"], **options), run)


def dtm(points: Any, cell: float | None = 1.0, **options: Any) -> GridResult:
    """A model of the ground, of one band: triangulated from points of class 2, or from those that a filter finds. Points
    and options are as for `grid` (crs, where, salvage, bounds, like, radius, max_edge, fill, threads, memory, progress), and
    `water` is water to make level: a file, or geometries, as `tin` takes them. Without a `cell` (None) cells are about as
    wide as points are apart.

    >>> import terrane
    >>> ground = terrane.dtm("synth:cloud,size=60,density=2,seed=5", cell=2.0)
    >>> ground.data.shape[0], ground.crs
    (1, 'EPSG:32631')
    """
    return model(points, "dtm", cell, options)


def dsm(points: Any, cell: float | None = 1.0, **options: Any) -> GridResult:
    """A model of what is seen from above, of one band. Points and options are as for `dtm`, without `water`; `canopy` is
    how returns from deep in crowns are got rid of: "pit-free", unless told otherwise, or "spike-free", with its
    parameters after a colon.

    >>> import terrane
    >>> terrane.dsm("synth:cloud,size=60,density=2,seed=5", cell=2.0).names
    ['dsm']
    >>> top = terrane.dsm("synth:cloud,size=60,density=2,seed=5", cell=2.0, canopy="spike-free:freeze=2")
    >>> top.data.shape[0]
    1
    """
    return model(points, "dsm", cell, options)


def chm(points: Any, cell: float | None = 1.0, **options: Any) -> GridResult:
    """The height of what is seen from above over the ground, of one band. Points and options are as for `dsm`.

    >>> import numpy as np, terrane
    >>> canopy = terrane.chm("synth:cloud,size=60,density=2,seed=5", cell=2.0)
    >>> bool(np.nanmin(canopy.data) >= 0)
    True
    """
    return model(points, "chm", cell, options)


def write_cloud_tin(
    points: Any,
    path: Path,
    max_error: float,
    *,
    classes: Iterable[int] | None = None,
    where: str | None = None,
    crs: Any = None,
    overwrite: bool = False,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
) -> dict[str, Any]:
    """Writes a mesh of points, none of them further from it, vertically, than `max_error`. Returns what
    `terrane tin --json` tells.

    >>> import os, tempfile, terrane
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "mesh.ply")
    ...     told = terrane.write_cloud_tin("synth:cloud,size=60,density=2", path, 0.5, classes=[2])
    ...     terrane.verify_cloud(path, "synth:cloud,size=60,density=2", classes=[2]).ok
    True
    """
    refuse_existing(os.fspath(path), overwrite)
    cloud = cloud_of(points, crs=crs, classes=classes, where=where)
    error = needed("max_error", max_error)
    return cloud.write_tin(os.fspath(path), error, overwrite, settings(threads, memory, progress))


def verify_cloud(
    mesh: Path,
    points: Any,
    max_error: float | None = None,
    *,
    classes: Iterable[int] | None = None,
    where: str | None = None,
    crs: Any = None,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
) -> Report:
    """Proves a mesh in a file against the points it was made from."""
    if isinstance(mesh, Mesh):
        raise usage("a mesh in memory is one of a grid", "pass the path of a mesh of points")
    cloud = cloud_of(points, crs=crs, classes=classes, where=where)
    error = number("max_error", max_error)
    return Report(cloud.verify(os.fspath(mesh), error, settings(threads, memory, progress)))
