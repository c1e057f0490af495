"""DataArrays and Datasets of xarray as grids. Metadata is read from attributes, encodings and coordinates by the CF,
GDAL and rioxarray conventions, independent of the imported packages."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrane._errors import usage, warn

# CF attributes of coordinates along x and y (sections 4.1, 4.2 and 5.6), and those of THREDDS.
STANDARD_NAMES = {
    "projection_x_coordinate": "x",
    "projection_y_coordinate": "y",
    "projection_x_angular_coordinate": "x",
    "projection_y_angular_coordinate": "y",
    "longitude": "x",
    "latitude": "y",
    "grid_longitude": "x",
    "grid_latitude": "y",
}
AXES = {"x": "x", "y": "y", "geox": "x", "geoy": "y", "lon": "x", "lat": "y"}
EAST = re.compile(r"degrees?_?e(ast)?", re.IGNORECASE)
NORTH = re.compile(r"degrees?_?n(orth)?", re.IGNORECASE)
# Names of dimensions and coordinates, with or without a number ("x", "lat_0", "Northing").
NAMES = {
    "x": re.compile(
        r"(x|x_?c(oord(inate)?)?|x_?geo|r?lons?|lng|(grid_|nav_)?(lon|longitudes?)|(utm_)?eastings?|east"
        r"|projection_x_coordinate|cols?|columns?|pixels?|samples?)_?\d*|dim_1",
        re.IGNORECASE,
    ),
    "y": re.compile(
        r"(y|y_?c(oord(inate)?)?|y_?geo|r?lats?|(grid_|nav_)?(lat|latitudes?)|(utm_)?northings?|north"
        r"|projection_y_coordinate|rows?|lines?)_?\d*|dim_0",
        re.IGNORECASE,
    ),
}
# Names of row numbers, from the top: y is the negative row.
ROWS = re.compile(r"(rows?|lines?)_?\d*|dim_0", re.IGNORECASE)
FILLS = ("_FillValue", "missing_value", "fill_value", "nodata", "nodatavals")
TEXTS = ("crs_wkt", "spatial_ref", "proj4", "proj4text", "epsg_code")
# Share of a step: larger deviations are uneven spacing.
UNEVEN = 1e-3
PLACE_REMEDY = "pass a transform"
DIMS_REMEDY = 'rename them to "y" and "x", give their coordinates a standard_name or an axis, or pass the values as an array'


class Held(NamedTuple):
    """Contents of a DataArray."""

    values: Any
    fills: list[float]
    transform: tuple[float, ...] | None
    crs: Any


def is_data_array(src: Any) -> bool:
    """True for DataArrays of xarray."""
    return all(hasattr(src, name) for name in ("dims", "coords", "values", "attrs", "encoding"))


def is_xarray_dataset(src: Any) -> bool:
    """True for Datasets of xarray."""
    return all(hasattr(src, name) for name in ("data_vars", "coords", "attrs", "sizes"))


def variable_of(dataset: Any) -> Any:
    """The only grid variable of a Dataset, with its grid mapping."""
    grids = [name for name, held in dataset.data_vars.items() if is_grid(held)]
    if len(grids) != 1:
        told = ", ".join(map(repr, grids)) or "none"
        raise usage(
            f"a Dataset with {len(grids)} variables that are grids ({told})",
            "pass one of them, as dataset[name]",
        )
    array = dataset[grids[0]]
    mapping = mapping_name(array, sides(array) or ("", ""))
    if mapping in dataset.data_vars:
        array = array.assign_coords({mapping: dataset[mapping]})
    return array


def is_grid(array: Any) -> bool:
    """True for a numeric array with two dimensions longer than 1."""
    return array.dtype.kind in "fiu" and sides(array) is not None


def held_of(src: Any) -> Held:
    """Contents of a DataArray or a Dataset, rows first."""
    array = variable_of(src) if is_xarray_dataset(src) else src
    for name, plain in (("scale_factor", 1.0), ("add_offset", 0.0)):
        if array.attrs.get(name, plain) != plain:
            raise usage(
                f"the {name} of {array.attrs[name]} is not applied to the DataArray",
                "open it with mask_and_scale=True, or apply it and delete the attribute",
            )
    y, x = sides_of(array)
    grid = array.isel({dim: 0 for dim in array.dims if dim not in (y, x)}).transpose(y, x)
    mapping = mapping_of(array, (y, x))
    values = grid.values
    return Held(
        values, fills_of(array, values), place_of(grid, (y, x), mapping), crs_of(array, mapping)
    )


def lattice_of(src: Any) -> tuple[tuple[int, int], tuple[float, ...] | None]:
    """Rows and columns of a DataArray or a Dataset, and its transform."""
    array = variable_of(src) if is_xarray_dataset(src) else src
    y, x = sides_of(array)
    place = place_of(array, (y, x), mapping_of(array, (y, x)))
    return (array.sizes[y], array.sizes[x]), place


def sides(array: Any) -> tuple[str, str] | None:
    """The dimensions along y and x, None if unknown or if others are longer than 1."""
    found: dict[str, list[Any]] = {"x": [], "y": []}
    for dim in array.dims:
        axis = axis_of(array, dim)
        if axis is None and array.sizes[dim] > 1:
            return None
        if axis is not None:
            found[axis].append(dim)
    if len(found["x"]) != 1 or len(found["y"]) != 1:
        return None
    return found["y"][0], found["x"][0]


def sides_of(array: Any) -> tuple[str, str]:
    """The dimensions along y and x; an error names ambiguous ones."""
    found = sides(array) or sides_of_accessor(array)
    if found is not None:
        return found
    told = ", ".join(f"{dim!r} ({array.sizes[dim]})" for dim in array.dims)
    axes = [axis_of(array, dim) for dim in array.dims]
    others = [dim for dim, axis in zip(array.dims, axes, strict=True) if axis is None]
    if sorted(axis for axis in axes if axis is not None) == ["x", "y"]:
        raise usage(
            f"a DataArray of the dimensions {told} is more than one grid",
            f"choose one of {others[0]!r}, as by .isel({others[0]}=0)",
        )
    raise usage(
        f"cannot tell which of the dimensions {told} of a DataArray are y and x", DIMS_REMEDY
    )


def sides_of_accessor(array: Any) -> tuple[str, str] | None:
    """The dimensions along y and x set in the rio accessor, or None."""
    rio = getattr(array, "rio", None)
    y, x = (getattr(rio, name, None) for name in ("_y_dim", "_x_dim"))
    long = {dim for dim in array.dims if array.sizes[dim] > 1}
    return None if y is None or x is None or {y, x} != long else (y, x)


def axis_of(array: Any, dim: Any) -> str | None:
    """Axis of a dimension, "x" or "y": by the attributes of its coordinates, its name, or their names; None if
    unknown."""
    along = [array.coords[name] for name in array.coords if array.coords[name].dims == (dim,)]
    named = [
        name for name in (axis_of_name(dim), *(axis_of_name(held.name) for held in along)) if name
    ]
    stated = {axis for held in along for axis in axes_of_attributes(held.attrs)}
    for found in (sorted(stated), named[:1]):
        if len(found) > 1:
            raise usage(f"the coordinates of {dim!r} are marked as both x and y", DIMS_REMEDY)
        if found:
            return found[0]
    return None


def axes_of_attributes(attrs: Mapping[str, Any]) -> Iterator[str]:
    """Axes stated by the attributes of a coordinate."""
    for name in ("axis", "_CoordinateAxisType"):
        axis = AXES.get(str(attrs.get(name, "")).lower())
        if axis:
            yield axis
    axis = STANDARD_NAMES.get(str(attrs.get("standard_name", "")).lower())
    if axis:
        yield axis
    units = str(attrs.get("units", ""))
    if EAST.fullmatch(units):
        yield "x"
    if NORTH.fullmatch(units):
        yield "y"


def axis_of_name(name: Any) -> str | None:
    """Axis of coordinates of this name."""
    found = [axis for axis, known in NAMES.items() if known.fullmatch(str(name))]
    return found[0] if found else None


def mapping_name(array: Any, dims: tuple[str, str]) -> str | None:
    """Name of the grid mapping variable. Of several, as in CF 1.7 ("utm: x y wgs84: lat lon"), the one of the
    dimensions."""
    told = array.encoding.get("grid_mapping", array.attrs.get("grid_mapping"))
    if told is None:
        return None
    parts = re.findall(r"(\S+?):([^:]*)(?=\s\S+:|$)", str(told))
    for name, coordinates in parts:
        if set(dims) & set(coordinates.split()):
            return str(name)
    return str(parts[0][0]) if parts else str(told).strip()


def mapping_of(array: Any, dims: tuple[str, str]) -> Mapping[str, Any]:
    """Attributes of the grid mapping variable; empty without one."""
    name = mapping_name(array, dims)
    if name is not None and name in array.coords:
        return dict(array.coords[name].attrs)
    scalars = [array.coords[other] for other in array.coords if array.coords[other].ndim == 0]
    telling = [
        held.attrs
        for held in scalars
        if {*TEXTS, "grid_mapping_name", "GeoTransform"} & held.attrs.keys()
    ]
    if len(telling) == 1:
        return dict(telling[0])
    if len(telling) > 1:
        raise usage("several coordinates of a DataArray state a CRS", "pass crs")
    if name is not None:
        warn(
            f"CRS is unknown: the grid mapping {name!r} is not among the coordinates of the DataArray; "
            'pass its Dataset, open it with decode_coords="all", or pass crs',
        )
    return {}


def crs_of(array: Any, mapping: Mapping[str, Any]) -> Any:
    """CRS of a grid mapping or of the attributes of a DataArray; otherwise that of its rio accessor."""
    for attrs, names in ((mapping, TEXTS), (array.attrs, ("crs", *TEXTS))):
        text = next((attrs[name] for name in names if attrs.get(name)), None)
        if text is not None:
            return known_text(text)
    if "grid_mapping_name" in mapping:
        return by_pyproj(
            mapping["grid_mapping_name"], lambda pyproj: pyproj.CRS.from_cf(dict(mapping))
        )
    return getattr(getattr(array, "rio", None), "crs", None)


def known_text(text: Any) -> Any:
    """A CRS as text; PROJ strings ("+proj=utm +zone=31") are converted to WKT."""
    if isinstance(text, str) and text.lstrip().startswith("+"):
        return by_pyproj(text, lambda pyproj: pyproj.CRS.from_user_input(text))
    if isinstance(text, int | np.integer):
        return int(text)
    return text


def by_pyproj(told: Any, make: Any) -> str:
    """WKT of a CRS made by `make` with pyproj."""
    try:
        import pyproj
    except ImportError as error:
        remedy = "install pyproj, or pass crs"
        raise usage(f"the CRS {told!r} is not WKT", remedy) from error
    try:
        return str(make(pyproj).to_wkt())
    except (pyproj.exceptions.CRSError, KeyError) as error:
        raise usage(f"pyproj does not know the CRS {told!r}: {error}", "pass crs") from error


def place_of(
    array: Any, dims: tuple[str, str], mapping: Mapping[str, Any]
) -> tuple[float, ...] | None:
    """The transform in rasterio's order from the coordinates along y and x, or from the grid mapping; None without
    either."""
    stated = stated_transform(mapping)
    y, x = (positions(array, dim, axis) for dim, axis in zip(dims, "yx", strict=True))
    if y is None and x is None:
        turned = [name for name in array.coords if set(array.coords[name].dims) == set(dims)]
        if stated is None and any(axis_of(array, name) or axis_of_name(name) for name in turned):
            told = ", ".join(map(repr, turned))
            raise usage(f"the coordinates {told} are not those of rows and columns", PLACE_REMEDY)
        return stated
    if y is None or x is None:
        lacking = dims[0] if y is None else dims[1]
        raise usage(
            f"the dimension {lacking!r} has no coordinates, but the other one has", PLACE_REMEDY
        )
    if 1 in (len(y), len(x)):
        return stated
    (top, down), (left, across) = even(dims[0], y), even(dims[1], x)
    found = (across, 0.0, left - across / 2, 0.0, down, top - down / 2)
    # Coordinates are rounded; the original transform is not.
    close = stated is not None and all(
        math.isclose(a, b, rel_tol=0, abs_tol=UNEVEN * min(abs(across), abs(down)) / size)
        for a, b, size in zip(found, stated, (len(x), 1, 1, 1, len(y), 1), strict=True)
    )
    return stated if close else found


def stated_transform(mapping: Mapping[str, Any]) -> tuple[float, ...] | None:
    """The GeoTransform of a grid mapping in rasterio's order."""
    told = mapping.get("GeoTransform")
    if told is None:
        return None
    try:
        numbers = [float(part) for part in (told.split() if isinstance(told, str) else told)]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 6:
        raise usage(
            f"the GeoTransform {told!r} of the grid mapping is not six numbers", PLACE_REMEDY
        )
    x, a, b, y, d, e = numbers
    return (a, b, x, d, e, y)


