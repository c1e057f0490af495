"""Whatever a grid comes in, it is the same grid."""

from __future__ import annotations

import tracemalloc
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rioxarray  # noqa: F401 (gives DataArrays their accessor)
import terrane
import xarray
from numpy.typing import NDArray
from rasterio.io import MemoryFile
from rasterio.transform import Affine

# Turned, and not square: every number of it matters.
TURNED = Affine(3.0, 0.5, 5e5, 0.25, -2.0, 4e6)
UPRIGHT = Affine(3.0, 0.0, 5e5, 0.0, -2.0, 4e6)


def same(one: terrane.Mesh, other: terrane.Mesh) -> bool:
    """Whether two meshes are the same to the last bit."""
    return np.array_equal(one.vertices, other.vertices) and np.array_equal(
        one.triangles, other.triangles
    )


def tiff(path: Path, array: NDArray[Any], transform: Affine = TURNED, **more: Any) -> str:
    """A GeoTIFF as rasterio writes it."""
    profile = {
        "driver": "GTiff",
        "height": array.shape[0],
        "width": array.shape[1],
        "count": 1,
        "dtype": array.dtype.name,
        "transform": transform,
        "crs": "EPSG:32631",
    }
    with rasterio.open(path, "w", **{**profile, **more}) as dataset:
        dataset.write(array, 1)
    return str(path)


TYPES = ["f2", "f4", "f8", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "g"]


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("order", ["<", ">"])
def test_every_type_and_byte_order(heights: NDArray[np.float32], dtype: str, order: str) -> None:
    kind = np.dtype(order + dtype)
    if kind.kind == "u":
        array = (heights - heights.min()).clip(0, 250).astype(kind)
    else:
        array = (heights / 4).round().clip(-120, 120).astype(kind)
    made = terrane.tin(array, max_error=3.0)
    assert same(made, terrane.tin(array.astype("f8"), max_error=3.0))
    assert terrane.verify(made, array).ok


