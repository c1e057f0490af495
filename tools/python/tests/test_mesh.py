"""Meshes in memory: their arrays, heights, files and friends."""

from __future__ import annotations

import copy
import gc
import pickle
import warnings
from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista
import rasterio
import terrane
import trimesh
import xarray
from matplotlib import pyplot
from matplotlib.tri import LinearTriInterpolator, Triangulation
from numpy.typing import NDArray
from rasterio.transform import Affine


@pytest.fixture(scope="module")
def mesh(heights: NDArray[np.float32]) -> terrane.Mesh:
    holes = np.where(np.hypot(*np.mgrid[-60:60, -75:75]) < 15, np.nan, heights)
    transform = Affine(2.0, 0.0, 5e5, 0.0, -2.0, 4e6)
    return terrane.tin(holes, max_error=5.0, transform=transform, crs="EPSG:32631")


def test_arrays_are_the_meshs_own_memory(mesh: terrane.Mesh) -> None:
    for name, dtype in [("vertices", "f8"), ("triangles", "u4")]:
        one, other = getattr(mesh, name), getattr(mesh, name)
        assert one.dtype == dtype
        assert one.shape[1] == 3
        assert np.shares_memory(one, other)
        with pytest.raises(ValueError, match="read-only"):
            one[0, 0] = 1
        with pytest.raises(ValueError, match="WRITEABLE"):
            one.setflags(write=True)


def test_arrays_outlive_the_mesh(heights: NDArray[np.float32]) -> None:
    mesh = terrane.tin(heights, max_error=5.0)
    vertices, before = mesh.vertices, mesh.vertices.copy()
    del mesh
    gc.collect()
    assert np.array_equal(vertices, before)


def test_triangles_are_sound(mesh: terrane.Mesh) -> None:
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    (ux, uy), (vx, vy) = (b - a).T[:2], (c - a).T[:2]
    assert (ux * vy - uy * vx > 0).all()
    assert len(np.unique(mesh.triangles)) == len(mesh.vertices)


def test_the_error_is_what_it_is(heights: NDArray[np.float32]) -> None:
    mesh = terrane.tin(heights, max_error=5.0)
    rows, cols = np.indices(heights.shape)
    off = np.abs(mesh.interpolate(cols, -rows) - heights)
    assert off.max() == pytest.approx(mesh.error, rel=1e-6)
    assert np.sqrt((off**2).mean()) == pytest.approx(mesh.rmse)
    assert mesh.error <= mesh.tolerance == 5.0


def test_heights_are_those_of_another_program(mesh: terrane.Mesh) -> None:
    west, south, east, north = mesh.bounds
    x, y = (
        np.random.default_rng(3).uniform((west - 5, south - 5), (east + 5, north + 5), (4000, 2)).T
    )
    plan = Triangulation(mesh.vertices[:, 0], mesh.vertices[:, 1], mesh.triangles)
    other = LinearTriInterpolator(plan, mesh.vertices[:, 2])(x, y).filled(np.nan)
    ours = mesh.interpolate(x, y)
    assert 100 < np.isnan(ours).sum() < 1000
    np.testing.assert_allclose(ours, other, atol=1e-6)
    at = mesh.vertices
    assert np.array_equal(mesh.interpolate(at[:, 0], at[:, 1]), at[:, 2])


def test_shapes_of_places_fit_together(mesh: terrane.Mesh) -> None:
    x, y = mesh.vertices[0, :2]
    assert mesh.interpolate(x, y).shape == ()
    assert mesh.interpolate(np.full((3, 1), x), np.full(4, y)).shape == (3, 4)
    assert mesh.interpolate([], []).shape == (0,)
    with pytest.raises(ValueError, match="broadcast"):
        mesh.interpolate(np.zeros(3), np.zeros(4))