def positions(array: Any, dim: Any, axis: str) -> NDArray[np.float64] | None:
    """Positions along a dimension, from its own coordinate or from the coordinate of the axis; None without either."""
    names = [name for name in array.coords if array.coords[name].dims == (dim,)]
    known = [
        name
        for name in names
        if axis_of_name(name) == axis or axis in axes_of_attributes(array.coords[name].attrs)
    ]
    names = [dim] if dim in names else known
    if not names:
        return None
    if len(names) > 1:
        told = ", ".join(map(repr, names))
        raise usage(f"several coordinates run along {dim!r}: {told}", PLACE_REMEDY)
    held = array.coords[names[0]]
    if held.dtype.kind not in "fiu":
        raise usage(f"the coordinates {names[0]!r} are {held.dtype}, not numbers", PLACE_REMEDY)
    along = np.asarray(held.values)
    is_row = ROWS.fullmatch(str(names[0])) and not any(axes_of_attributes(held.attrs))
    return -along.astype("f8") if is_row else along


def even(dim: Any, along: NDArray[Any]) -> tuple[float, float]:
    """First position and constant step."""
    rounding = np.spacing(np.abs(along).max()) if along.dtype.kind == "f" else 0.0
    along = along.astype("f8")
    step = (along[-1] - along[0]) / (along.size - 1)
    off = np.abs(along - (along[0] + step * np.arange(along.size))).max()
    if step == 0 or not off <= max(abs(step) * UNEVEN, 2 * float(rounding)):
        raise usage(f"coordinates {dim!r} are not evenly spaced", PLACE_REMEDY)
    return float(along[0]), float(step)


