"""DataArrays and Datasets of one surface in many guises, and what terrane makes of each: run as a program, with `rioxarray` as
its argument or without, it prints that as JSON."""

from __future__ import annotations

import hashlib
import json
import sys
import warnings
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np
import terrane
import xarray
from lands import rough
from numpy.typing import NDArray

ROWS, COLS = 24, 30
HEIGHTS = rough(ROWS, COLS, seed=3)
X = 500_015.0 + 30.0 * np.arange(COLS)
Y = 4_100_685.0 - 30.0 * np.arange(ROWS)
# In rasterio's order.
TRANSFORM = (30.0, 0.0, 500_000.0, 0.0, -30.0, 4_100_700.0)
GEO_TRANSFORM = "500000 30 0 4100700 0 -30"
FILL = -28_672.0
HOLES = np.zeros((ROWS, COLS), bool)
HOLES[5:9, 7:12] = True
MORE_HOLES = np.zeros((ROWS, COLS), bool)
MORE_HOLES[15:18, 20:26] = True
VOID = np.where(HOLES | MORE_HOLES, np.float32(np.nan), HEIGHTS)
# NaN here, and the value for voids there.
BOTH = np.where(HOLES, np.float32(np.nan), np.where(MORE_HOLES, np.float32(FILL), HEIGHTS))
TOLERANCE = 5.0

Attributes = dict[str, Any]
NONE: tuple[Attributes, Attributes] = ({}, {})
AXIS: tuple[Attributes, Attributes] = ({"axis": "Y"}, {"axis": "X"})
STANDARD = (
    {"standard_name": "projection_y_coordinate"},
    {"standard_name": "projection_x_coordinate"},
)
DEGREES = ({"units": "degrees_north"}, {"units": "degrees_east"})
GLOBE = ({"standard_name": "latitude"}, {"standard_name": "longitude"})

# Names of the dimensions along y and x, and the attributes of their coordinates.
DIMS = [
    *product(
        [
            ("y", "x"),
            ("Y", "X"),
            ("lat", "lon"),
            ("latitude", "longitude"),
            ("Latitude", "Longitude"),
            ("northing", "easting"),
            ("rlat", "rlon"),
            ("y_coord", "x_coord"),
            ("lat_0", "lon_0"),
        ],
        [NONE, AXIS],
    ),
    *product([("up", "right"), ("n", "e"), ("i", "j")], [AXIS, STANDARD, DEGREES, GLOBE]),
    # What attributes say comes before what names do.
    (("x", "y"), AXIS),
    (("lon", "lat"), STANDARD),
]


def array(
    values: NDArray[Any] = HEIGHTS,
    dims: tuple[str, str] = ("y", "x"),
    attributes: tuple[Attributes, Attributes] = NONE,
    attrs: Attributes | None = None,
    encoding: Attributes | None = None,
    coords: Attributes | None = None,
) -> xarray.DataArray:
    """A DataArray of a surface, rows first and from the north, with `attributes` of the coordinates."""
    along = {dim: (dim, at, more) for dim, at, more in zip(dims, (Y, X), attributes, strict=True)}
    made = xarray.DataArray(
        values, dims=dims, coords={**along, **(coords or {})}, attrs=attrs or {}, name="dem"
    )
    made.encoding.update(encoding or {})
    return made


def mapping(**attrs: Any) -> tuple[tuple[()], int, Attributes]:
    """A grid mapping."""
    return ((), 0, attrs)