def test_samples_lie_in_the_middle_of_cells(tmp_path: Path, heights: NDArray[np.float32]) -> None:
    transform = Affine(3.0, 0.5, 5e5, 0.25, -2.0, 4e6)
    mesh = terrane.tin(heights, max_error=0.0, transform=transform)
    profile = {"driver": "GTiff", "width": 150, "height": 120, "count": 1, "dtype": "float32"}
    path = tmp_path / "like.tif"
    with rasterio.open(path, "w", **profile, transform=transform) as dataset:
        dataset.write(heights, 1)
    with rasterio.open(path) as dataset:
        sampled = mesh.sample_like(dataset)
    inner = np.s_[1:-1, 1:-1]
    np.testing.assert_allclose(sampled[inner], heights[inner], atol=1e-3)
    assert np.array_equal(sampled, mesh.sample_like((heights.shape, transform)), equal_nan=True)


def test_samples_like_a_grid_that_lies_nowhere(
    tmp_path: Path, heights: NDArray[np.float32]
) -> None:
    mesh = terrane.tin(heights, max_error=0.0)
    profile = {"driver": "GTiff", "width": 150, "height": 120, "count": 1, "dtype": "float32"}
    path = tmp_path / "like.tif"
    with pytest.warns(rasterio.errors.NotGeoreferencedWarning):
        with rasterio.open(path, "w", **profile) as dataset:
            dataset.write(heights, 1)
        with rasterio.open(path) as dataset:
            sampled = [terrane.tin(dataset, max_error=0.0).sample_like(dataset)]
        with rasterio.MemoryFile(path.read_bytes()) as memory, memory.open() as dataset:
            sampled.append(terrane.tin(dataset, max_error=0.0).sample_like(dataset))
    plain = xarray.DataArray(heights, dims=("y", "x"))
    likes = [
        plain,
        plain.transpose("x", "y"),
        plain.to_dataset(name="dem"),
        heights,
        (heights.shape, None),
    ]
    for found in (*sampled, *(mesh.sample_like(like) for like in likes)):
        np.testing.assert_allclose(found, heights, atol=1e-3)
    for wrong in (heights[0], 5, "like.tif", (3, 4)):
        with pytest.raises(terrane.InputError, match="is not a grid|is not a transform"):
            mesh.sample_like(wrong)


@pytest.mark.parametrize("ending", ["stl", "glb", "3mf"])
@pytest.mark.parametrize("crs", [None, "EPSG:32631", "EPSG:4326"])
def test_formats_of_single_precision_hold_heights_of_any_type(
    tmp_path: Path, heights: NDArray[np.float32], ending: str, crs: str | None
) -> None:
    """As `write_tin` does, but that heights are rounded once the mesh is made: the file states what holds of it."""
    place = (1e-3, 0, 7, 0, -1e-3, 46) if crs == "EPSG:4326" else None
    rng = np.random.default_rng(5)
    for number, array in enumerate(
        (
            heights.astype("f8") + rng.uniform(0, 1e-3, heights.shape),
            heights.astype("f8") + 5e6 + rng.uniform(0, 1e-3, heights.shape),
            heights.round().astype("i8"),
            heights.astype("f8"),
        )
    ):
        options = {"crs": crs, "transform": place}
        mesh = terrane.tin(array, max_error=5.0, **options)  # type: ignore[arg-type]
        path = tmp_path / f"{number}.{ending}"
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            mesh.write(path)
        is_exact = number >= 2
        report = terrane.verify(path, array, **options)  # type: ignore[arg-type]
        assert report.ok, report
        stated = report.as_dict()["allowed"] if "allowed" in report.as_dict() else None
        assert stated is None or stated == 5.0 or (not is_exact and 5.0 < stated < 5.5)
        assert all("32 bits" in str(warning.message) for warning in told)
        assert not (is_exact and crs != "EPSG:4326" and told)
        terrane.write_tin(array, tmp_path / f"{number}-w.{ending}", 5.0, **options)  # type: ignore[arg-type]
        assert terrane.verify(tmp_path / f"{number}-w.{ending}", array, **options).ok  # type: ignore[arg-type]


