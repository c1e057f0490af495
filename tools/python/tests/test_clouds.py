"""Points to grids."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pyproj
import pytest
import rasterio
import terrane
from numpy.typing import NDArray


@pytest.fixture(scope="module")
def points() -> NDArray[np.float64]:
    """Points with two decimals, 100 by 60."""
    rng = np.random.default_rng(5)
    return rng.uniform((5e5, 4e6, 100), (5e5 + 99.98, 4e6 + 59.98, 130), (20_000, 3)).round(2)


@pytest.fixture(scope="module")
def las(points: NDArray[np.float64], tmp_path_factory: pytest.TempPathFactory) -> str:
    """The same as a file of LAS, with classes and returns."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 0.01), np.array([5e5, 4e6, 0.0])
    header.add_crs(__import__("pyproj").CRS.from_epsg(32631))
    record = laspy.LasData(header)
    record.x, record.y, record.z = points.T
    number = np.arange(len(points))
    record.classification = number % 4
    record.return_number, record.number_of_returns = 1 + number % 2, np.full(len(points), 2)
    record.withheld = (number % 7 == 0).astype("u1")
    path = tmp_path_factory.mktemp("las") / "points.las"
    record.write(path)
    return str(path)


def cells(points: NDArray[np.float64], keep: NDArray[np.bool_] | None = None) -> Any:
    """The means and counts of 10 by 6 cells, as numpy finds them."""
    points = points if keep is None else points[keep]
    col = ((points[:, 0] - 5e5) // 10).astype(int)
    row = 5 - ((points[:, 1] - 4e6) // 10).astype(int)
    count = np.bincount(row * 10 + col, minlength=60).reshape(6, 10)
    total = np.bincount(row * 10 + col, points[:, 2], minlength=60).reshape(6, 10)
    return total / count, count


def test_arrays(points: NDArray[np.float64]) -> None:
    grid = terrane.grid(points, 10.0, ["mean", "count"], crs=32631, extent=(5e5, 4e6, 500100, 4000060))
    mean, count = cells(points)
    np.testing.assert_allclose(grid["mean"], mean, atol=1e-9)
    assert np.array_equal(grid["count"], count)
    assert grid.transform == (10.0, 0.0, 5e5, 0.0, -10.0, 4e6 + 60)
    assert (grid.crs, grid.names) == ("EPSG:32631", ["mean", "count"])


def test_orders_and_types_of_arrays(points: NDArray[np.float64]) -> None:
    expected = terrane.grid(points, 10.0).data
    for other in (points[::-1], np.asfortranarray(points), points.astype(">f8"), points.tolist()):
        np.testing.assert_array_equal(terrane.grid(other, 10.0).data, expected)


@pytest.mark.parametrize(
    ("options", "keep"),
    [
        ({}, lambda n: n % 7 != 0),
        ({"keep_withheld": True}, lambda n: n >= 0),
        ({"classes": [2]}, lambda n: (n % 7 != 0) & (n % 4 == 2)),
        ({"returns": "first"}, lambda n: (n % 7 != 0) & (n % 2 == 0)),
        ({"returns": 2}, lambda n: (n % 7 != 0) & (n % 2 == 1)),
        (
            {"where": "class in (1, 2) and ReturnNumber < 2"},
            lambda n: (n % 7 != 0) & np.isin(n % 4, (1, 2)) & (n % 2 == 0),
        ),
    ],
    ids=str,
)
def test_records_and_files_are_the_same_points(
    points: NDArray[np.float64], las: str, options: dict[str, Any], keep: Any
) -> None:
    mean, count = cells(points, keep(np.arange(len(points))))
    box = (5e5, 4e6, 500100, 4000060)
    records = laspy.read(las)
    names = ["X", "Y", "Z", "Classification", "ReturnNumber", "NumberOfReturns", "Withheld"]
    pdal = np.zeros(len(points), [(name, "f8" if name in "XYZ" else "u1") for name in names])
    for name, values in zip("XYZ", points.T, strict=True):
        pdal[name] = values
    pdal["Classification"] = records.classification
    pdal["ReturnNumber"], pdal["NumberOfReturns"] = records.return_number, 2
    pdal["Withheld"] = records.withheld
    for source in (las, [las], records, records.points, pdal):
        grid = terrane.grid(source, 10.0, "mean,count", extent=box, **options)
        np.testing.assert_allclose(grid["mean"], mean, atol=1e-9)
        assert np.array_equal(grid["count"], count)
    assert terrane.grid(records, 10.0).crs == "EPSG:32631"


def test_grids_go_to_files_and_arrays(tmp_path: Path, points: NDArray[np.float64]) -> None:
    grid = terrane.grid(points, 10.0, ["mean", "count"], crs=32631)
    grid.write(tmp_path / "grid.tif")
    with rasterio.open(tmp_path / "grid.tif") as dataset:
        np.testing.assert_array_equal(dataset.read(1), grid["mean"])
        assert dataset.crs.to_epsg() == 32631
        assert tuple(dataset.transform)[:6] == grid.transform
    with pytest.raises(FileExistsError):
        grid.write(tmp_path / "grid.tif")
    grid.write(tmp_path / "grid.tif", overwrite=True)
    with pytest.raises(ValueError, match="bands"):
        grid.write(tmp_path / "grid.asc")
    terrane.grid(points, 10.0, "count").write(tmp_path / "count.asc")
    assert (tmp_path / "count.asc").exists()
    again = pickle.loads(pickle.dumps(grid))
    np.testing.assert_array_equal(again.data, grid.data)
    assert (again.names, again.transform, again.crs) == (grid.names, grid.transform, grid.crs)
    again.write(tmp_path / "again.tif")
    assert (tmp_path / "again.tif").read_bytes() == (tmp_path / "grid.tif").read_bytes()
    array = grid.to_xarray()
    assert array.dims == ("band", "y", "x")
    assert pyproj.CRS(array.spatial_ref.attrs["crs_wkt"]).to_epsg() == 32631
    mesh = terrane.tin(array.sel(band="mean"), max_error=0.5)
    assert mesh.crs == "EPSG:32631"


def test_models(tmp_path: Path) -> None:
    cloud = "synth:cloud,size=120,density=4,seed=3"
    ground, top, canopy = (make(cloud, 2.0) for make in (terrane.dtm, terrane.dsm, terrane.chm))
    assert ground.data.shape == top.data.shape == canopy.data.shape
    known = np.isfinite(ground.data) & np.isfinite(top.data) & np.isfinite(canopy.data)
    assert known.mean() > 0.9
    assert (top.data - ground.data)[known].max() > 5
    box = terrane.dtm(cloud, 2.0, extent=(500020, 4750020, 500060, 4750040))
    assert box.data.shape == (1, 10, 20)
    own = terrane.grid(cloud, 2.0, dtm=True, output=tmp_path / "dtm.tif", type="float64")
    assert own["bands"][0]["name"] == "dtm"
    for option in ({"stat": "max"}, {"radius": 2}, {"fil": 2}, {"format": "GTiff"}):
        with pytest.raises(terrane.Error, match=min(option)):
            terrane.dtm(cloud, 2.0, **option)


def test_meshes_of_points(tmp_path: Path, points: NDArray[np.float64]) -> None:
    path = tmp_path / "mesh.ply"
    told = terrane.write_cloud_tin(points, path, 5.0)
    assert told["vertices"] > 3
    assert terrane.verify_cloud(path, points).ok
    assert not terrane.verify_cloud(path, points + (0, 0, 20)).ok


@pytest.mark.parametrize(
    ("points", "options", "told"),
    [
        (np.zeros((5, 2)), {}, "not an array of points"),
        (np.zeros(5), {}, "not an array of points"),
        (np.full((5, 3), np.nan), {}, "not finite"),
        (np.zeros((5, 3)), {"cell": 0.0}, "."),
        (np.zeros((5, 3)), {"cell": 1.0, "stat": "median of all"}, "."),
        (np.zeros((5, 3)), {"cell": 1.0, "returns": "second"}, "returns is"),
        (np.zeros(5, [("a", "f8")]), {}, "lacks x, y and z"),
        ("nowhere.laz", {}, "."),
    ],
)
def test_what_is_no_cloud_is_refused(points: Any, options: dict[str, Any], told: str) -> None:
    with pytest.raises(terrane.Error, match=told):
        terrane.grid(points, **{"cell": 1.0, **options})


def test_points(las: str, points: NDArray[np.float64], tmp_path: Path) -> None:
    """Points are written with what is known of them, as one file, as squares, and by a plan."""
    thin = tmp_path / "thin.laz"
    made = terrane.points(las, thin, classes=[1, 2], thin="10:highest", point_format=7)
    assert (made["files"], made["point_format"]) == (1, 7)
    kept = laspy.read(thin)
    assert len(kept) == made["points"] == 60 and set(kept.classification) <= {1, 2}
    with pytest.raises(terrane.ExistsError):
        terrane.points(las, thin)
    squares, planned = tmp_path / "squares", tmp_path / "planned"
    how: dict[str, Any] = {"buffer": 3.0, "dedupe": True}
    made = terrane.points(las, squares, tile=25.0, **how)
    plan = terrane.plan_points(las, tmp_path / "work", tile=25.0, task_size=2, **how)
    plan.run(task="squares-1")
    assert plan.run(output=planned)["found"] == 1
    names = sorted(path.name for path in squares.iterdir())
    assert len(names) == made["files"] == 12 and names == sorted(p.name for p in planned.iterdir())
    assert all((squares / name).read_bytes() == (planned / name).read_bytes() for name in names)
    own = sum((np.asarray(laspy.read(squares / name).withheld) == 0).sum() for name in names)
    assert own == sum(np.arange(len(points)) % 7 != 0), "each point once, but for those that were withheld"


def test_points_are_refused_by_name(points: NDArray[np.float64], tmp_path: Path) -> None:
    """What cannot be is told with the remedy."""
    with pytest.raises(terrane.Error, match="pass point cloud files"):
        terrane.points(points, tmp_path / "a.laz")
    file = tmp_path / "a.xyz"
    file.write_text("1 2 3\n4 5 6\n")
    with pytest.raises(terrane.Error, match="buffer requires tile"):
        terrane.points(f"cloud:{file}", tmp_path / "a.laz", buffer=2.0)
    with pytest.raises(terrane.Error, match="classify is .*expected ground, ground:"):
        terrane.points(f"cloud:{file}", tmp_path / "a.laz", classify="grond")
    with pytest.raises(terrane.Error, match="synthetic point cloud"):
        terrane.points("synth:cloud,size=20", tmp_path / "a.laz")


def test_points_are_split_by_attributes(tmp_path: Path, las: str, points: NDArray[np.float64]) -> None:
    told = terrane.points(las, tmp_path / "parts", split="class")
    files = sorted(path.name for path in (tmp_path / "parts").iterdir())
    assert files == [f"classification_{number}.laz" for number in range(4)]
    assert (told["files"], told["points"]) == (4, len(points))
    terrane.points(las, tmp_path / "one.laz", where="class = 2")
    part = (tmp_path / "parts" / "classification_2.laz").read_bytes()
    assert part == (tmp_path / "one.laz").read_bytes()
    with pytest.raises(ValueError, match="no attribute"):
        terrane.points(las, tmp_path / "none.laz", where="amplitude > 1")
    with pytest.raises(ValueError, match="is not a condition"):
        terrane.points(las, tmp_path / "none.laz", where="intensity")
    with pytest.raises(ValueError, match="cannot be used with split"):
        terrane.points(las, tmp_path / "none", split="class", tile=10.0)


def test_models_choose_their_cells() -> None:
    chosen = terrane.dtm("synth:cloud,size=60,density=2,seed=5", cell=None)
    assert chosen.transform[0] == 1.0
    assert any("about the point spacing" in note for note in chosen.report["notes"])


def test_values_are_taken_as_they_are_given(las: str, points: NDArray[np.float64], tmp_path: Path) -> None:
    """Values that can be looked at once, too many of them, bytes, and what stands for nothing."""
    expected = terrane.grid(las, 10.0, "count", classes=[2]).data
    for classes in (iter([2]), (n for n in [2]), np.array([2]), {2}, 2):
        np.testing.assert_array_equal(terrane.grid(las, 10.0, "count", classes=classes).data, expected)
    for option in ({"classes": b"2"}, {"where": b"z > 0"}, {"like": 5}, {"extent": b"abcd"}):
        with pytest.raises(terrane.InputError, match=min(option)):
            terrane.grid(las, 10.0, **option)
    with pytest.raises(terrane.InputError, match="more than"):
        terrane.grid(las, 10.0, classes=np.zeros(2_000_000, int))
    none = {"height_above_ground": False, "drop_overlap": False, "dedupe": False, "buffer": None}
    told = terrane.points(las, tmp_path / "all.laz", **none)
    assert told["points"] == len(points)
    with pytest.raises(FileExistsError):
        terrane.grid(las, 10.0, output=tmp_path / "all.laz")
    terrane.grid(las, 4.0, output=tmp_path / "like.tif")
    like = str(tmp_path / "like.tif")
    assert terrane.grid(las, like=like).transform[0] == 4.0
    with pytest.raises(terrane.InputError, match="like cannot be used with cell"):
        terrane.grid(las, 1, like=like)
    plan = terrane.plan_grid(las, tmp_path / "work", dtm=True)
    plan.run(output=tmp_path / "dtm.tif")
    terrane.dtm(las).write(tmp_path / "at once.tif")
    assert (tmp_path / "dtm.tif").read_bytes() == (tmp_path / "at once.tif").read_bytes()


def test_polygons_are_united_and_in_the_system_of_the_points(
    las: str, points: NDArray[np.float64], tmp_path: Path
) -> None:
    geopandas, shapely = pytest.importorskip("geopandas"), pytest.importorskip("shapely")
    box = shapely.box(5e5 + 2, 4e6 + 2, 5e5 + 32, 4e6 + 32)
    other = shapely.box(5e5 + 12, 4e6 + 12, 5e5 + 52, 4e6 + 52)
    def count(source: Any, clip: Any, **more: Any) -> float:
        return float(np.nansum(terrane.grid(source, 10.0, "count", clip=clip, keep_withheld=True, **more).data))
    both = count(las, shapely.union_all([box, other]))
    assert 0 < both < len(points)
    assert both == count(las, [box, other]) == count(las, [box, other, box]) == count(points, [box, other], crs=32631)
    file = tmp_path / "points.xyz"
    np.savetxt(file, points, fmt="%.2f")
    assert both == count(f"cloud:{file}", [box, other], crs=np.int64(32631))
    told = terrane.write_cloud_tin(f"cloud:{file}", tmp_path / "m.ply", 40.0, crs=32631, clip=[box, other])
    assert told["vertices"] > 3
    elsewhere = geopandas.GeoDataFrame(geometry=[box], crs=2154)
    for source in (las, points, "synth:cloud,size=20"):
        crs = {"crs": 32631} if source is points else {}
        with pytest.raises(terrane.Error, match="EPSG:2154"):
            terrane.grid(source, 10.0, clip=elsewhere, **crs)


def test_clouds_are_opened_as_they_are_read(las: str, points: NDArray[np.float64], tmp_path: Path) -> None:
    """A damaged file, and files some of which say no reference system: options that help are heard from the start."""
    shapely = pytest.importorskip("shapely")
    damaged = tmp_path / "damaged.las"
    damaged.write_bytes(Path(las).read_bytes()[: -100 * laspy.read(las).header.point_format.size])
    text = tmp_path / "more.xyz"
    np.savetxt(text, points + (0, 0, 1), fmt="%.2f")
    mixed = [las, f"cloud:{text}"]
    box = shapely.box(5e5 + 2, 4e6 + 2, 5e5 + 52, 4e6 + 42)
    for name, source, options in (("damaged", str(damaged), {"salvage": True}), ("mixed", mixed, {"crs": 32631})):
        with pytest.raises(terrane.Error):
            terrane.grid(source, 10.0)
        with pytest.raises(terrane.Error):
            terrane.points(source, tmp_path / "none.laz")
        for clip in (None, box):
            asked: dict[str, Any] = {**options, "clip": clip}
            assert terrane.grid(source, 10.0, **asked).crs == "EPSG:32631"
            terrane.points(source, tmp_path / f"{name}.laz", overwrite=True, **asked)
            mesh = tmp_path / f"{name}.ply"
            terrane.write_cloud_tin(source, mesh, 40.0, overwrite=True, **asked)
            assert terrane.verify_cloud(mesh, source, **asked).ok
        plan = terrane.plan_grid(source, tmp_path / f"{name} grid", cell=10.0, **options)
        terrane.grid(source, 10.0, output=tmp_path / f"{name}.tif", **options)
        plan.run(output=tmp_path / f"{name} planned.tif")
        planned, at_once = (tmp_path / f"{name}{end}.tif" for end in (" planned", ""))
        assert planned.read_bytes() == at_once.read_bytes()
        terrane.plan_cloud_tin(source, tmp_path / f"{name} tin", 40.0, **options)


def test_polygons_have_the_other_name_everywhere(las: str, tmp_path: Path) -> None:
    file = tmp_path / "area.wkt"
    file.write_text("POLYGON ((500002 4000002, 500052 4000002, 500052 4000042, 500002 4000002))")
    file.with_suffix(".prj").write_text("EPSG:32631")
    meshes = [tmp_path / f"{name}.ply" for name in ("clip", "polygon", "planned")]
    terrane.write_cloud_tin(las, meshes[0], 40.0, clip=file)
    terrane.write_cloud_tin(las, meshes[1], 40.0, polygon=file)
    terrane.plan_cloud_tin(las, tmp_path / "work", 40.0, polygon=file).run(output=meshes[2])
    assert len({mesh.read_bytes() for mesh in meshes}) == 1
    assert terrane.verify_cloud(meshes[0], las, polygon=file).ok
    geometry = pytest.importorskip("shapely").from_wkt(file.read_text())
    terrane.write_cloud_tin(las, meshes[1], 40.0, polygon=geometry, overwrite=True)
    assert meshes[1].read_bytes() == meshes[0].read_bytes()
    for options in ({}, {"clip": file}):
        with pytest.raises(terrane.InputError, match="in memory" if not options else "clip"):
            terrane.plan_cloud_tin(las, tmp_path / "other", 40.0, polygon=geometry, **options)
