"""Plans, here and on a cluster."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
import terrane
from numpy.typing import NDArray

DEM = "synth:rough,size=300"


def test_a_plan_makes_what_is_made_at_once(tmp_path: Path) -> None:
    terrane.write_tin(DEM, tmp_path / "at once.ply", 5.0, tile=64)
    plan = terrane.plan(DEM, tmp_path / "work", 5.0, tile=64, task_size=2)
    status = plan.status()
    assert status["done"] == 0
    assert len(status["to_do"]) > 3
    task, after = status["to_do"][0]
    assert after == []
    assert plan.run(task=task)["made"] == [task]
    again = pickle.loads(pickle.dumps(plan))
    assert again.status()["done"] == 1
    done = again.run(output=tmp_path / "mesh.ply")
    assert done["found"] == 1
    assert Path(done["written"]) == tmp_path / "mesh.ply"
    assert (tmp_path / "mesh.ply").read_bytes() == (tmp_path / "at once.ply").read_bytes()
    assert terrane.open_plan(tmp_path / "work").status()["to_do"] == []


def test_grids_are_planned(tmp_path: Path) -> None:
    cloud = "synth:cloud,size=300,density=1"
    plan = terrane.plan_grid(cloud, tmp_path / "work", cell=0.5, stat="mean", task_size=256)
    plan.run(output=tmp_path / "grid.tif")
    expected = terrane.grid(cloud, 0.5)
    expected.write(tmp_path / "at once.tif")
    assert (tmp_path / "grid.tif").read_bytes() == (tmp_path / "at once.tif").read_bytes()


def test_what_cannot_be_planned_is_refused(tmp_path: Path, heights: NDArray[np.float32]) -> None:
    with pytest.raises(terrane.Error, match="datasets in memory"):
        terrane.plan(heights, tmp_path / "work", 5.0)
    with pytest.raises(terrane.Error, match="datasets in memory"):
        terrane.plan_grid(np.zeros((9, 3)), tmp_path / "work", cell=1.0)
    with pytest.raises(terrane.Error, match="no target given"):
        terrane.plan(DEM, tmp_path / "work")
    for option in ({"cell": 1.0}, {"stat": "max"}, {"overwrite": True}):
        with pytest.raises(terrane.Error, match=min(option)):
            terrane.plan(DEM, tmp_path / "work", 5.0, **option)
    for option in ({"max_error": 1}, {"overwrite": True}, {"task_size": 100}):
        with pytest.raises(terrane.Error, match=min(option).replace("task_size", "multiple of 256")):
            terrane.plan_grid("synth:cloud,size=50", tmp_path / "work", cell=1.0, **option)
    with pytest.raises(terrane.Error, match="clip is a list in memory, but a plan requires a file"):
        terrane.plan_grid("synth:cloud,size=50", tmp_path / "work", cell=1.0, clip=[])
    with pytest.raises(FileNotFoundError):
        terrane.open_plan(tmp_path / "work")
    with pytest.raises(terrane.Error, match=r"no target given; pass max_error$"):
        terrane.plan_tin(DEM, tmp_path / "work")
    with pytest.raises(terrane.Error, match="disk_check applies to runs, not to plans; leave disk_check out"):
        terrane.plan_tin(DEM, tmp_path / "work", 5.0, disk_check=False)
    plan = terrane.plan(DEM, tmp_path / "work", 5.0, tile=64, task_size=2)
    with pytest.raises(terrane.Error, match="task is 3, expected a name; pass one such as 'strip-0'"):
        plan.run(task=3)  # type: ignore[arg-type]
    with pytest.raises(terrane.Error, match=r"no task strip-99; see Plan.status\(\)"):
        plan.run(task="strip-99")
    with pytest.raises(terrane.Error, match=r"x.obj: file name extension does not match format PLY; use the extension .ply"):
        plan.run(output=tmp_path / "x.obj")
    (tmp_path / "mesh.ply").write_text("another")
    with pytest.raises(FileExistsError):
        plan.run(output=tmp_path / "mesh.ply")
    assert (tmp_path / "mesh.ply").read_text() == "another"
    assert plan.run(output=tmp_path / "mesh.ply", overwrite=True)["written"]
    with pytest.raises(TypeError, match="unexpected"):
        plan.run(retries=3)
    with pytest.raises(terrane.Error, match="not supported with client"):
        plan.run(object(), progress=print)


def test_a_cluster_does_a_plan(tmp_path: Path) -> None:
    from distributed import Client

    terrane.write_tin(DEM, tmp_path / "at once.ply", 5.0, tile=64)
    plan = terrane.plan(DEM, tmp_path / "work", 5.0, tile=64, task_size=2)
    with Client(n_workers=2, threads_per_worker=1, dashboard_address="") as client:
        done = plan.run(client, output=tmp_path / "mesh.ply")
    assert done["done"] == done["tasks"]
    assert (tmp_path / "mesh.ply").read_bytes() == (tmp_path / "at once.ply").read_bytes()