@pytest.mark.parametrize("ending", ["ply", "obj", "stl", "glb", "3mf"])
def test_files(tmp_path: Path, heights: NDArray[np.float32], ending: str) -> None:
    mesh = terrane.tin(heights, max_error=5.0, crs="EPSG:32631")
    path = tmp_path / f"mesh.{ending}"
    assert mesh.write(path) == path.stat().st_size
    assert terrane.verify(path, heights, max_error=5.0, crs="EPSG:32631").ok
    assert terrane.verify(path, heights, max_error=5.0).not_judged
    before = path.read_bytes()
    with pytest.raises(OSError, match="exists") as caught:
        mesh.write(path)
    assert isinstance(caught.value, FileExistsError)
    assert isinstance(caught.value, terrane.OutputError)
    assert mesh.write(path, overwrite=True) == len(before)
    assert path.read_bytes() == before
    with pytest.raises(ValueError, match="matches no mesh format"):
        mesh.write(tmp_path / "mesh.xyz")


def test_other_packages_take_it(mesh: terrane.Mesh) -> None:
    other = mesh.to_trimesh()
    assert isinstance(other, trimesh.Trimesh)
    assert np.array_equal(other.vertices, mesh.vertices)
    assert np.array_equal(other.faces, mesh.triangles)
    surface = mesh.to_pyvista()
    assert isinstance(surface, pyvista.PolyData)
    assert surface.n_cells == len(mesh.triangles)
    assert np.array_equal(surface.regular_faces, mesh.triangles)
    same = mesh.to_meshio()
    assert isinstance(same, meshio.Mesh)
    assert np.array_equal(same.cells_dict["triangle"], mesh.triangles)
    figure, ax = pyplot.subplots()
    assert mesh.plot(ax) is ax
    pyplot.close(figure)


def test_pickles_and_copies(tmp_path: Path, mesh: terrane.Mesh) -> None:
    for other in (pickle.loads(pickle.dumps(mesh)), copy.deepcopy(mesh)):
        assert np.array_equal(other.vertices, mesh.vertices)
        assert np.array_equal(other.triangles, mesh.triangles)
        assert (other.error, other.rmse, other.tolerance) == (mesh.error, mesh.rmse, mesh.tolerance)
        assert (other.crs, other.shortfall) == (mesh.crs, mesh.shortfall)
        mesh.write(tmp_path / "one.ply", overwrite=True)
        other.write(tmp_path / "other.ply", overwrite=True)
        assert (tmp_path / "one.ply").read_bytes() == (tmp_path / "other.ply").read_bytes()


def test_a_pickle_of_something_else_is_refused(mesh: terrane.Mesh) -> None:
    make, (vertices, triangles, state) = mesh.__reduce__()  # type: ignore[misc]
    with pytest.raises(ValueError, match="not the index of a vertex"):
        make(vertices[:-1], triangles, state)


def test_it_shows_itself(mesh: terrane.Mesh) -> None:
    assert f"{len(mesh.vertices):,} vertices" in repr(mesh)
    assert "data:image/png;base64,iVBOR" in mesh._repr_html_()


def test_the_same_whatever_the_threads(heights: NDArray[np.float32]) -> None:
    meshes = [
        terrane.tin(heights, max_error=2.0, tile=32, threads=threads, memory=memory)
        for threads, memory in [(1, None), (2, "64M"), (5, 1 << 30)]
    ]
    for mesh in meshes[1:]:
        assert np.array_equal(mesh.vertices, meshes[0].vertices)
        assert np.array_equal(mesh.triangles, meshes[0].triangles)


def test_a_number_of_vertices_is_reached_alike_whatever_the_threads(
    heights: NDArray[np.float32],
) -> None:
    for tile in (512, 32):
        meshes = [
            terrane.tin(heights, max_vertices=900, tile=tile, threads=threads)
            for threads in (1, 2, 5)
        ]
        for mesh in meshes[1:]:
            assert mesh.tolerance == meshes[0].tolerance
            assert np.array_equal(mesh.vertices, meshes[0].vertices)


