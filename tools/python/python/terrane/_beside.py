"""Features for a grid or a point cloud (clip polygons, water, breaklines, points to keep): files, or geometries in
memory, which are written to temporary files."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from terrane._errors import Error, usage
from terrane._settings import Features

REMEDY = "pass a path, a geometry of shapely or several, a GeoSeries or a GeoDataFrame"
# Packages with geometry objects.
PACKAGES = ("shapely", "geopandas", "numpy")


@contextmanager
def files(
    crs_of: Callable[[], str | None], **given: Features | None
) -> Iterator[dict[str, str | None]]:
    """File names by option, for the values in `given`; geometries are written to temporary files. Geometries without
    a CRS have that of `crs_of`. Errors about temporary files name the option.

    >>> import shapely
    >>> with files(lambda: "EPSG:32631", clip="area.gpkg", water=shapely.box(0, 0, 1, 1)) as found:
    ...     found["clip"], open(found["water"]).read()
    ('area.gpkg', 'POLYGON ((1 0, 1 1, 0 1, 0 0, 1 0))\\n')
    """
    held = {name: value for name, value in given.items() if not is_path(value)}
    named = paths("", **{name: given[name] for name in given.keys() - held.keys()})
    if not held:
        yield named
        return
    with tempfile.TemporaryDirectory(prefix="terrane-") as folder:
        written = {name: written_into(folder, name, value, crs_of) for name, value in held.items()}
        try:
            yield {**named, **written}
        except Error as error:
            for name, path in written.items():
                if path in str(error):
                    raise error.about(path, name) from None
            raise


def settle(options: dict[str, Any]) -> None:
    """Resolves aliases of `clip`."""
    if "polygon" in options and options.get("clip") is None:
        options["clip"] = options.pop("polygon")


def is_path(value: Any) -> bool:
    """True for a path or None."""
    return value is None or isinstance(value, str | os.PathLike)


def paths(reason: str, **given: Features | None) -> dict[str, str | None]:
    """File names of `given`; geometries in memory raise an error with `reason`."""
    for name, value in given.items():
        if not is_path(value):
            told = f"{name} is a {type(value).__name__} in memory, but {reason}"
            raise usage(told, "write it to a file and pass the path")
    return {name: None if value is None else os.fspath(value) for name, value in given.items()}


def written_into(folder: str, name: str, value: Any, crs_of: Callable[[], str | None]) -> str:
    """Writes the geometries of an option to a file."""
    from terrane._source import crs_text

    texts, crs = geometries_of(name, value)
    path = os.path.join(folder, f"{name}.wkt")
    with open(path, "w") as file:
        file.writelines(f"{text}\n" for text in texts)
    system = crs_of() if crs is None else crs_text(crs)
    if system is not None:
        with open(os.path.join(folder, f"{name}.prj"), "w") as file:
            file.write(system)
    return path


def geometries_of(name: str, value: Any) -> tuple[list[str], Any]:
    """Geometries of `value` as WKT, and their CRS if any."""
    package = type(value).__module__.partition(".")[0]
    if package not in PACKAGES and not isinstance(value, list | tuple):
        raise usage(f"{name} is a {type(value).__name__}", REMEDY)
    import shapely

    held = getattr(value, "geometry", value) if package == "geopandas" else value
    array = np.atleast_1d(np.asarray(held, dtype=object)).ravel()
    known = shapely.is_geometry(array)
    strange = array[~(known | shapely.is_missing(array))]
    if len(strange) > 0:
        raise usage(f"{name} holds a {type(strange[0]).__name__}", REMEDY)
    array = array[known]
    array = array[~shapely.is_empty(array)]
    if len(array) == 0:
        raise usage(f"{name} holds no geometry", "leave it out")
    # Enough decimals for a lossless round trip.
    return list(shapely.to_wkt(array, rounding_precision=20)), getattr(held, "crs", None)