def fills_of(array: Any, values: NDArray[Any]) -> list[float]:
    """Nodata values of attributes and encoding."""
    found = [*told_fills(array.attrs), *encoded_fills(array.encoding, values)]
    if not found:
        nodata = getattr(getattr(array, "rio", None), "nodata", None)
        found = [] if nodata is None else [float(nodata)]
    return list(dict.fromkeys(found))


def told_fills(told: Mapping[str, Any]) -> list[float]:
    """Nodata values of attributes."""
    given = [np.ravel(told[name]) for name in FILLS if told.get(name) is not None]
    return [
        float(value)
        for values in given
        if values.dtype.kind in "fiu"
        for value in values
        if not np.isnan(value)
    ]


def encoded_fills(encoding: Mapping[str, Any], values: NDArray[Any]) -> list[float]:
    """Nodata values of an encoding. They refer to stored numbers, which decode to NaN; values set later may remain,
    scaled or not."""
    stored = told_fills(encoding)
    scale, offset = (
        float(encoding.get(name, plain))
        for name, plain in (("scale_factor", 1.0), ("add_offset", 0.0))
    )
    if (scale, offset) == (1.0, 0.0):
        return stored
    kept = []
    for fill in stored:
        count = (
            int(np.count_nonzero(values == fill)) if is_beyond(fill, encoding, scale, offset) else 0
        )
        if count > 0:
            kept.append(fill)
            warn(
                f"{count} samples are {fill:g}, the nodata value before the scale factor {scale:g}: "
                "they are read as voids",
            )
    return [*kept, *(fill * scale + offset for fill in stored)]


def is_beyond(fill: float, encoding: Mapping[str, Any], scale: float, offset: float) -> bool:
    """True if no stored number decodes to the undecoded nodata value."""
    kind = np.dtype(encoding.get("dtype", "f8"))
    if kind.kind not in "iu" or scale == 0:
        return True
    limits, stored = np.iinfo(kind), (fill - offset) / scale
    return not (limits.min <= stored <= limits.max)
