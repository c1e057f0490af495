"""Contours, and lines made simpler."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely
import terrane
from numpy.typing import NDArray
from rasterio.transform import Affine

METHODS = ["cone", "rdp", "imai-iri"]


def wavy(count: int, seed: int = 1) -> NDArray[np.float64]:
    """A line with bends of every size."""
    rng = np.random.default_rng(seed)
    along = np.linspace(0, 1000, count)
    return np.column_stack([along, rng.normal(size=count).cumsum()])


def test_contours(tmp_path: Path, heights: NDArray[np.float32]) -> None:
    transform = Affine(2.0, 0.0, 5e5, 0.0, -2.0, 4e6)
    place = {"transform": transform, "crs": "EPSG:32631"}
    lines = terrane.contour(heights, 50.0, **place)
    assert isinstance(lines, terrane.Lines)
    mesh = terrane.tin(heights, max_error=0.0, **place)
    frame = lines.to_geopandas()
    assert frame.crs == "EPSG:32631"
    assert len(frame) == len(lines) > 10
    assert (np.diff(lines.levels) >= 0).all()
    for number in range(len(lines)):
        assert lines.levels[number] % 50 == 0
        assert np.array_equal(shapely.get_coordinates(frame.geometry[number]), lines[number])
        # Lines cross edges of cells where the edges have that height; within cells they may differ.
        off = np.abs(mesh.interpolate(*lines[number].T) - lines.levels[number])
        assert np.nanmax(off) < 1e-2
    assert np.array_equal(lines[-1], lines[len(lines) - 1])
    assert np.array_equal(pickle.loads(pickle.dumps(lines)).coordinates, lines.coordinates)
    with pytest.raises(IndexError):
        lines[len(lines)]
    told = terrane.contour(heights, 50.0, output=tmp_path / "lines.fgb", **place)
    assert isinstance(told, dict)
    assert len(geopandas.read_file(tmp_path / "lines.fgb")) == len(lines)
    with pytest.raises(FileExistsError):
        terrane.contour(heights, 50.0, output=tmp_path / "lines.fgb")
    simpler = terrane.contour(heights, 50.0, tolerance=1.0, **place)
    assert len(simpler.coordinates) < len(lines.coordinates) / 2
    with pytest.raises(ValueError, match="pass interval or levels"):
        terrane.contour(heights)


def test_options_of_files_are_options_of_geometries_where_they_can_be() -> None:
    lines = [shapely.LineString([(0, 0), (50, 1), (100, 0), (150, 30.04)])]
    assert len(terrane.simplify(lines, keep_ratio=0.5)[0].coords) == 2
    rounded = terrane.simplify(lines, 0.5, None, decimals=0)[0]
    assert list(rounded.coords)[-1] == (150, 30)
    for options, words in [
        ({"to_crs": "EPSG:3857"}, "no option 'to_crs'"),
        ({"format": "GeoJSON"}, "no option 'format'"),
        ({"snap": 1.0}, "snap requires topology"),
        ({"decimals": 300}, "decimals is 300: expected a whole number from 0 to 17"),
    ]:
        with pytest.raises(terrane.InputError, match=words):
            terrane.simplify(lines, 1.0, **options)
    with pytest.raises(terrane.InputError, match="metres"):
        terrane.simplify(lines, metric="metres", keep_ratio=0.5)


def near(line: Any, simpler: Any, tolerance: float) -> bool:
    """Whether every vertex of a line is so near to the simpler one."""
    places = shapely.points(shapely.get_coordinates(line))
    return bool((shapely.distance(places, simpler) <= tolerance * (1 + 1e-9)).all())


@pytest.mark.parametrize("method", METHODS)
def test_positions(method: str) -> None:
    line = wavy(3000)
    kept = terrane.simplify(line, 2.0, method)
    assert len(kept) < len(line) / 3
    assert near(shapely.LineString(line), shapely.LineString(kept), 2.0)
    lines = [wavy(count, count) for count in (0, 1, 2, 3, 50, 700)]
    offsets = np.cumsum([0, *map(len, lines)])
    several, ends = terrane.simplify(np.concatenate(lines), 2.0, method, offsets=offsets)
    for number, line in enumerate(lines):
        alone = terrane.simplify(line, 2.0, method)
        assert np.array_equal(several[ends[number] : ends[number + 1]], alone)


@pytest.mark.parametrize("rings", [False, True])
def test_the_same_whatever_the_threads(rings: bool) -> None:
    counts = np.random.default_rng(4).integers(0, 3000, 400)
    offsets = np.cumsum([0, 0, 0, *counts, 0])
    line = wavy(offsets[-1])
    done = [
        terrane.simplify(line, 2.0, offsets=offsets, rings=rings, threads=threads)
        for threads in (1, 2, 7)
    ]
    assert len(done[0][1]) == len(offsets)
    for places, ends in done[1:]:
        assert np.array_equal(places, done[0][0])
        assert np.array_equal(ends, done[0][1])


def test_positions_in_space() -> None:
    line = np.column_stack([wavy(500), np.random.default_rng(2).normal(size=500) * 5])
    kept = terrane.simplify(line, 2.0, metric="space")
    assert kept.shape[1] == 3
    plane = terrane.simplify(line, 2.0)
    assert len(kept) > len(plane)
    assert np.array_equal(plane[:, :2], terrane.simplify(line[:, :2], 2.0))


GEOMETRIES = {
    "line": shapely.LineString(wavy(400)),
    "lines": shapely.MultiLineString([wavy(300), wavy(200, 2) + 5000]),
    "ring": shapely.Point(0, 0).buffer(100, 64).exterior,
    "polygon": shapely.Point(0, 0).buffer(100, 64) - shapely.Point(0, 0).buffer(50, 64),
    "polygons": shapely.MultiPolygon(
        [shapely.Point(x, 0).buffer(100, 64) for x in (0, 500, 1000)]
    ),
    "high line": shapely.LineString(np.column_stack([wavy(400), np.arange(400.0)])),
    "collection": shapely.GeometryCollection(
        [shapely.LineString(wavy(400)), shapely.Point(1, 2), shapely.Point(0, 0).buffer(90, 64)]
    ),
}


@pytest.mark.parametrize("name", GEOMETRIES)
@pytest.mark.parametrize("topology", [False, True])
def test_geometries(name: str, topology: bool) -> None:
    geometry = GEOMETRIES[name]
    simpler = terrane.simplify(geometry, 2.0, topology=topology)
    assert simpler.geom_type == geometry.geom_type
    assert simpler.has_z == geometry.has_z
    count = shapely.get_num_coordinates
    assert count(simpler) < count(geometry) / 2
    assert near(geometry, simpler, 2.0)
    if "polygon" in name:
        assert near(geometry.boundary, simpler.boundary, 2.0)
    places = [shapely.get_coordinates(g, include_z=g.has_z).tolist() for g in (simpler, geometry)]
    assert set(map(tuple, places[0])) <= set(map(tuple, places[1])), "vertices are of the original"


def test_arrays_of_all_kinds_keep_their_order() -> None:
    other = [None, shapely.Point(3, 4), shapely.Polygon(), shapely.LineString(), shapely.MultiPoint([(1, 2)])]
    array = np.array([*GEOMETRIES.values(), *other], dtype=object)
    simpler = terrane.simplify(array, 2.0)
    apart = np.array([shapely.transform(g, lambda xy, n=n: xy + n * 1e4) for n, g in enumerate(array)])
    for one, done in zip(apart, terrane.simplify(apart, 2.0, topology=True), strict=True):
        assert one == done or near(one, done, 2.0)
    assert simpler.shape == array.shape
    for one, done in zip(array, simpler, strict=True):
        if one is None or one.is_empty or one.geom_type.endswith("Point"):
            assert one == done
        else:
            assert done.equals(terrane.simplify(one, 2.0))


def test_borders_stay_shared() -> None:
    edge = np.column_stack([np.linspace(0, 1000, 500), wavy(500)[:, 1]])
    below = shapely.Polygon([*edge, (1000, -500), (0, -500)])
    above = shapely.Polygon([*edge, (1000, 500), (0, 500)])
    frame = geopandas.GeoDataFrame({"name": ["a", "b"]}, geometry=[below, above], crs="EPSG:32631")
    done = terrane.simplify(frame, 5.0, topology=True)
    assert list(done["name"]) == ["a", "b"]
    assert done.crs == frame.crs
    one, other = done.geometry
    assert one.is_valid and other.is_valid
    assert one.intersection(other).area == 0
    shared = {tuple(p) for p in edge}
    ours = [{tuple(p) for p in shapely.get_coordinates(part)} & shared for part in (one, other)]
    assert ours[0] == ours[1]
    assert 2 < len(ours[0]) < 200
    assert len(frame.geometry[0].exterior.coords) == 503, "what was passed is as it was"


def test_metres() -> None:
    line = shapely.LineString([(8.0, 47.0), (8.0005, 47.00001), (8.001, 47.0)])
    series = geopandas.GeoSeries([line], crs="EPSG:4326")
    assert len(terrane.simplify(series, 2.0, metric="metres")[0].coords) == 2
    assert len(terrane.simplify(series, 0.5, metric="metres")[0].coords) == 3
    assert len(terrane.simplify(line, 2.0, metric="metres", crs="EPSG:4326").coords) == 2


def test_arrow() -> None:
    series = geopandas.GeoSeries([GEOMETRIES["line"], shapely.LineString(wavy(500, 4))])
    frame = geopandas.GeoDataFrame({"n": [1, 2]}, geometry=series, crs="EPSG:32631")
    done = terrane.simplify(frame.to_arrow(), 2.0)
    assert isinstance(done, geopandas.GeoDataFrame)
    assert done.geometry.geom_equals(terrane.simplify(frame, 2.0).geometry).all()


@pytest.mark.parametrize(
    ("geometry", "options"),
    [
        (wavy(5), {"method": "none"}),
        (wavy(5), {"metric": "none"}),
        (wavy(5), {"topology": True}),
        (wavy(5), {"crs": 4326}),
        (GEOMETRIES["polygon"], {"rings": True}),
        (GEOMETRIES["high line"], {"metric": "space", "topology": True}),
        (wavy(5), {"offsets": [0, 9]}),
        (wavy(5), {"offsets": [0, 3, 1, 5]}),
        (np.zeros(5), {}),
        (np.zeros((5, 4)), {}),
        ("line", {}),
        (5, {}),
    ],
)
def test_what_is_no_line_is_refused(geometry: Any, options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="."):
        terrane.simplify(geometry, 1.0, **options)
