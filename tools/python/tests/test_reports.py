"""Reports on trackers of other projects, by their numbers in the names of tests."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import rasterio
import terrane
import xarray
from lands import rough
from numpy.typing import NDArray
from rasterio.io import MemoryFile
from rasterio.transform import Affine

HEIGHTS = rough(90, 120)
# Steps that no float holds.
X = 500_000.05 + 0.1 * np.arange(120)
Y = 4_100_000.05 - 0.1 * np.arange(90)


def positions(mesh: terrane.Mesh) -> NDArray[np.float64]:
    """Those of a mesh as a set, to a ten-thousandth of a cell."""
    places = np.round(np.asarray(mesh.vertices), [5, 5, 9][0])
    return places[np.lexsort(places.T)]


def is_turned_right(mesh: terrane.Mesh) -> bool:
    """Whether all triangles are counter-clockwise."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    (ux, uy), (vx, vy) = (b - a).T[:2], (c - a).T[:2]
    return bool((ux * vy - uy * vx > 0).all())


# rasterio#1661, corteva/rioxarray#650, torchgeo#3249: arrays whose y goes up, or x goes down, come out mirrored.
@pytest.mark.parametrize("tile", [512, 32])
def test_d8_a_mesh_does_not_depend_on_the_order_of_rows_and_columns(
    tmp_path: Path, tile: int
) -> None:
    north_up = xarray.DataArray(HEIGHTS, dims=("y", "x"), coords={"y": Y, "x": X})
    expected = terrane.tin(north_up, max_error=5.0, tile=tile)
    for down, right in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        turned = north_up[::down, ::right]
        for array in (
            turned,
            turned.transpose("x", "y"),
            turned.copy(data=np.asfortranarray(turned)),
        ):
            made = terrane.tin(array, max_error=5.0, tile=tile)
            assert np.array_equal(positions(made), positions(expected)), (down, right)
            assert is_turned_right(made)
            assert terrane.verify(made, array).ok
        place = Affine(
            0.1 * right, 0, X[::right][0] - 0.05 * right, 0, -0.1 * down, Y[::down][0] + 0.05 * down
        )
        values = HEIGHTS[::down, ::right]
        path = tmp_path / "dem.tif"
        profile = {"driver": "GTiff", "height": 90, "width": 120, "count": 1, "dtype": "float32"}
        with rasterio.open(path, "w", **profile, transform=place) as dataset:
            dataset.write(values, 1)
        with MemoryFile(path.read_bytes()) as memory, memory.open() as within:
            for made in (
                terrane.tin(values, max_error=5.0, tile=tile, transform=place),
                terrane.tin(path, max_error=5.0, tile=tile),
                terrane.tin(within, max_error=5.0, tile=tile),
            ):
                assert np.array_equal(positions(made), positions(expected)), (down, right)
                assert is_turned_right(made)
        terrane.write_tin(path, tmp_path / "m.ply", 5.0, tile=tile, overwrite=True)
        assert terrane.verify(tmp_path / "m.ply", path).ok


# rasterio#1395, corteva/rioxarray#396: of NaN and a value for voids in one array one survives as a height.
def test_d9_nan_and_the_value_for_voids_are_voids_of_their_size() -> None:
    one, other = np.zeros(HEIGHTS.shape, bool), np.zeros(HEIGHTS.shape, bool)
    one[20:30, 40:60], other[50:70, 10:30] = True, True
    void = np.where(one | other, np.nan, HEIGHTS)
    both = np.where(one, np.float32(np.nan), np.where(other, np.float32(-28_672), HEIGHTS))
    expected = terrane.tin(void, max_error=5.0)

    def array(attrs: dict[str, float], encoding: dict[str, object]) -> xarray.DataArray:
        made = xarray.DataArray(both, dims=("y", "x"), attrs=attrs)
        made.encoding.update(encoding)
        return made

    packed = {"_FillValue": -28_672, "scale_factor": 0.01, "dtype": "int16"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for src in (
            array({"_FillValue": -28_672}, {}),
            array({}, {"_FillValue": -28_672.0}),
            array({}, packed),
            array({"missing_value": -28_672}, {"_FillValue": np.nan}),
        ):
            assert np.array_equal(terrane.tin(src, max_error=5.0).vertices, expected.vertices)
    with pytest.warns(UserWarning, match="400 samples are -28672"):
        terrane.tin(array({}, packed), max_error=5.0)
    # A mask here, the value for voids there, and both in a third place.
    masked = np.ma.masked_array(np.where(other, np.float32(-28_672), HEIGHTS), one)
    made = terrane.tin(masked, max_error=5.0, nodata=-28_672)
    assert np.array_equal(made.vertices, expected.vertices)
    assert terrane.verify(made, masked, nodata=-28_672).as_dict()["samples"] is not None


@pytest.mark.parametrize("kind", ["array", "masked", "attribute", "file"])
def test_d9_a_value_for_voids_that_no_sample_can_have_is_told(tmp_path: Path, kind: str) -> None:
    whole = HEIGHTS.round().astype("i2")
    expected = terrane.tin(whole, max_error=5.0)

    def made() -> terrane.Mesh:
        if kind == "attribute":
            return terrane.tin(
                xarray.DataArray(whole, dims=("y", "x"), attrs={"_FillValue": 70_000}),
                max_error=5.0,
            )
        if kind == "masked":
            mask = np.zeros(whole.shape, bool)
            mask[3, 4] = True
            return terrane.tin(np.ma.masked_array(whole, mask), max_error=5.0, nodata=70_000)
        if kind == "file":
            path = tmp_path / "dem.tif"
            with rasterio.open(
                path, "w", driver="GTiff", height=90, width=120, count=1, dtype="int16"
            ) as dataset:
                dataset.write(whole, 1)
            return terrane.tin(path, max_error=5.0, nodata=70_000)
        return terrane.tin(whole, max_error=5.0, nodata=70_000)

    with pytest.warns(
        UserWarning, match="70000 is out of range for int16: no sample is void"
    ) as told:
        mesh = made()
    assert any(warning.filename == __file__ for warning in told)
    if kind != "masked":
        assert np.array_equal(mesh.vertices, expected.vertices)
