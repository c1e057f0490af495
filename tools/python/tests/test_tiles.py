"""Tiles of the globe, and outputs in another reference system."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import terrane
from numpy.typing import NDArray
from rasterio.transform import Affine

PLACE = Affine(1 / 1200, 0.0, 7.2, 0.0, -1 / 1200, 46.4)


def files(folder: Path) -> dict[str, bytes]:
    """Tiles and subtrees in a folder, by name; what describes the set names what it is made from."""
    found = (path for path in folder.rglob("*.[tgs]*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in found}


def geoid(folder: Path, height: float) -> Path:
    """A geoid of one height around the data, as GeoTIFF."""
    path = folder / "geoid.tif"
    profile: dict[str, Any] = {
        "driver": "GTiff",
        "width": 5,
        "height": 5,
        "count": 1,
        "dtype": "float32",
        "crs": "EPSG:4326",
        "transform": Affine(0.5, 0.0, 5.75, 0.0, -0.5, 47.25),
    }
    with rasterio.open(path, "w", **profile) as out:
        out.write(np.full((1, 5, 5), height, "f4"))
        out.update_tags(TYPE="VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL")
        out.set_band_unit(1, "metre")
    return path


def written(heights: NDArray[np.float32], path: Path) -> Path:
    """A file of the heights."""
    profile: dict[str, Any] = {
        "driver": "GTiff",
        "dtype": "float32",
        "count": 1,
        "crs": "EPSG:4326",
    }
    rows, columns = heights.shape
    with rasterio.open(path, "w", width=columns, height=rows, transform=PLACE, **profile) as out:
        out.write(heights[None])
    return path


def test_tiles_are_those_of_the_command_line(heights: NDArray[np.float32], tmp_path: Path) -> None:
    dem, sea = written(heights, tmp_path / "dem.tif"), geoid(tmp_path, 48.5)
    made = terrane.tiles(
        heights,
        tmp_path / "py",
        format=["quantized-mesh", "3dtiles"],
        geoid=sea,
        transform=PLACE,
        crs="EPSG:4326",
    )
    assert all(level["error"] <= level["tolerance"] for level in made["levels"])
    command = [sys.executable, "-m", "terrane", "tiles", str(dem), str(tmp_path / "cli"), "-q"]
    command += ["--format", "quantized-mesh", "--format", "3dtiles", "--geoid", str(sea)]
    subprocess.run(command, check=True)
    found = files(tmp_path / "py")
    assert len(found) == made["tiles"] + sum(name.endswith(".subtree") for name in found)
    assert found == files(tmp_path / "cli")


def test_options_of_tiles_do_what_they_say(heights: NDArray[np.float32], tmp_path: Path) -> None:
    where: dict[str, Any] = {"transform": PLACE, "crs": "EPSG:4326"}
    usual = terrane.tiles(heights, tmp_path / "a", **where)
    few = terrane.tiles(
        heights, tmp_path / "b", max_level=usual["levels"][-1]["level"] - 2, **where
    )
    assert few["tiles"] < usual["tiles"]
    plain = terrane.tiles(heights, tmp_path / "c", compress=False, normals=False, **where)
    assert plain["tiles"] == usual["tiles"]
    tile = next((tmp_path / "c").rglob("*.terrain"))
    assert tile.read_bytes()[:2] != b"\x1f\x8b"
    packed = terrane.tiles(heights, tmp_path / "d", format="3dtiles", meshopt=True, **where)
    loose = terrane.tiles(heights, tmp_path / "e", format="3dtiles", tile_edges=True, **where)
    assert packed["output_bytes"] < loose["output_bytes"]
    with pytest.raises(terrane.ExistsError):
        terrane.tiles(heights, tmp_path / "a", **where)
    assert (
        terrane.tiles(heights, tmp_path / "a", overwrite=True, **where)["tiles"] == usual["tiles"]
    )
    for options, words in [
        ({"format": "b3dm"}, 'format is "b3dm": expected quantized-mesh or'),
        ({"geoid": tmp_path / "none.tif"}, "none.tif"),
        ({"crs": None}, "lacks a georeference"),
        ({"meshopt": True}, "3D Tiles|3dtiles"),
    ]:
        with pytest.raises(terrane.Error, match=words):
            terrane.tiles(heights, tmp_path / "none", **{**where, **options})
        assert not (tmp_path / "none").exists()


def test_meshes_and_contours_are_brought_to_another_system(
    heights: NDArray[np.float32], tmp_path: Path
) -> None:
    where: dict[str, Any] = {"transform": PLACE, "crs": "EPSG:4326"}
    sea = geoid(tmp_path, 48.5)
    told = terrane.write_tin(
        heights, tmp_path / "m.ply", 5.0, to_crs="EPSG:4979", geoid=sea, **where
    )
    assert told["transformed"]["crs"] == "EPSG:4979 (WGS 84)"
    plain = terrane.tin(heights, 5.0, **where)
    lines = (tmp_path / "m.ply").read_bytes().split(b"end_header\n", 1)[1]
    vertices = np.frombuffer(lines, "<f8", 3 * told["vertices"]).reshape(-1, 3)
    assert np.allclose(vertices - plain.vertices, [0, 0, 48.5], rtol=0, atol=1e-9)
    moved = terrane.contour(heights, 50.0, to_crs="EPSG:32632", **where)
    assert isinstance(moved, terrane.Lines)
    assert moved.crs == "EPSG:32632"
    assert (moved.coordinates[:, 1] > 5e6).all()
    with pytest.raises(terrane.Error, match="geoid requires to_crs"):
        terrane.write_tin(heights, tmp_path / "n.ply", 5.0, geoid=sea, **where)


def test_masks_of_water_are_asked_for_with_the_water(tmp_path: Path) -> None:
    shapely = pytest.importorskip("shapely")
    grid, lake = "synth:rough,size=65,seed=3", shapely.box(500100, 4749700, 500300, 4749900)
    file = tmp_path / "lake.wkt"
    file.write_text(lake.wkt)
    file.with_suffix(".prj").write_text("EPSG:32631")
    how: dict[str, Any] = {"max_level": 12, "water_mask": True}
    for number, water in enumerate((lake, file)):
        terrane.tiles(grid, tmp_path / f"{number}", water=water, **how)
    terrane.plan_tiles(grid, tmp_path / "work", water=file, **how).run(output=tmp_path / "planned")
    assert files(tmp_path / "0") == files(tmp_path / "1") == files(tmp_path / "planned")
    with pytest.raises(terrane.InputError, match="water_mask requires water"):
        terrane.tiles(grid, tmp_path / "none", **how)
