"""Lines: contours of grids, and line simplification."""

from __future__ import annotations

import os
import tempfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrane import _terrane
from terrane._errors import usage
from terrane._numbers import needed
from terrane._settings import settings
from terrane._source import crs_text

METRICS = ("plane", "space", "metres")
GOALS = ("area", "keep_count", "keep_ratio")
# Options of vector files that geometries support, too.
OF_GEOMETRIES = (
    "area",
    "collapse",
    "decimals",
    "keep_count",
    "keep_ratio",
    "sides",
    "snap",
    "strategy",
)


class Lines:
    """Lines in memory: line i is `coordinates[offsets[i]:offsets[i + 1]]` at height `levels[i]`."""

    def __init__(
        self,
        coordinates: NDArray[np.float64],
        offsets: NDArray[np.int64],
        levels: NDArray[np.float64],
        crs: str | None,
    ) -> None:
        self.coordinates = coordinates
        self.offsets = offsets
        self.levels = levels
        self.crs = crs

    def __len__(self) -> int:
        return len(self.levels)

    def __getitem__(self, number: int) -> NDArray[np.float64]:
        """A line, (n, 2)."""
        number = range(len(self))[number]
        return self.coordinates[self.offsets[number] : self.offsets[number + 1]]

    def to_shapely(self) -> Any:
        """An array of `shapely.LineString`."""
        import shapely

        line = shapely.GeometryType.LINESTRING
        return shapely.from_ragged_array(line, self.coordinates, (self.offsets,))

    def to_geopandas(self) -> Any:
        """A `geopandas.GeoDataFrame` with the column `level`."""
        import geopandas

        return geopandas.GeoDataFrame(
            {"level": self.levels}, geometry=self.to_shapely(), crs=self.crs
        )

    def __repr__(self) -> str:
        levels = len(np.unique(self.levels))
        return f"<terrane.Lines: {len(self):,} lines at {levels} levels, {len(self.coordinates):,} vertices>"