LAYOUTS = {
    "fortran": np.asfortranarray,
    "every second": lambda a: np.repeat(np.repeat(a, 2, 0), 2, 1)[::2, ::2],
    "backwards": lambda a: a[::-1, ::-1].copy()[::-1, ::-1],
    "transposed": lambda a: a.T.copy().T,
    "within": lambda a: np.pad(a, 5)[5:-5, 5:-5],
    "unaligned": lambda a: (
        np.frombuffer(b"x" + a.tobytes(), dtype="u1")[1:].view(a.dtype).reshape(a.shape)
    ),
    "list": lambda a: a.tolist(),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout(heights: NDArray[np.float32], layout: str) -> None:
    assert same(
        terrane.tin(LAYOUTS[layout](heights), max_error=5.0), terrane.tin(heights, max_error=5.0)
    )


def test_masks_nan_and_nodata_are_voids(heights: NDArray[np.float32]) -> None:
    holes = np.zeros(heights.shape, bool)
    holes[30:50, 60:90] = True
    void = np.where(holes, np.float32(np.nan), heights)
    expected = terrane.tin(void, max_error=5.0)
    assert not same(expected, terrane.tin(heights, max_error=5.0))
    assert same(expected, terrane.tin(np.ma.masked_array(heights, holes), max_error=5.0))
    filled = np.where(holes, np.float32(-9999), heights)
    assert same(expected, terrane.tin(filled, max_error=5.0, nodata=-9999))
    half = holes & (np.arange(heights.shape[0]) < 40)[:, None]
    both = np.ma.masked_array(filled, half)
    assert same(expected, terrane.tin(both, max_error=5.0, nodata=-9999))
    whole = np.ma.masked_array(heights.round().astype("i4"), holes)
    assert same(
        terrane.tin(whole, max_error=5.0),
        terrane.tin(np.where(holes, np.nan, heights.round()), max_error=5.0),
    )


def test_files_and_datasets(tmp_path: Path, heights: NDArray[np.float32]) -> None:
    path = tiff(tmp_path / "dem.tif", heights)
    expected = terrane.tin(heights, max_error=5.0, transform=TURNED, crs="EPSG:32631")
    assert expected.crs == "EPSG:32631"
    # The first sample is in the middle of the first cell.
    first = expected.vertices[np.lexsort(expected.vertices.T[:2])]
    corner = np.array([TURNED @ (0.5, 0.5), TURNED @ (149.5, 0.5)])
    for place in corner:
        assert (np.abs(first[:, :2] - place).max(axis=1) < 1e-9).any()
    assert same(expected, terrane.tin(path, max_error=5.0))
    assert same(expected, terrane.tin(Path(path), max_error=5.0))
    assert same(expected, terrane.tin([path], max_error=5.0))
    with rasterio.open(path) as dataset:
        assert same(expected, terrane.tin(dataset, max_error=5.0))
        with MemoryFile(Path(path).read_bytes()) as memory, memory.open() as within:
            made = terrane.tin(within, max_error=5.0)
            assert same(expected, made)
            assert made.crs == "EPSG:32631"


def test_datasets_with_nodata_scale_and_bands(tmp_path: Path, heights: NDArray[np.float32]) -> None:
    whole = heights.round().astype("i2")
    whole[10:20, 10:30] = -1
    path = tmp_path / "dem.tif"
    profile = {"driver": "GTiff", "height": 120, "width": 150, "count": 2, "dtype": "int16"}
    with rasterio.open(path, "w", **profile, transform=UPRIGHT, nodata=-1) as dataset:
        dataset.write(np.full_like(whole, 7), 1)
        dataset.write(whole, 2)
        dataset.scales, dataset.offsets = (1.0, 0.5), (0.0, 10.0)
    voids = np.where(whole == -1, np.nan, whole * 0.5 + 10)
    expected = terrane.tin(voids, max_error=2.0, transform=UPRIGHT)
    assert same(expected, terrane.tin(path, max_error=2.0, band=2))
    with MemoryFile(path.read_bytes()) as memory, memory.open() as within:
        assert same(expected, terrane.tin(within, max_error=2.0, band=2))
        with pytest.raises(terrane.Error, match="out of range"):
            terrane.tin(within, max_error=2.0, band=3)


def test_data_arrays(tmp_path: Path, heights: NDArray[np.float32]) -> None:
    path = tiff(tmp_path / "dem.tif", heights, UPRIGHT)
    expected = terrane.tin(path, max_error=5.0)
    with rioxarray.open_rasterio(path) as opened:
        assert isinstance(opened, xarray.DataArray)
        made = terrane.tin(opened, max_error=5.0)
        assert same(expected, made)
        assert made.crs == "EPSG:32631"
        turned = opened.squeeze().transpose("x", "y")
        assert same(expected, terrane.tin(turned, max_error=5.0))
    y = UPRIGHT.f + UPRIGHT.e * (np.arange(120) + 0.5)
    x = UPRIGHT.c + UPRIGHT.a * (np.arange(150) + 0.5)
    plain = xarray.DataArray(heights, dims=("lat", "lon"), coords={"lat": y, "lon": x})
    assert same(expected, terrane.tin(plain, max_error=5.0))
    uneven = plain.assign_coords(lon=x + np.sin(x))
    with pytest.raises(terrane.Error, match="evenly"):
        terrane.tin(uneven, max_error=5.0)


def test_a_picture_is_no_grid_of_heights_unless_a_band_is_chosen(
    tmp_path: Path, heights: NDArray[np.float32]
) -> None:
    colours = np.stack([(heights - heights.min()).clip(0, 250).astype("u1")] * 3)
    path = tmp_path / "photo.tif"
    profile = {"driver": "GTiff", "height": 120, "width": 150, "count": 3, "dtype": "uint8"}
    with rasterio.open(path, "w", **profile, photometric="RGB", transform=UPRIGHT) as dataset:
        dataset.write(colours)
    expected = terrane.tin(colours[1], max_error=5.0, transform=UPRIGHT)
    with (
        MemoryFile(path.read_bytes()) as memory,
        memory.open() as within,
        rasterio.open(path) as dataset,
    ):
        for src in (within, dataset):
            with pytest.raises(
                terrane.InputError, match="an image with the bands red, green, blue"
            ):
                terrane.tin(src, max_error=5.0)
            assert same(expected, terrane.tin(src, max_error=5.0, band=2))
    with pytest.warns(UserWarning, match="the file has 3 bands; band 1 is read"):
        terrane.tin(path, max_error=5.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert same(expected, terrane.tin(path, max_error=5.0, band=2))


def test_a_dataset_of_xarray_is_its_grid(tmp_path: Path, heights: NDArray[np.float32]) -> None:
    path = tiff(tmp_path / "dem.tif", heights, UPRIGHT)
    expected = terrane.tin(path, max_error=5.0)
    with rioxarray.open_rasterio(path, band_as_variable=True) as opened:
        assert isinstance(opened, xarray.Dataset)
        assert same(expected, terrane.tin(opened, max_error=5.0))
    with rioxarray.open_rasterio(path, masked=True) as opened:
        assert isinstance(opened, xarray.DataArray)
        saved = opened.squeeze(drop=True).rename("dem").to_dataset()
        saved.to_netcdf(tmp_path / "dem.nc")
        for options in ({}, {"decode_coords": "all"}):
            with xarray.open_dataset(tmp_path / "dem.nc", **options) as again:
                assert same(expected, terrane.tin(again, max_error=5.0))
                assert terrane.tin(again, max_error=5.0).crs == "EPSG:32631"
                assert terrane.tin(again["dem"], max_error=5.0).crs == (
                    "EPSG:32631" if options else None
                )


def test_a_grid_without_a_height_is_refused_and_is_not_missing(tmp_path: Path) -> None:
    void = np.full((6, 7), np.nan, "f4")
    path = tiff(tmp_path / "void.tif", void, UPRIGHT)
    lonely = void.copy()
    lonely[2, 3] = 5
    masked = np.ma.masked_all((6, 7), "f4")
    for src, told in (
        (void, "the grid has no valid sample"),
        (masked, "the grid has no valid sample"),
        (np.zeros((6, 7), "i2"), "the grid has no valid sample"),
        (xarray.DataArray(void, dims=("y", "x")), "the grid has no valid sample"),
        (path, "the grid has no valid sample"),
        (lonely, "no cell with four valid samples"),
    ):
        with pytest.raises(terrane.InputError, match=told) as caught:
            terrane.tin(
                src, max_error=1.0, nodata=0 if getattr(src, "dtype", None) == "i2" else None
            )
        assert not isinstance(caught.value, FileNotFoundError)
    for src in ("none.tif", tmp_path / "none" / "dem.tif", str(tmp_path / "none*.tif"), ["a.tif"]):
        with pytest.raises(FileNotFoundError):
            terrane.tin(src, max_error=1.0)
    with pytest.raises(FileNotFoundError):
        terrane.tin(path, max_error=1.0, clip="none.shp")


def test_overviews_of_files_are_what_they_are(tmp_path: Path, heights: NDArray[np.float32]) -> None:
    path = tiff(tmp_path / "dem.tif", np.tile(heights, (4, 4)))
    with rasterio.open(path, "r+") as dataset:
        dataset.build_overviews([2], rasterio.enums.Resampling.nearest)
    with rasterio.open(path, overview_level=0) as half:
        made = terrane.tin(half, max_error=5.0)
        expected = terrane.tin(half.read(1), max_error=5.0, transform=half.transform)
    assert same(made, expected)
    assert not same(made, terrane.tin(path, max_error=5.0))


def test_scales_that_are_not_applied_are_refused(heights: NDArray[np.float32]) -> None:
    array = xarray.DataArray(heights, dims=("y", "x"), attrs={"scale_factor": 1.0})
    assert same(terrane.tin(array, max_error=5.0), terrane.tin(heights, max_error=5.0))
    for name in ("scale_factor", "add_offset"):
        with pytest.raises(ValueError, match=name):
            terrane.tin(array.assign_attrs({name: 0.5}), max_error=5.0)


def test_nodata_of_data_arrays(heights: NDArray[np.float32]) -> None:
    whole = heights.round().astype("i2")
    whole[10:20, 10:30] = -1
    array = xarray.DataArray(whole, dims=("y", "x")).rio.write_nodata(-1)
    voids = np.where(whole == -1, np.nan, whole)
    assert same(terrane.tin(voids, max_error=5.0), terrane.tin(array, max_error=5.0))


def test_reference_systems(heights: NDArray[np.float32]) -> None:
    from pyproj import CRS

    for crs in ("EPSG:2056", 2056, CRS(2056), rasterio.CRS.from_epsg(2056), CRS(2056).to_wkt()):
        made = terrane.tin(heights, max_error=20.0, crs=crs)
        assert CRS(made.crs) == CRS(2056) or CRS(made.crs).to_epsg() == 2056
    with pytest.raises(ValueError, match="is not a CRS"):
        terrane.tin(heights, max_error=20.0, crs="somewhere")


REFUSED: list[tuple[Any, dict[str, Any], str]] = [
    (np.zeros((0, 5)), {}, "is empty"),
    (np.zeros(5), {}, "not a grid"),
    (np.zeros((2, 5, 5)), {}, "not a grid"),
    (np.float64(1), {}, "not a grid"),
    (np.zeros((5, 5), bool), {}, "holds no heights"),
    (np.zeros((5, 5), complex), {}, "holds no heights"),
    (np.array([["a"]]), {}, "holds no heights"),
    (np.full((5, 5), 2**60), {}, "2\\^53"),
    (np.full((5, 5), np.nan), {}, "."),
    (np.zeros((1, 5)), {}, "."),
    (np.broadcast_to(np.zeros(()), (2, 2**31)), {}, "."),
    (np.zeros((5, 5)), {"max_error": None}, "no target given"),
    (np.zeros((5, 5)), {"max_error": -1.0}, "."),
    (np.zeros((5, 5)), {"max_error": np.nan}, "."),
    (np.zeros((5, 5)), {"max_vertices": 10}, "cannot be used with"),
    (np.zeros((5, 5)), {"bound": "some"}, "some"),
    (np.zeros((5, 5)), {"tile": 3}, "tile"),
    (np.zeros((5, 5)), {"min_angle": 40.0}, "angle"),
    (np.zeros((5, 5)), {"memory": "much"}, "memory"),
    (np.zeros((5, 5)), {"band": 2}, "band 2"),
    (np.zeros((5, 5)), {"transform": (1, 2, 3)}, "transform"),
    (np.zeros((5, 5)), {"transform": (0, 0, 3, 0, 0, 3)}, "transform"),
    (np.zeros((5, 5)), {"transform": (np.nan, 0, 3, 0, 1, 3)}, "transform"),
    ("synth:rough,size=65", {"transform": TURNED}, "not supported for files"),
    ("synth:rough,size=65", {"crs": 4326}, "not supported for files"),
    ("synth:none", {}, "."),
    ([], {}, "not a grid"),
    (object(), {}, "not a grid"),
]


@pytest.mark.parametrize(("src", "options", "told"), REFUSED)
def test_what_is_no_grid_or_option_is_refused(src: Any, options: dict[str, Any], told: str) -> None:
    with pytest.raises(terrane.Error, match=told) as caught:
        terrane.tin(src, **{"max_error": 1.0, **options})
    assert caught.value.kind in {"usage", "bad_input", "limit", "resource"}


def test_copies() -> None:
    """None of an array that is read as it is; one of another."""
    count = 2000
    plain = np.zeros((count, count), "f4")
    for array, copies in [(plain, 0), (plain[:, ::-1], 1), (plain.astype(">f4"), 1)]:
        tracemalloc.start()
        terrane.tin(array, max_error=1.0)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert copies * plain.nbytes <= peak < (copies + 0.1) * plain.nbytes


def test_files_that_differ_are_merged(tmp_path: Path) -> None:
    """Files on two lattices, the later one on top, as a list and as a pattern."""
    coarse, fine = np.full((20, 30), 100.0, "f4"), np.full((8, 6), 200.0, "f4")
    fine[2, 3] = -9999
    tiff(tmp_path / "a.tif", coarse, UPRIGHT, crs="EPSG:32631")
    place = Affine(1.5, 0.0, 5e5 + 30, 0.0, -1.5, 4e6 - 9)
    tiff(tmp_path / "b.tif", fine, place, crs="EPSG:32631", nodata=-9999)
    names = [tmp_path / "a.tif", tmp_path / "b.tif"]
    with pytest.raises(terrane.InputError, match="cell size is 1.5"):
        terrane.convert(names, tmp_path / "o.tif")
    report = terrane.convert(names, tmp_path / "o.tif", resampling="near", nodata=-9999)
    assert "2 grids of the files" in str(report["notes"])
    terrane.convert(str(tmp_path / "[ab].tif"), tmp_path / "p.tif", resampling="near")
    with rasterio.open(tmp_path / "o.tif") as one, rasterio.open(tmp_path / "p.tif") as other:
        heights = one.read(1)
        assert np.array_equal(heights, other.read(1))
        row, column = one.index(place.c + 0.75, place.f - 0.75)
        expected = np.where(fine == -9999, 100, fine)
        assert one.transform.a == 1.5
        assert np.array_equal(heights[row : row + 8, column : column + 6], expected)
        assert (heights == 200).sum() == 47