OPTIONS = [
    {"bound": "surface"},
    {"strict": True},
    {"drop": False},
    {"fit_heights": True},
    {"triangulation": "data-dependent"},
    {"min_angle": 20.0},
    {"tile": 16},
]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_options_are_obeyed_and_proved(
    heights: NDArray[np.float32], options: dict[str, object]
) -> None:
    plain = terrane.tin(heights, max_error=5.0)
    mesh = terrane.tin(heights, max_error=5.0, **options)  # type: ignore[arg-type]
    assert len(mesh.vertices) != len(plain.vertices)
    report = terrane.verify(mesh, heights)
    assert report.ok, report
    assert (report.as_dict()["bound"] == "surface") == ("bound" in options)


def test_goals_by_number(heights: NDArray[np.float32]) -> None:
    assert len(terrane.tin(heights, max_vertices=500).vertices) <= 500
    assert len(terrane.tin(heights, max_triangles=500).triangles) <= 500


def test_files_beside_a_grid_are_obeyed(tmp_path: Path, heights: NDArray[np.float32]) -> None:
    for name, text in [
        ("area", "POLYGON ((10 -10, 100 -10, 100 -100, 10 -100))"),
        ("lake", "POLYGON ((50 -50, 70 -50, 70 -70, 50 -70))"),
        ("road", "LINESTRING (5 -5, 140 -110)"),
        ("peaks", "MULTIPOINT ((33 -44), (77 -88))"),
    ]:
        (tmp_path / f"{name}.wkt").write_text(text)
    clipped = terrane.tin(heights, max_error=5.0, clip=tmp_path / "area.wkt")
    assert clipped.bounds == (10.0, -100.0, 100.0, -10.0)
    level = terrane.tin(heights, max_error=0.5, water=tmp_path / "lake.wkt")
    lake = level.interpolate(*np.mgrid[52:69, -68:-51])
    assert np.ptp(lake) == 0
    kept = {"breaklines": tmp_path / "road.wkt", "keep_points": tmp_path / "peaks.wkt"}
    mesh = terrane.tin(heights, max_error=30.0, **kept)
    assert mesh.shortfall is None
    for peak in ((33, -44), (77, -88)):
        assert (mesh.vertices[:, :2] == peak).all(axis=1).any()
    report = terrane.verify(mesh, heights, **kept)
    assert report.ok, report
    assert terrane.verify(mesh, heights).not_judged


def test_proofs_fail_where_a_mesh_is_wrong(heights: NDArray[np.float32], tmp_path: Path) -> None:
    mesh = terrane.tin(heights, max_error=5.0)
    report = terrane.verify(mesh, heights + np.float32(20))
    assert not report and not report.ok
    assert report.failures
    assert report.max_error is not None and report.max_error > 5
    assert not terrane.verify(mesh, heights, max_error=1.0).ok
    assert terrane.verify(mesh, heights, bound="surface").ok is False
    path = tmp_path / "mesh.ply"
    told = terrane.write_tin(heights, path, 5.0)
    assert told["vertices"] == len(mesh.vertices)
    assert terrane.verify(path, heights).as_dict()["passed"]
    with pytest.raises(terrane.Error, match="not a path of a mesh"):
        terrane.verify(5, heights)  # type: ignore[arg-type]


def test_errors_about_a_mesh_in_memory_name_no_temporary_file() -> None:
    mesh = terrane.tin("synth:rough,size=100", max_error=5.0)
    with pytest.raises(terrane.Error) as refused:
        terrane.verify(mesh, "synth:rough,size=100", bands=[1, 2])
    assert "terrane-" not in str(refused.value)
    assert "terrane-" not in (refused.value.file or "")
