"""Operations have one table of options, which Python's functions, signatures and stubs are made from."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terrane
from terrane import _operations

GRID = "synth:rough,size=65,seed=3"
STUB = Path(_operations.__file__).with_suffix(".pyi")
NAMES = list(_operations.tables())


def test_the_stub_is_what_the_tables_say() -> None:
    if os.environ.get("TERRANE_STUB") == "renew":
        STUB.write_text(_operations.stub())
    assert STUB.read_text() == _operations.stub(), "renew it with TERRANE_STUB=renew"


@pytest.mark.parametrize("name", NAMES)
def test_every_option_has_a_keyword_and_a_line(name: str) -> None:
    function = getattr(terrane, _operations.called(name))
    keywords = inspect.signature(function).parameters
    for option in _operations.tables()[name]["options"]:
        name = _operations.keyword_of(option)
        assert name in keywords, option
        assert f"\n{name}\n    " in function.__doc__, option
    assert not re.search("--[a-z]|‹", function.__doc__)


def test_the_bytes_are_those_of_the_command_line(tmp_path: Path) -> None:
    options: dict[str, Any] = {
        "slope": {"percent": True, "co": {"COMPRESS": "DEFLATE"}, "format": "GTiff"},
        "hillshade": {"altitude": np.float32(30), "multidirectional": np.bool_(True)},
        "curvature": {"kind": "plan", "bounds": np.array([500050.0, 4749600, 500500, 4749900])},
        "convert": {"dtype": "float64", "band": 1, "threads": np.int64(2), "memory": "64M"},
    }
    words = {
        "slope": ["--percent", "--co", "COMPRESS=DEFLATE", "-f", "GTiff"],
        "hillshade": ["--altitude", "30", "--multidirectional"],
        "curvature": ["--kind", "plan", "--bounds", "500050,4749600,500500,4749900"],
        "convert": ["--type", "float64"],
    }
    grid = tmp_path / "grid.tif"
    terrane.convert(GRID, grid)
    for name, given in options.items():
        report = getattr(terrane, name)(grid, tmp_path / "python.tif", overwrite=True, **given)
        assert report["output_bytes"] == (tmp_path / "python.tif").stat().st_size
        command = [sys.executable, "-m", "terrane", name, str(grid), "shell.tif", "--overwrite"]
        done = subprocess.run([*command, *words[name], "-q"], cwd=tmp_path, check=False)
        assert done.returncode == 0
        assert (tmp_path / "python.tif").read_bytes() == (tmp_path / "shell.tif").read_bytes()


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("slope", {"percnt": True}, "unknown option \"percnt\"; did you mean percent?"),
        ("slope", {"percent": 1}, "percent is 1: expected true or false"),
        ("slope", {"algorithm": "sobel"}, "algorithm is \"sobel\": expected horn or"),
        ("hillshade", {"altitude": True}, "altitude is true: expected a number"),
        ("hillshade", {"altitude": float("nan")}, "altitude is NaN: expected a number from 1"),
        ("hillshade", {"altitude": object()}, "altitude is of type object"),
        ("hillshade", {"azimuth": 1.0, "combined": True, "multidirectional": True}, "cannot be used"),
        ("convert", {"to_crs": "EPSG:4326"}, "to_crs requires resampling; add resampling"),
        ("contour", {"interval": 1.0, "levels": [2.0]}, "interval cannot be used with levels"),
        ("contour", {}, "no contour levels given; pass interval or levels"),
    ],
)
def test_what_is_wrong_is_told_in_words_of_python(
    tmp_path: Path, name: str, options: dict[str, Any], words: str
) -> None:
    where = {"output": tmp_path / "a"} if name == "contour" else {"path": tmp_path / "a.tif"}
    with pytest.raises(terrane.InputError) as error:
        getattr(terrane, name)(GRID, **where, **options)
    assert words in str(error.value)
    assert not list(tmp_path.iterdir())


def test_nothing_that_is_read_is_replaced(tmp_path: Path) -> None:
    def at(name: str) -> Path:
        return tmp_path / name

    for name in ("a.tif", "b.tif"):
        terrane.convert("synth:rough,size=40", at(name))
    square = "POLYGON ((500100 4749900, 500300 4749900, 500300 4749700, 500100 4749900))"
    for name in ("area.wkt", "sides.wkt"):
        at(name).write_text(square if name == "area.wkt" else "POINT (500200 4749800)")
        at(name).with_suffix(".prj").write_text("EPSG:32631")
    at("colors.png").write_text("0 0 0 0\n900 9 9 9\n")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    calls: list[tuple[Any, dict[str, Any]]] = [
        (terrane.slope, {"src": at("a.tif"), "path": at("a.tif")}),
        (terrane.slope, {"src": [at("a.tif"), at("b.tif")], "path": at("b.tif")}),
        (terrane.convert, {"src": at("a.tif"), "path": at("b.tif"), "like": at("b.tif")}
         | {"resampling": "near"}),
        (terrane.color_relief, {"src": at("a.tif"), "path": at("colors.png")}
         | {"colors": at("colors.png")}),
        (terrane.contour, {"src": at("a.tif"), "interval": 9, "clip": at("area.wkt")}
         | {"output": at("area.wkt")}),
        (terrane.simplify_file, {"src": at("area.wkt"), "path": at("area.wkt"), "tolerance": 1}),
        (terrane.simplify_file, {"src": at("area.wkt"), "path": at("sides.wkt"), "tolerance": 1}
         | {"topology": True, "sides": at("sides.wkt")}),
    ]
    for function, given in calls:
        with pytest.raises(terrane.InputError, match="is also an input"):
            function(**given, overwrite=True)
        assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_what_no_option_can_be_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    nested: list[Any] = []
    nested.append(nested)
    missing = str(tmp_path / "missing.tif")
    for options, words in [
        ({"scale": np.ones((40, 40))}, "scale is "),
        ({"scale": nested}, "scale is of type list"),
        ({"scale": "2"}, "scale is"),
        ({"threads": 2**70}, "threads is"),
        ({"Scale": object()}, "did you mean scale"),
        ({"percent": "x"}, "percent is"),
        ({"format": "b\udcff"}, "format is of type str"),
    ]:
        with pytest.raises(terrane.InputError, match=words) as error:
            terrane.slope(missing, tmp_path / "o.tif", **options)
        assert "‹" not in str(error.value) and len(str(error.value)) < 300
    with pytest.raises(terrane.InputError, match="levels is of type list"):
        terrane.contour(missing, levels=nested)
    with pytest.raises(terrane.InputError, match="index is for files"):
        terrane.contour(missing, 5.0, index=5)
    terrane.slope("synth:rough,size=20", tmp_path / "o.tif", threads=1.0, algorithm=None)


def test_arrays_are_taken_as_files_are(tmp_path: Path) -> None:
    heights = np.hypot(*np.mgrid[-20:21, -20:21]).astype("f4")
    terrane.slope(heights, tmp_path / "slope.tif", transform=(1, 0, 0, 0, -1, 0), crs="EPSG:32631")
    with pytest.raises(terrane.InputError, match="takes src, colors, path"):
        terrane.color_relief(heights, tmp_path / "picture.tif")
    (tmp_path / "colors.txt").write_text("0% 0 0 0\n100% 255 255 255\n")
    report = terrane.color_relief(heights, tmp_path / "colors.txt", tmp_path / "picture.png")
    assert report["width"] == 41
    with pytest.raises(terrane.ExistsError):
        terrane.slope(heights, tmp_path / "slope.tif")