def shapes() -> Iterator[tuple[str, Callable[[], Any]]]:
    """The surface under all names of dimensions, in all orders of them, and of rows and columns."""
    for dims, attributes in DIMS:
        base = array(dims=dims, attributes=attributes)
        told = f"{dims} {attributes[1]}"
        for order, down, right in product((dims, dims[::-1]), (1, -1), (1, -1)):
            turned = base.isel(
                {dims[0]: slice(None, None, down), dims[1]: slice(None, None, right)}
            )
            yield f"{told} {order} {down} {right}", lambda a=turned, o=order: a.transpose(*o)
    base = array()
    yield "of a band", lambda: base.expand_dims("band")
    yield "of a time and a band", lambda: base.expand_dims(["time", "band"]).transpose("x", ...)
    yield "a dataset", lambda: base.to_dataset()
    yield "a dataset with a column", lambda: base.to_dataset().assign(mean=base.mean("y"))
    yield (
        "coordinates along dimensions of other names",
        lambda: xarray.DataArray(
            HEIGHTS.T, dims=("i", "j"), coords={"easting": ("i", X), "northing": ("j", Y)}
        ),
    )
    yield (
        "a transform alone",
        lambda: xarray.DataArray(
            HEIGHTS, dims=("y", "x"), coords={"spatial_ref": mapping(GeoTransform=GEO_TRANSFORM)}
        ),
    )
    yield (
        "coordinates of single precision",
        lambda: array(coords={"y": Y.astype("f4"), "x": X.astype("f4")}),
    )
    yield (
        "a transform of another part",
        lambda: array(coords={"spatial_ref": mapping(GeoTransform="1 2 0 3 0 -2")}),
    )


def voids() -> Iterator[tuple[str, Callable[[], Any]]]:
    """The surface with holes, told in all ways."""
    yield "nan", lambda: array(VOID)
    for name, value in {
        "_FillValue": FILL,
        "missing_value": np.float32(FILL),
        "fill_value": FILL,
        "nodata": FILL,
        "nodatavals": (FILL,),
    }.items():
        yield f"attribute {name}", lambda n=name, v=value: array(BOTH, attrs={n: v})
    yield (
        "several",
        lambda: array(
            np.where(HOLES, np.float32(-1e9), BOTH),
            attrs={"_FillValue": FILL, "missing_value": [-1e9, 5e8]},
        ),
    )
    yield "attribute NaN", lambda: array(VOID, attrs={"_FillValue": np.nan})
    yield "encoding", lambda: array(BOTH, encoding={"_FillValue": FILL, "dtype": "float32"})
    yield (
        "encoding and attribute",
        lambda: array(
            np.where(HOLES, np.float32(-1), BOTH),
            attrs={"_FillValue": -1.0},
            encoding={"missing_value": FILL},
        ),
    )
    yield (
        "encoding with a scale, decoded",
        lambda: array(
            np.where(MORE_HOLES, np.float32(FILL * 0.5 + 7), BOTH),
            encoding={"_FillValue": FILL, "scale_factor": 0.5, "add_offset": 7.0, "dtype": "int16"},
        ),
    )
    yield (
        "encoding with a scale, as it is stored",
        lambda: array(BOTH, encoding={"_FillValue": FILL, "scale_factor": 0.1, "dtype": "int16"}),
    )


UTM = {"grid_mapping_name": "transverse_mercator"}


def systems() -> Iterator[tuple[str, Callable[[], Any]]]:
    """The surface with its reference system, told in all ways."""
    import pyproj

    utm = pyproj.CRS(32631)
    wkt, cf = utm.to_wkt(), utm.to_cf()
    parameters = {name: value for name, value in cf.items() if name != "crs_wkt"}
    for name in ("crs_wkt", "spatial_ref"):
        yield (
            f"spatial_ref {name}",
            lambda n=name: array(coords={"spatial_ref": mapping(**{n: wkt})}),
        )
        yield (
            f"utm {name}",
            lambda n=name: array(
                attrs={"grid_mapping": "utm"},
                coords={"utm": mapping(**{n: wkt}), "spatial_ref": mapping(crs_wkt="no")},
            ),
        )
    yield (
        "encoded",
        lambda: array(encoding={"grid_mapping": "utm"}, coords={"utm": mapping(crs_wkt=wkt)}),
    )
    yield (
        "of several",
        lambda: array(
            attrs={"grid_mapping": "globe: lat lon utm: x y"},
            coords={
                "utm": mapping(crs_wkt=wkt),
                "globe": mapping(crs_wkt=pyproj.CRS(4326).to_wkt()),
            },
        ),
    )
    yield (
        "parameters",
        lambda: array(attrs={"grid_mapping": "utm"}, coords={"utm": mapping(**parameters)}),
    )
    for text in ("EPSG:32631", wkt, "+proj=utm +zone=31 +datum=WGS84 +units=m +no_defs"):
        yield f"attribute {text[:12]}", lambda t=text: array(attrs={"crs": t})
    yield (
        "dataset",
        lambda: xarray.Dataset(
            {"dem": array(attrs={"grid_mapping": "utm"}), "utm": mapping(crs_wkt=wkt)}
        ),
    )


