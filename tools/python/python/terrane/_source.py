"""Sources of grids: paths, arrays, and datasets of other packages, which are not imported here."""

from __future__ import annotations

import operator
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrane import _beside, _terrane, _xarray
from terrane._errors import ResourceError, usage, warn
from terrane._numbers import number, real
from terrane._settings import Features

# Sample types supported by the library without conversion.
NATIVE = {np.dtype(name) for name in ("f4", "f8", "i1", "u1", "i2", "u2", "i4", "u4")}
# Integers above this are not exact in float64.
EXACT = 2**53
# Transform of an array without georeference.
IDENTITY = (1, 0, 0, 0, 1, 0)
# Colour interpretation of image bands.
COLOURS = {"red", "green", "blue"}
# Notes of a grid that become warnings, unless a band is chosen.
TOLD = {"several bands", "impossible nodata"}

# Opens a grid, clipped to polygons of a file, with water of another file.
Opener = Callable[[str | None, str | None], _terrane.Grid]


@contextmanager
def opened(
    src: Any,
    *,
    band: int | None = None,
    nodata: float | None = None,
    transform: Any = None,
    crs: Any = None,
    clip: Features | None = None,
    water: Features | None = None,
    **features: Features | None,
) -> Iterator[tuple[_terrane.Grid, dict[str, str | None]]]:
    """Opens the grid `src` and the files of its features for the duration of a context."""
    make = opener_of(src, number("band", band), nodata_of(nodata), transform, crs)

    def system() -> str | None:
        found: str | None = make(None, None).info["crs"]
        return found

    with _beside.files(system, clip=clip, water=water, **features) as files:
        grid = make(files["clip"], files["water"])
        tell(grid, band is not None)
        yield grid, files


def opener_of(src: Any, band: int | None, nodata: float | None, transform: Any, crs: Any) -> Opener:
    """Opener of the grid `src`."""
    names = names_of(src)
    if names is not None:
        for name, given in (("transform", transform), ("crs", crs)):
            if given is not None:
                raise usage(f"{name} is not supported for files", "leave it out")
        return of_files(names, band, nodata)
    if is_dataset(src):
        return of_dataset(src, band, nodata, transform, crs)
    if band not in (None, 1):
        raise usage(f"band {band} of an array with one band", "pass a two-dimensional part")
    if _xarray.is_data_array(src) or _xarray.is_xarray_dataset(src):
        held = _xarray.held_of(src)
        fills = held.fills if nodata is None else [nodata]
        transform = held.transform if transform is None else transform
        return of_array(held.values, fills, transform, held.crs if crs is None else crs)
    return of_array(src, [] if nodata is None else [nodata], transform, crs)


def tell(grid: _terrane.Grid, is_chosen: bool) -> None:
    """Warns of problems of a grid that change its values."""
    for kind, text in grid.notes:
        if kind in TOLD and not (is_chosen and kind == "several bands"):
            warn(text)


def nodata_of(value: Any) -> float | None:
    """Nodata value of an option; any number."""
    given = None if value is None else real(value)
    if value is not None and given is None:
        raise usage(f"nodata is {value!r}", "pass a number")
    return None if given is None else float(given)


def names_of(src: Any) -> list[str] | None:
    """The paths in `src`, None for other sources."""
    if isinstance(src, str | os.PathLike):
        return [os.fspath(src)]
    is_list = isinstance(src, list | tuple) and len(src) > 0
    if is_list and all(isinstance(name, str | os.PathLike) for name in src):
        return [os.fspath(name) for name in src]
    return None


def of_files(names: list[str], band: int | None, nodata: float | None) -> Opener:
    """Opener of files."""
    return lambda clip, water: _terrane.Grid.open(
        names, {"band": band, "nodata": nodata, "clip": clip, "water": water}
    )


def of_array(src: Any, fills: Sequence[float], transform: Any, crs: Any) -> Opener:
    """Opener of an array."""
    array, fill = native(src, fills)
    place, text = place_of(transform), crs_text(crs)
    return lambda clip, water: _terrane.Grid.array(
        array, place, text, {"band": None, "nodata": fill, "clip": clip, "water": water}
    )


def native(src: Any, fills: Sequence[float]) -> tuple[NDArray[Any], float | None]:
    """A contiguous two-dimensional array of a supported type, with at most one copy, and its nodata value. Several
    nodata values, or a mask, become NaN."""
    try:
        array = np.ma.getdata(src) if isinstance(src, np.ma.MaskedArray) else np.asarray(src)
    except ValueError as error:
        raise usage(f"a {type(src).__name__} is not a grid of heights: {error}") from error
    mask = np.ma.getmask(src) if isinstance(src, np.ma.MaskedArray) else np.ma.nomask
    if array.ndim != 2:
        raise usage(
            f"a {type(src).__name__} of shape {array.shape} is not a grid of heights",
            "pass a two-dimensional array (rows, columns)",
        )
    if array.dtype.kind not in "fiu":
        raise usage(f"an array of {array.dtype} holds no heights", "convert it to numbers")
    if array.size == 0:
        raise usage(f"an array of shape {array.shape} is empty")
    for fill in (fill for fill in fills if not holds(array.dtype, fill)):
        warn(f"declared nodata value {fill:g} is not a valid {array.dtype} and has no effect")
    fills = [fill for fill in fills if holds(array.dtype, fill)]
    is_masked = mask is not np.ma.nomask and bool(np.any(mask))
    if is_masked or len(fills) > 1:
        return voided(array, [array == fill for fill in fills] + [mask] * is_masked), None
    wanted = array.dtype.newbyteorder("=")
    if wanted not in NATIVE:
        exact(array)
        wanted = np.dtype("f4") if wanted.kind == "f" and wanted.itemsize < 4 else np.dtype("f8")
    try:
        return np.require(array, wanted, ("C", "A")), fills[0] if fills else None
    except MemoryError as error:
        told = f"a copy of an array of shape {array.shape} does not fit in memory"
        remedy = "write it to a file and pass the path"
        raise ResourceError(f"{told}; {remedy}", "resource", remedy=remedy) from error


