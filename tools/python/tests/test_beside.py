"""Geometries in memory, wherever a file of features is taken."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely
import terrane
from lands import rough

HEIGHTS = rough(60, 80)
TRANSFORM = (10.0, 0.0, 500_000.0, 0.0, -10.0, 4_100_000.0)
PLACE: dict[str, Any] = {"transform": TRANSFORM, "crs": "EPSG:32631"}
AREA = shapely.Polygon(
    [(500_100.1, 4_099_900.7), (500_700, 4_099_890), (500_650, 4_099_480), (500_120, 4_099_500)]
)
LAKE = shapely.box(500_300, 4_099_600, 500_420.3, 4_099_700)
ROAD = shapely.LineString([(500_105, 4_099_895), (500_600, 4_099_555)])
PEAKS = shapely.MultiPoint([(500_235, 4_099_715), (500_555, 4_099_645)])
FEATURES = {"clip": AREA, "water": LAKE, "breaklines": ROAD, "keep_points": PEAKS}


def in_file(folder: Path, name: str, geometry: Any) -> Path:
    """The same in a file."""
    path = folder / f"{name}.wkt"
    path.write_text(shapely.to_wkt(geometry, rounding_precision=20) + "\n")
    (folder / f"{name}.prj").write_text("EPSG:32631")
    return path


def frame(geometry: Any) -> geopandas.GeoDataFrame:
    """The same as a frame, with a row that has no geometry."""
    return geopandas.GeoDataFrame({"n": [1, 2]}, geometry=[geometry, None], crs="EPSG:32631")


FORMS = {
    "geometry": lambda geometry: geometry,
    "list": lambda geometry: [geometry],
    "array": lambda geometry: np.array([geometry], dtype=object),
    "series": lambda geometry: frame(geometry).geometry,
    "series without a system": lambda geometry: geopandas.GeoSeries([geometry]),
    "frame": frame,
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", FEATURES)
def test_geometries_are_what_a_file_of_them_is(tmp_path: Path, name: str, form: str) -> None:
    path = in_file(tmp_path, name, FEATURES[name])
    given: dict[str, Any] = {name: FORMS[form](FEATURES[name])}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = terrane.tin(HEIGHTS, max_error=20.0, **PLACE, **given)
    expected = terrane.tin(HEIGHTS, max_error=20.0, **PLACE, **{name: path})
    assert np.array_equal(made.vertices, expected.vertices)
    assert np.array_equal(made.triangles, expected.triangles)
    plain = terrane.tin(HEIGHTS, max_error=20.0, **PLACE)
    assert not np.array_equal(made.vertices, plain.vertices)
    report = terrane.verify(made, HEIGHTS, **PLACE, **given)
    assert report.ok, report


def test_every_function_that_takes_files_takes_geometries(tmp_path: Path) -> None:
    clip, water = {"clip": AREA}, {"water": LAKE}
    told = terrane.write_tin(HEIGHTS, tmp_path / "m.ply", 20.0, **PLACE, **clip, **water)
    assert told["valid_samples"] < HEIGHTS.size / 2
    lines = terrane.contour(HEIGHTS, 20.0, **PLACE, **clip)
    whole = terrane.contour(HEIGHTS, 20.0, **PLACE)
    assert isinstance(lines, terrane.Lines)
    assert isinstance(whole, terrane.Lines)
    assert 0 < len(lines.coordinates) < len(whole.coordinates)
    made = terrane.tiles(HEIGHTS, tmp_path / "tiles", max_level=12, **PLACE, **clip)
    assert made["levels"]
    cloud = "synth:cloud,size=60,density=2,seed=5"
    place = terrane.dtm(cloud, cell=2.0).transform
    lake = shapely.box(place[2] + 10, place[5] - 40, place[2] + 40, place[5] - 10)
    level = terrane.dtm(cloud, cell=2.0, water=lake).data[0]
    assert np.ptp(level[8:17, 8:17]) == 0


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (5, "clip is a int"),
        ({"type": "Polygon"}, "clip is a dict"),
        ([AREA, "b"], "clip holds a str"),
        (shapely.Polygon(), "clip holds no geometry"),
        (frame(AREA).to_crs(4326), "clip: its CRS is"),
        (ROAD, "clip: "),
        (shapely.box(0, 0, 1, 1), "clip: "),
    ],
    ids=str,
)
def test_what_is_no_geometry_or_lies_elsewhere_is_refused_by_name(value: Any, told: str) -> None:
    with pytest.raises(terrane.InputError) as caught:
        terrane.tin(HEIGHTS, max_error=20.0, clip=value, **PLACE)
    assert str(caught.value).startswith(told)
    assert "/" not in str(caught.value).replace("WGS 84 / UTM", "")


def test_a_plan_is_of_files(tmp_path: Path) -> None:
    for name, value in FEATURES.items():
        given: dict[str, Any] = {name: value}
        with pytest.raises(
            terrane.InputError, match=f"{name} is a .* in memory, but a plan requires a file"
        ):
            terrane.plan("synth:rough,size=65", tmp_path / "work", 5.0, **given)
