"""DataArrays and Datasets of xarray are the same grids whether rioxarray happens to be imported or not, and the right ones."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyproj
import pytest
import terrane
import xarray
import xarrays

Found = dict[str, list[str]]


@pytest.fixture(scope="module", params=["without", "rioxarray"])
def made(request: pytest.FixtureRequest) -> Found:
    """What a process makes of all guises of the surface, with or without rioxarray."""
    command = [sys.executable, str(Path(__file__).with_name("xarrays.py")), request.param]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    result: Found = json.loads(done.stdout)
    return result


def of_array(values: np.ndarray) -> str:
    """The digest of the mesh of an array that lies where the surface does."""
    return xarrays.digest(
        terrane.tin(values, max_error=xarrays.TOLERANCE, transform=xarrays.TRANSFORM)
    )


def test_axes_are_those_of_attributes_and_names_in_any_order(made: Found) -> None:
    expected = of_array(xarrays.HEIGHTS)
    wrong = {name: made[name] for name, _ in xarrays.shapes() if made[name][0] != expected}
    assert not wrong


def test_voids_are_what_attributes_and_encodings_say_and_nan(made: Found) -> None:
    expected = of_array(xarrays.VOID)
    wrong = {name: made[name] for name, _ in xarrays.voids() if made[name][0] != expected}
    assert not wrong


def test_systems_are_found_wherever_they_are_told(made: Found) -> None:
    expected = of_array(xarrays.HEIGHTS)
    for name, _ in xarrays.systems():
        shape, crs = made[name]
        assert shape == expected, name
        assert pyproj.CRS(crs).to_epsg(min_confidence=20) == 32631, (name, crs)
    assert pyproj.CRS(made["no code"][1]) == pyproj.CRS(xarrays.LAEA)


def test_what_cannot_be_told_is_refused_by_name(made: Found) -> None:
    for name, _, part in xarrays.refused():
        kind, told = made[name]
        assert kind == "InputError", (name, kind, told)
        assert part in told, (name, told)


def test_dimensions_without_coordinates_are_rows_and_columns() -> None:
    heights = xarrays.HEIGHTS
    expected = terrane.tin(heights, max_error=5.0)
    for dims in (("y", "x"), ("lat", "lon"), ("row", "col"), ("line", "sample"), None):
        plain = xarray.DataArray(heights, dims=dims)
        for turned in (plain, plain.transpose(*reversed(plain.dims))):
            made = terrane.tin(turned, max_error=5.0)
            assert np.array_equal(made.vertices, expected.vertices), dims
            assert made.crs is None
    rows, cols = (np.arange(count) for count in heights.shape)
    counted = xarray.DataArray(heights, dims=("row", "col"), coords={"row": rows, "col": cols})
    assert np.array_equal(terrane.tin(counted, max_error=5.0).vertices, expected.vertices)


def test_a_grid_mapping_that_is_not_there_is_told() -> None:
    with pytest.warns(UserWarning, match="'utm' is not among the coordinates"):
        made = terrane.tin(xarrays.array(attrs={"grid_mapping": "utm"}), max_error=5.0)
    assert made.crs is None


def test_a_system_without_a_code_is_carried(tmp_path: Path) -> None:
    import rasterio
    from rasterio.io import MemoryFile

    crs = pyproj.CRS(xarrays.LAEA)
    profile = {
        "driver": "GTiff",
        "height": xarrays.ROWS,
        "width": xarrays.COLS,
        "count": 1,
        "dtype": "float32",
        "crs": xarrays.LAEA,
        "transform": rasterio.Affine(*xarrays.TRANSFORM),
    }
    path = tmp_path / "dem.tif"
    with rasterio.open(path, "w", **profile) as dataset:
        dataset.write(xarrays.HEIGHTS, 1)

    def carried(src: object) -> None:
        mesh = terrane.tin(src, max_error=5.0)
        assert pyproj.CRS(mesh.crs).is_exact_same(crs) or pyproj.CRS(mesh.crs) == crs
        lines = terrane.contour(src, interval=20.0)
        assert isinstance(lines, terrane.Lines)
        assert lines.to_geopandas().crs == crs

    carried(path)
    carried(xarrays.array(attrs={"crs": xarrays.LAEA}))
    with rasterio.open(path) as dataset:
        carried(dataset)
    with MemoryFile(path.read_bytes()) as memory, memory.open() as dataset:
        carried(dataset)


def test_samples_like_a_dataarray(tmp_path: Path) -> None:
    base = xarrays.array()
    mesh = terrane.tin(base, max_error=0.0)
    for like in (
        base,
        base.isel(y=slice(None, None, -1)),
        base.transpose("x", "y"),
        base.to_dataset(),
    ):
        sampled = mesh.sample_like(like)
        assert np.isfinite(sampled).mean() > 0.9
    np.testing.assert_allclose(mesh.sample_like(base), xarrays.HEIGHTS, atol=1e-3)
    flipped = mesh.sample_like(base.isel(y=slice(None, None, -1)))
    np.testing.assert_allclose(flipped, xarrays.HEIGHTS[::-1], atol=1e-3)