def voided(array: NDArray[Any], masks: Sequence[Any]) -> NDArray[Any]:
    """A float copy with NaN where the mask is set."""
    exact(array)
    kind = {2: "f4", 4: "f4"}.get(array.dtype.itemsize, "f8") if array.dtype.kind == "f" else "f8"
    copy = array.astype(kind, order="C")
    for mask in masks:
        copy[mask] = np.nan
    return copy


def holds(dtype: np.dtype[Any], value: float) -> bool:
    """True if a type can hold a value."""
    if dtype.kind == "f":
        return not np.isfinite(value) or bool(np.isfinite(np.asarray(value).astype(dtype)))
    limits = np.iinfo(dtype)
    return bool(limits.min <= value <= limits.max) and float(value).is_integer()


def exact(array: NDArray[Any]) -> None:
    """Raises an error if numbers are not exact in float64."""
    if array.dtype.kind not in "iu" or array.dtype.itemsize < 8:
        return
    if int(array.max()) > EXACT or int(array.min()) < -EXACT:
        raise usage("integers above 2^53 are not exact as heights", "scale them")


def place_of(transform: Any) -> list[float] | None:
    """GDAL's geotransform from a transform in rasterio's order: x = a col + b row + c, y = d col + e row + f, for
    cell corners."""
    if transform is None:
        return None
    try:
        numbers = [float(number) for number in tuple(transform)[:6]]
    except (TypeError, ValueError):
        numbers = []
    remedy = "pass an affine transform of six numbers"
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise usage(f"{transform!r} is not a transform", remedy)
    a, b, c, d, e, f = numbers
    if a * e == b * d:
        raise usage(f"the transform {transform!r} is singular", remedy)
    return [c, a, b, f, d, e]


def crs_text(crs: Any) -> str | None:
    """A CRS as text: a code or WKT."""
    if crs is None:
        return None
    if hasattr(crs, "__index__") and not isinstance(crs, bool):
        return f"EPSG:{operator.index(crs)}"
    if isinstance(crs, str):
        return crs
    if hasattr(crs, "to_wkt"):
        return str(crs.to_wkt())
    raise usage(f"{crs!r} is not a CRS", "pass text, an EPSG code, or a CRS of pyproj or rasterio")


def is_dataset(src: Any) -> bool:
    """True for datasets of rasterio."""
    return all(hasattr(src, name) for name in ("read", "transform", "nodatavals", "indexes"))


def of_dataset(
    src: Any, band: int | None, nodata: float | None, transform: Any, crs: Any
) -> Opener:
    """Opener of a rasterio dataset: its file if possible, otherwise its array."""
    colours = [colour.name for colour in getattr(src, "colorinterp", ())]
    if band is None and COLOURS <= set(colours):
        raise usage(
            f"the dataset is an image with the bands {', '.join(colours)}",
            "pass the band of heights, such as band=1",
        )
    is_plain = transform is None and crs is None and type(src).__name__ == "DatasetReader"
    if is_plain and os.path.isfile(src.name) and src.driver == "GTiff":
        of_file = of_files([src.name], band, nodata)
        info = of_file(None, None).info
        # An overview opened as a dataset differs from the file.
        if (info["width"], info["height"]) == (src.width, src.height):
            return of_file
    band = band or 1
    if band not in src.indexes:
        raise usage(f"band {band} is out of range: the dataset has {src.count}")
    scale, offset = src.scales[band - 1], src.offsets[band - 1]
    values = src.read(band, masked=True)
    if (scale, offset) != (1.0, 0.0):
        values = values.astype("f8") * scale + offset
    transform = transform_of(src) if transform is None else transform
    return of_array(values, [] if nodata is None else [nodata], transform, crs or src.crs)


def transform_of(dataset: Any) -> Any:
    """The transform of a rasterio dataset, None without a georeference."""
    lies_nowhere = dataset.crs is None and tuple(dataset.transform)[:6] == IDENTITY
    return None if lies_nowhere else dataset.transform


def lattice_of(like: Any) -> tuple[tuple[int, int], list[float] | None]:
    """Shape of another grid (a rasterio dataset, an xarray DataArray or Dataset, an array, or a pair of a shape and a
    transform), and its GDAL geotransform or None."""
    shape: tuple[int, ...]
    if _xarray.is_data_array(like) or _xarray.is_xarray_dataset(like):
        shape, transform = _xarray.lattice_of(like)
    elif is_dataset(like):
        shape, transform = (like.height, like.width), transform_of(like)
    elif isinstance(like, np.ndarray):
        shape, transform = like.shape, None
    else:
        try:
            shape, transform = like
            shape = tuple(int(side) for side in shape)
        except (TypeError, ValueError):
            shape, transform = (), None
    if len(shape) != 2:
        raise usage(
            f"a {type(like).__name__} is not a grid",
            "pass a dataset, a DataArray, an array of two dimensions, or a pair of a shape and a transform",
        )
    return (shape[0], shape[1]), place_of(transform)
