"""Point clouds, and grids made of them."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrane import _terrane
from terrane._errors import refuse_existing, usage
from terrane._settings import Path, settings
from terrane._source import crs_text, names_of

# Dimensions of laspy and PDAL records used by filters.
CLASS_AND_RETURNS = {
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


# Input options that some point clouds require to be opened.
OPENING = ("crs", "salvage")


def cloud_of(points: Any, reading: dict[str, Any]) -> _terrane.Cloud:
    """Opens the point cloud `points` with the input options `reading`."""
    reading = {**reading, "crs": crs_text(reading.get("crs"))}
    names = names_of(points)
    if names is not None:
        return _terrane.Cloud.open(names, reading)
    positions, marks, own = columns(points)
    told = reading.pop("crs")
    text = crs_text(own) if told is None else told
    classed, nth, counts, flags = (marks.get(name) for name in (*CLASS_AND_RETURNS, "flags"))
    return _terrane.Cloud.array(positions, classed, nth, counts, flags, text, reading)


def columns(points: Any) -> tuple[NDArray[np.float64], dict[str, NDArray[np.uint8]], Any]:
    """Positions (n, 3), other attributes of points, and the CRS."""
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
            raise usage(f"an array with the columns {', '.join(names)} lacks x, y and z")
        return (*record(points, of, *axes), None)
    array = np.asarray(points)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise usage(
            f"an array of {array.dtype} of shape {array.shape} is not an array of points",
            "pass paths, an array of three columns, or points of laspy or PDAL",
        )
    return np.require(array, "f8", ("C", "A")), {}, None


def of_laspy(points: Any) -> Callable[[str], Any]:
    """A field of laspy records, None if missing."""
    known = {"x", "y", "z", *points.point_format.dimension_names}
    return lambda name: getattr(points, name) if name in known else None


def record(
    points: Any, of: Any, *axes: str
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.uint8]]]:
    """Positions and attributes of records."""
    positions = np.column_stack([np.asarray(of(axis), "f8") for axis in axes])
    marks = {}
    for name, spelled in CLASS_AND_RETURNS.items():
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
    """The value of the first existing name."""
    found = next((values for values in map(of, names) if values is not None), None)
    return None if found is None else np.asarray(found)


class GridResult:
    """A grid made of points: `data` is (bands, rows, columns) float64 with NaN for voids, `names` are the bands,
    `transform` is six numbers in rasterio's order, `crs` is text for pyproj, `report` is the report of the job."""

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
        """Writes the grid to a file atomically: several bands as GeoTIFF, one band in any format of `terrane
        convert`."""
        name = os.fspath(path)
        refuse_existing(name, overwrite)
        if not name.lower().endswith((".tif", ".tiff")):
            if len(self.names) > 1:
                raise usage(f"{len(self.names)} bands require a GeoTIFF", "write a .tif")
            reading = {"band": 1, "nodata": None, "clip": None, "water": None}
            grid = _terrane.Grid.open([self._path], reading)
            _terrane.run_operation("convert", grid, name, {"overwrite": overwrite}, settings(None, None))
            return
        new = f"{name}.{os.getpid()}.new"
        try:
            shutil.copyfile(self._path, new)
            os.replace(new, name)
        finally:
            if os.path.exists(new):
                os.unlink(new)

    def to_xarray(self) -> Any:
        """The grid as an `xarray.DataArray` with dimensions band, y and x, and its transform and CRS in the
        coordinate `spatial_ref`, as in CF and rioxarray."""
        import xarray

        a, b, x, d, e, y = self.transform
        if b or d:
            raise usage("a rotated grid has no coordinates along rows and columns")
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
        """A band by name, (rows, columns)."""
        band: NDArray[np.float64] = self.data[self.names.index(name)]
        return band

    def __repr__(self) -> str:
        bands, rows, cols = self.data.shape
        return f"<terrane.GridResult: {', '.join(self.names)}; {bands} x {rows} x {cols}>"


def unpacked(file: bytes, report: dict[str, Any]) -> GridResult:
    """Restores a pickled grid."""
    folder = tempfile.TemporaryDirectory(prefix="terrane-")
    with open(os.path.join(folder.name, "grid.tif"), "wb") as new:
        new.write(file)
    return GridResult(folder, report)