def sorted_lines(
    coordinates: NDArray[np.float64],
    offsets: NDArray[np.int64],
    values: NDArray[np.float64],
    order: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Lines in another order."""
    counts = np.diff(offsets)[order]
    ends = np.concatenate([[0], np.cumsum(counts)])
    places = np.arange(ends[-1]) - np.repeat(ends[:-1], counts) + np.repeat(offsets[order], counts)
    return coordinates[places], ends.astype("i8"), values[order]


def simplify(
    geometry: Any,
    tolerance: float | None = None,
    method: str | None = None,
    *,
    offsets: Any = None,
    topology: bool = False,
    metric: str = "plane",
    rings: bool = False,
    crs: Any = None,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
    **options: Any,
) -> Any:
    """Simplifies lines and polygons: every omitted vertex is within `tolerance` of the segment that replaces it.

    Parameters
    ----------
    geometry
        A shapely geometry or an array of them, a GeoSeries or GeoDataFrame, an array of positions (n, 2 or 3) of one
        line, or of many with `offsets`; or an object with the Arrow C interface that geopandas reads. Other geometry
        types are unchanged.
    tolerance
        In units of the coordinates; in metres on the ellipsoid with `metric="metres"`; an area for methods that use
        areas.
    method
        "cone" (near the fewest vertices, in one pass), "rdp", "imai-iri" (the fewest vertices), "visvalingam",
        "weighted-visvalingam".
    topology
        Keep topology: no new crossings, and shared borders stay shared.
    metric
        "plane": x and y; "space": x, y and z; "metres": on the ellipsoid, for longitudes and latitudes.
    options
        For geometries, as for `simplify_file`: `snap`, `sides`, `strategy`, `collapse` and `decimals`; `area`,
        `keep_ratio` or `keep_count` instead of the tolerance.
    offsets, rings
        For positions: start of each line and end of the last; whether lines are rings.

    Returns
    -------
    The same type; for positions the kept positions, and their offsets if `offsets` was passed.

    Examples
    --------
    >>> import numpy as np, terrane
    >>> terrane.simplify(np.array([[0.0, 0.0], [1.0, 0.01], [2.0, 0.0]]), 0.1)
    array([[0., 0.],
           [2., 0.]])
    """
    method = method or "cone"
    if metric not in METRICS:
        raise usage(f"unknown metric {metric!r}", f"choose one of {', '.join(METRICS)}")
    if tolerance is not None or not any(key in options for key in GOALS):
        tolerance = needed("tolerance", tolerance)
    asked = None
    options = {key: value for key, value in options.items() if value is not None}
    for key in options.keys() - set(OF_GEOMETRIES):
        raise usage(
            f"simplify of geometries has no option {key!r}",
            f"pass one of {', '.join(OF_GEOMETRIES)}, or call simplify_file",
        )
    if metric == "metres" and tolerance is None:
        raise usage('metric="metres" requires a tolerance', "pass one, or leave metric out")
    if topology or metric == "metres" or options:
        asked = {**goal_of(tolerance, method, metric), "topology": topology, **options}
        _terrane.check_operation("simplify", asked, "lines.wkt")
    run = settings(threads, memory, progress)
    plain = isinstance(geometry, np.ndarray) and geometry.dtype.kind in "fiu"
    if plain or offsets is not None:
        if asked is not None or crs is not None:
            raise usage(
                "topology and crs are not supported for positions", "pass geometries of shapely"
            )
        return of_positions(geometry, offsets, tolerance, method, metric, rings, run)
    if rings:
        raise usage("rings is not supported for geometries", "leave rings out")
    if topology and metric == "space":
        raise usage('topology is not supported with metric="space"', "leave one of them out")
    import shapely

    if hasattr(geometry, "geometry") and hasattr(geometry, "set_geometry"):
        frame = geometry.copy()
        geometries, crs = geometry.geometry.to_numpy(), crs or geometry.crs
        done = of_geometries(geometries, tolerance, method, asked, metric, crs, run)
        return frame.set_geometry(type(geometry.geometry)(done, index=frame.index, crs=frame.crs))
    if hasattr(geometry, "to_numpy") and hasattr(geometry, "crs"):
        geometries, crs = geometry.to_numpy(), crs or geometry.crs
        done = of_geometries(geometries, tolerance, method, asked, metric, crs, run)
        return type(geometry)(done, index=geometry.index, crs=geometry.crs)
    if hasattr(geometry, "__arrow_c_stream__") or hasattr(geometry, "__arrow_c_array__"):
        import geopandas

        cls = (
            geopandas.GeoSeries
            if hasattr(geometry, "__arrow_c_array__")
            else geopandas.GeoDataFrame
        )
        return simplify(
            cls.from_arrow(geometry),
            tolerance,
            method,
            topology=topology,
            metric=metric,
            crs=crs,
            threads=threads,
            memory=memory,
            progress=progress,
            **options,
        )
    array = np.atleast_1d(np.asarray(geometry, dtype=object))
    if not all(shapely.is_geometry(array.ravel()) | shapely.is_missing(array.ravel())):
        raise usage(
            f"a {type(geometry).__name__} is not a geometry or an array of geometries",
            "pass geometries of shapely",
        )
    done = of_geometries(array.ravel(), tolerance, method, asked, metric, crs, run)
    return done[0] if isinstance(geometry, shapely.Geometry) else done.reshape(array.shape)


def of_positions(
    positions: Any,
    offsets: Any,
    tolerance: Any,
    method: str,
    metric: str,
    rings: bool,
    run: Any,
) -> Any:
    """Positions of one line, or of many."""
    array = np.require(positions, "f8", ("C", "A"))
    if array.ndim != 2:
        raise usage(f"an array of shape {array.shape} is not an array of positions")
    wide = array[:, :2] if metric == "plane" and array.shape[1] == 3 else array
    wide = np.require(wide, "f8", ("C", "A"))
    starts = [0, len(array)] if offsets is None else offsets
    begins = np.require(starts, "i8", ("C", "A"))
    places, ends = _terrane.simplify_places(wide, begins, tolerance, method, rings, run)
    return array[places] if offsets is None else (array[places], ends)


def of_geometries(
    geometries: NDArray[Any],
    tolerance: Any,
    method: str,
    asked: dict[str, Any] | None,
    metric: str,
    crs: Any,
    run: Any,
) -> NDArray[Any]:
    """Shapely geometries in bulk by type; through files if options require it."""
    import shapely

    if asked is not None:
        return through_files(geometries, asked, crs, run)
    done = geometries.copy()
    kinds = shapely.get_type_id(geometries)
    kind_of = shapely.GeometryType
    line_kinds = (kind_of.LINESTRING, kind_of.MULTILINESTRING)
    for kind in (*line_kinds, kind_of.LINEARRING, kind_of.POLYGON, kind_of.MULTIPOLYGON):
        for has_z in (False, True):
            places = np.flatnonzero((kinds == kind) & (shapely.has_z(geometries) == has_z))
            if len(places) == 0:
                continue
            some = geometries[places]
            if kind == kind_of.LINEARRING:
                some = shapely.polygons(some)
            found, coordinates, offsets = shapely.to_ragged_array(some, include_z=has_z)
            wide = coordinates if metric == "space" else coordinates[:, :2]
            wide = np.require(wide, "f8", ("C", "A"))
            begins = np.require(offsets[0], "i8", ("C", "A"))
            rings = kind not in line_kinds
            left, ends = _terrane.simplify_places(wide, begins, tolerance, method, rings, run)
            coordinates = coordinates[left]
            some = shapely.from_ragged_array(found, coordinates, (ends, *offsets[1:]))
            done[places] = shapely.get_exterior_ring(some) if kind == kind_of.LINEARRING else some
    for place in np.flatnonzero(kinds == kind_of.GEOMETRYCOLLECTION):
        parts = shapely.get_parts(geometries[place])
        parts = of_geometries(parts, tolerance, method, None, metric, crs, run)
        done[place] = shapely.geometrycollections(parts)
    return done


def goal_of(tolerance: float | None, method: str, metric: str) -> dict[str, Any]:
    """Goal options for a file of lines: a tolerance is an area for methods that use areas."""
    goal = "area" if method.endswith("visvalingam") else "tolerance"
    in_metres = metric == "metres" and goal == "tolerance" and tolerance is not None
    return {
        goal: f"{tolerance!r}m" if in_metres else tolerance,
        "method": method,
        "metric": "3d" if metric == "space" else "plane",
    }


def through_files(
    geometries: NDArray[Any], asked: dict[str, Any], crs: Any, run: Any
) -> NDArray[Any]:
    """Geometries simplified together through files; parts of collections are separate features."""
    import shapely

    kind_of = shapely.GeometryType
    kinds = shapely.get_type_id(geometries)
    done = geometries.copy()
    nested = np.flatnonzero(kinds == kind_of.GEOMETRYCOLLECTION)
    if len(nested) > 0:
        parts, owners = shapely.get_parts(geometries[nested], return_index=True)
        flat = np.concatenate([np.delete(geometries, nested), parts])
        flat = through_files(flat, asked, crs, run)
        alone, parts = np.split(flat, [len(geometries) - len(nested)])
        done[np.setdiff1d(np.arange(len(done)), nested)] = alone
        for number, place in enumerate(nested):
            done[place] = shapely.geometrycollections(parts[owners == number])
        return done
    groups, order = [], []
    solid = ~shapely.is_empty(geometries)
    for name in ("LineString", "MultiLineString", "Polygon", "MultiPolygon", "LinearRing"):
        for has_z in (False, True):
            kind = getattr(kind_of, name.upper())
            wanted = solid & (kinds == kind) & (shapely.has_z(geometries) == has_z)
            places = np.flatnonzero(wanted)
            if len(places) == 0:
                continue
            some = geometries[places]
            if kind == kind_of.LINEARRING:
                some, name = shapely.polygons(some), "Polygon"
            found, positions, offsets = shapely.to_ragged_array(some, include_z=has_z)
            if found != kind and kind != kind_of.LINEARRING:
                raise usage(f"{name}s differ in kind")
            levels = [np.require(level, "i8", ("C", "A")) for level in offsets]
            groups.append((name, np.require(positions, "f8", ("C", "A")), levels))
            order.append(places)
    if not groups:
        return done
    with tempfile.TemporaryDirectory(prefix="terrane-") as folder:
        before, after = (os.path.join(folder, name) for name in ("before.wkt", "after.wkt"))
        _terrane.write_geometries(before, groups, crs_text(crs))
        machine = {key: run[key] for key in ("threads", "memory")}
        _terrane.run_operation("simplify", before, after, {**asked, **machine}, run)
        with open(after) as file:
            found = shapely.from_wkt([line.rstrip("\n") for line in file if line.strip()])
    places = np.concatenate(order)
    if len(found) != len(places):
        raise usage(
            f"{len(places) - len(found)} geometries are empty after simplification",
            "lower the tolerance",
        )
    rings = kinds[places] == kind_of.LINEARRING
    found[rings] = shapely.get_exterior_ring(found[rings])
    done[places] = found
    return done
