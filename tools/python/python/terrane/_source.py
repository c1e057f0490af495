"""Where grids come from: paths, arrays, and datasets of other packages, none of which is imported here."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from terrane import _terrane
from terrane._errors import ResourceError, usage
from terrane._settings import Path

# Types of samples that the library reads as they are.
NATIVE = {np.dtype(name) for name in ("f4", "f8", "i1", "u1", "i2", "u2", "i4", "u4")}
# Whole numbers beyond this are not all exact in float64.
EXACT = 2**53


def grid_of(
    src: Any,
    *,
    band: int | None = None,
    nodata: float | None = None,
    transform: Any = None,
    crs: Any = None,
    clip: Path | None = None,
    water: Path | None = None,
) -> _terrane.Grid:
    """The grid that `src` stands for."""
    files = [None if file is None else os.fspath(file) for file in (clip, water)]
    reading: dict[str, Any] = {
        "band": band,
        "nodata": nodata,
        "clip": files[0],
        "water": files[1],
    }
    names = names_of(src)
    if names is not None:
        for name, given in (("transform", transform), ("crs", crs)):
            if given is not None:
                raise usage(f"files say themselves where they lie, without a {name}", "leave it out")
        return _terrane.Grid.open(names, reading)
    if is_dataset(src):
        return of_dataset(src, reading, transform, crs)
    if band not in (None, 1):
        raise usage(f"band {band} of an array, which has one", "pass the part of it that is meant")
    if is_data_array(src):
        return of_data_array(src, reading, transform, crs)
    array, fill = native(src, reading["nodata"])
    return _terrane.Grid.array(array, place_of(transform), crs_text(crs), {**reading, "nodata": fill})


def names_of(src: Any) -> list[str] | None:
    """The paths that `src` is or lists, None if it is something else."""
    if isinstance(src, str | os.PathLike):
        return [os.fspath(src)]
    is_list = isinstance(src, list | tuple) and len(src) > 0
    if is_list and all(isinstance(name, str | os.PathLike) for name in src):
        return [os.fspath(name) for name in src]
    return None


def native(src: Any, nodata: float | None) -> tuple[np.ndarray[Any, Any], float | None]:
    """An array of two dimensions, contiguous and of a type that is read as it is, with at most one copy; and the
    value that stands for voids."""
    array = np.ma.getdata(src) if isinstance(src, np.ma.MaskedArray) else np.asarray(src)
    mask = np.ma.getmask(src) if isinstance(src, np.ma.MaskedArray) else np.ma.nomask
    if array.ndim != 2:
        raise usage(
            f"an array of shape {array.shape} is no grid of heights",
            "pass one of two dimensions, rows and columns",
        )
    if array.dtype.kind not in "fiu":
        raise usage(f"an array of {array.dtype} holds no heights", "convert it to numbers")
    if array.size == 0:
        raise usage(f"an array of shape {array.shape} holds no sample")
    if mask is not np.ma.nomask and np.any(mask):
        kind = array.dtype if array.dtype.kind == "f" else np.dtype("f8")
        exact(array)
        array = array.astype(kind if kind.itemsize <= 8 else "f8", order="C")
        if nodata is not None:
            array[array == nodata] = np.nan
        array[mask] = np.nan
        return native(array, None)
    wanted = array.dtype.newbyteorder("=")
    if wanted not in NATIVE:
        exact(array)
        wanted = np.dtype("f4") if wanted.kind == "f" and wanted.itemsize < 4 else np.dtype("f8")
    try:
        return np.require(array, wanted, ("C", "A")), nodata
    except MemoryError as error:
        told = f"a copy of an array of shape {array.shape} takes too much memory"
        remedy = "write it into a file, and pass its name"
        raise ResourceError(f"{told}; {remedy}", "resource", remedy=remedy) from error


def exact(array: np.ndarray[Any, Any]) -> None:
    """Fails where numbers are not exact in float64."""
    if array.dtype.kind not in "iu" or array.dtype.itemsize < 8:
        return
    if int(array.max()) > EXACT or int(array.min()) < -EXACT:
        raise usage("whole numbers above 2^53 are not exact as heights", "scale them")


def place_of(transform: Any) -> list[float] | None:
    """GDAL's six numbers of a transform in rasterio's order: x = a col + b row + c, y = d col + e row + f, of the
    corners of cells."""
    if transform is None:
        return None
    numbers = [float(number) for number in tuple(transform)[:6]]
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise usage(f"the transform {transform!r} is none", "pass rasterio's, or its six numbers")
    a, b, c, d, e, f = numbers
    if a * e == b * d:
        raise usage(f"the transform {transform!r} turns cells into lines", "pass rasterio's, or its six numbers")
    return [c, a, b, f, d, e]


def crs_text(crs: Any) -> str | None:
    """A reference system as text: a code or well-known text."""
    if crs is None:
        return None
    if isinstance(crs, int):
        return f"EPSG:{crs}"
    if isinstance(crs, str):
        return crs
    if hasattr(crs, "to_wkt"):
        return str(crs.to_wkt())
    raise usage(f"{crs!r} is no reference system", "pass text, a code, or one of pyproj or rasterio")


def is_dataset(src: Any) -> bool:
    """True for datasets of rasterio."""
    return all(hasattr(src, name) for name in ("read", "transform", "nodatavals", "indexes"))


def of_dataset(src: Any, reading: dict[str, Any], transform: Any, crs: Any) -> _terrane.Grid:
    """The file of a dataset of rasterio, where it is one; else what it reads."""
    band = reading["band"] or 1
    is_asked = transform is None and crs is None and type(src).__name__ == "DatasetReader"
    if is_asked and os.path.isfile(src.name) and src.driver == "GTiff":
        grid = _terrane.Grid.open([src.name], reading)
        # An overview of a file, opened as a dataset, is not what is in the file.
        if (grid.info["width"], grid.info["height"]) == (src.width, src.height):
            return grid
    if band not in src.indexes:
        raise usage(f"band {band} is out of range: the dataset has {src.count}")
    scale, offset = src.scales[band - 1], src.offsets[band - 1]
    values = src.read(band, masked=True)
    if (scale, offset) != (1.0, 0.0):
        values = values.astype("f8") * scale + offset
    transform = src.transform if transform is None else transform
    array, fill = native(values, reading["nodata"])
    rest = {**reading, "band": None, "nodata": fill}
    return _terrane.Grid.array(array, place_of(transform), crs_text(crs or src.crs), rest)


def is_data_array(src: Any) -> bool:
    """True for DataArrays of xarray."""
    return all(hasattr(src, name) for name in ("dims", "coords", "values", "attrs"))


def of_data_array(src: Any, reading: dict[str, Any], transform: Any, crs: Any) -> _terrane.Grid:
    """What a DataArray of xarray holds, where it says it lies."""
    src = src.squeeze(drop=True)
    for name, plain in (("scale_factor", 1.0), ("add_offset", 0.0)):
        if src.attrs.get(name, plain) != plain:
            raise usage(
                f"the DataArray has a {name} of {src.attrs[name]}, which its values are without",
                "open it with mask_and_scale=True, or apply it and drop the attribute",
            )
    rio = getattr(src, "rio", None)
    if rio is not None and src.ndim == 2:
        src = src.transpose(*sides(rio, src.dims))
        crs = rio.crs if crs is None else crs
        if reading["nodata"] is None and rio.encoded_nodata is None:
            reading = {**reading, "nodata": None if rio.nodata is None else float(rio.nodata)}
    if transform is None and src.ndim == 2:
        transform = even_transform(src)
    array, fill = native(src.values, reading["nodata"])
    rest = {**reading, "band": None, "nodata": fill}
    return _terrane.Grid.array(array, place_of(transform), crs_text(crs), rest)


def sides(rio: Any, dims: tuple[str, ...]) -> tuple[str, ...]:
    """The dimensions of rows and of columns, as the rio accessor knows them, or else in their order."""
    try:
        return (rio.y_dim, rio.x_dim)
    # Its own class of error, which is not to be imported here.
    except Exception as error:
        if type(error).__name__ != "MissingSpatialDimensionError":
            raise
        return dims


def even_transform(src: Any) -> tuple[float, ...] | None:
    """The transform that the coordinates of a DataArray make, which must be evenly spaced."""
    steps = []
    for dim in src.dims:
        if dim not in src.coords:
            return None
        along = np.asarray(src.coords[dim].values, dtype="f8")
        if along.size < 2:
            return None
        step = (along[-1] - along[0]) / (along.size - 1)
        even = along[0] + step * np.arange(along.size)
        if step == 0 or not np.allclose(along, even, rtol=0, atol=abs(step) * 1e-3):
            raise usage(f"coordinates {dim!r} are not evenly spaced", "pass a transform")
        steps.append((float(along[0]), float(step)))
    (y, down), (x, across) = steps
    return (across, 0.0, x - across / 2, 0.0, down, y - down / 2)