# A system without a code.
LAEA = (
    'PROJCS["mine",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433]],PROJECTION["Lambert_Azimuthal_Equal_Area"],'
    'PARAMETER["latitude_of_center",37],PARAMETER["longitude_of_center",3],PARAMETER["false_easting",500000],'
    'PARAMETER["false_northing",4100000],UNIT["metre",1]]'
)


def refused() -> Iterator[tuple[str, Callable[[], Any], str]]:
    """What cannot be told, and a part of what is told then."""
    base = array()
    yield "unknown names", lambda: base.rename(y="a", x="b"), "'a' (24), 'b' (30)"
    yield "a name and another", lambda: base.rename(y="a"), "'a' (24), 'x' (30)"
    yield "twice the same", lambda: base.rename(y="lon"), "'lon' (24), 'x' (30)"
    yield "many", lambda: xarray.concat([base, base], "band"), "choose one of 'band'"
    yield (
        "of both",
        lambda: array(attributes=({"axis": "Y", "units": "degrees_east"}, {})),
        "both x and y",
    )
    yield "uneven", lambda: base.assign_coords(x=X + np.sin(X)), "'x' are not evenly spaced"
    yield "not monotonic", lambda: base.assign_coords(x=np.roll(X, 3)), "'x' are not evenly spaced"
    yield "one of two", lambda: base.drop_vars("x"), "'x' has no coordinates"
    yield "text", lambda: base.assign_coords(x=[f"c{i}" for i in range(COLS)]), "not numbers"
    yield (
        "curvilinear",
        lambda: xarray.DataArray(
            HEIGHTS,
            dims=("y", "x"),
            coords={"lat": (("y", "x"), HEIGHTS), "lon": (("y", "x"), HEIGHTS)},
        ),
        "not those of rows and columns",
    )
    yield "two grids", lambda: xarray.Dataset({"a": base, "b": base}), "2 variables that are grids"
    yield "no grid", lambda: base.mean("y").to_dataset(), "0 variables that are grids"
    yield "scaled", lambda: array(attrs={"scale_factor": 0.5}), "scale_factor"
    yield "no system", lambda: array(attrs={"crs": "nowhere"}), "is not a CRS"
    yield (
        "bad transform",
        lambda: xarray.DataArray(
            HEIGHTS, dims=("y", "x"), coords={"spatial_ref": mapping(GeoTransform="1 2 3")}
        ),
        "six numbers",
    )


def digest(mesh: terrane.Mesh) -> str:
    """Of the set of positions of a mesh."""
    places = np.asarray(mesh.vertices)
    return hashlib.sha256(places[np.lexsort(places.T)].tobytes()).hexdigest()


def found(make: Callable[[], Any]) -> list[str | None]:
    """The digest and the system of a mesh, or an error."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = terrane.tin(make(), max_error=TOLERANCE)
    except Exception as error:  # noqa: BLE001 (whatever it is, it is told)
        return [type(error).__name__, str(error)]
    return [digest(mesh), mesh.crs]


def everything() -> dict[str, list[str | None]]:
    """What is made of each."""
    cases = [*shapes(), *voids(), *systems(), ("no code", lambda: array(attrs={"crs": LAEA}))]
    made = {name: found(make) for name, make in cases}
    return {**made, **{name: found(make) for name, make, _ in refused()}}


if __name__ == "__main__":
    if "rioxarray" in sys.argv:
        import rioxarray  # noqa: F401
    result = everything()
    assert ("rioxarray" in sys.modules) == ("rioxarray" in sys.argv)
    json.dump(result, sys.stdout)
