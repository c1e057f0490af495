"""One table of what plans promise: meshes, grids and points, done by `run`, task by task, by Dask and by Slurm,
killed on the way or with damaged results. The bytes at the end are always those of one run."""

from __future__ import annotations

import inspect
import os
import random
import shutil
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from processes import TERRANE, Processes, stand_in, status, terrane, until
from distributed import Client

from terrane import dask

TESTS = Path(__file__).resolve().parent
SLURM = TESTS.parents[1] / "slurm" / "terrane-slurm.sh"
INPUTS = {
    "tin": ["tin", "synth:rough,width=1500,height=3000,seed=3", "--max-error", "0.4", "--tile", "128"],
    "grid": ["grid", "synth:cloud,size=1100,density=1,seed=3", "--cell", "1", "--stat", "tin,mean"],
    "cloud": ["tin", "synth:cloud,size=700,density=1,seed=3", "--max-error", "0.6"],
    "points": ["points", "cloud.laz", "--tile", "60", "--height-above-ground", "--buffer", "9"],
}
MORE = {
    "tin": ["--strip-rows", "2"],
    "grid": ["--tile", "256"],
    "cloud": ["--cut", "131072"],
    "points": ["--cut", "2"],
}
OUTPUT = {"tin": "mesh.ply", "grid": "grid.tif", "cloud": "mesh.ply", "points": "points"}


def contents(output: Path) -> list[tuple[str, bytes]]:
    """The bytes of a file, or of all in a folder."""
    files = sorted(output.iterdir()) if output.is_dir() else [output]
    return [(path.name, path.read_bytes()) for path in files]


def remove(output: Path) -> None:
    """Removes a file or a folder."""
    if output.is_dir():
        shutil.rmtree(output)
    else:
        output.unlink()


class Plan:
    """A plan of a kind, and the bytes that have to come of it."""

    def __init__(self, kind: str, folder: Path) -> None:
        self.folder, self.output = folder / "work", folder / "work" / OUTPUT[kind]
        what, source, *how = INPUTS[kind]
        if kind == "points":
            source = str(folder / source)
            terrane("synth", "cloud,size=400,density=2,seed=3", source, "-q")
        whole = folder / OUTPUT[kind]
        terrane(what, source, whole, *how, "-q")
        self.expected = contents(whole)
        terrane("plan", what, source, "-o", self.folder, *how, *MORE[kind], "-q")
        self.tasks = [task["id"] for task in self.status()["to_do"]]
        self.endings = ["tif" if kind == "grid" else "object", "json"]

    def status(self) -> dict[str, object]:
        """How far it is."""
        return status(self.folder)

    def objects(self) -> list[Path]:
        """The results that are there."""
        return sorted((self.folder / "objects").glob(f"*.{self.endings[0]}"))

    def done(self) -> int:
        """How many results are there whole, with what is put beside them at last."""
        return len(list((self.folder / "objects").glob(f"*.{self.endings[1]}")))

    def is_right(self) -> bool:
        """True when the output is that of one run."""
        return contents(self.output) == self.expected


def by_run(plan: Plan, processes: Processes) -> subprocess.Popen[str]:
    return processes.start(TERRANE, "run", plan.folder, "-q")


def by_tasks(plan: Plan, processes: Processes) -> subprocess.Popen[str]:
    script = 'for task in $2; do "$0" run "$1" --task $task -q || exit; done'
    return processes.start("bash", "-c", script, TERRANE, plan.folder, " ".join(plan.tasks))


def by_dask(plan: Plan, processes: Processes) -> subprocess.Popen[str]:
    return processes.driver(plan.folder, "--workers", 2)


def by_slurm(plan: Plan, processes: Processes, *options: str) -> subprocess.Popen[str]:
    paths = f"{TESTS}:{os.environ['PATH']}"
    fake = {"PATH": paths, "FAKE_SLURM": str(plan.folder.parent / "jobs"), "ELEMENTS": "2"}
    program = processes.program or TERRANE
    env = {**os.environ, **fake, "TERRANE": str(program), "TRIES": "3"}
    return processes.start("bash", SLURM, plan.folder, "--", *options, env=env)


Way = Callable[[Plan, Processes], subprocess.Popen[str]]
WAYS: dict[str, Way] = {"run": by_run, "tasks": by_tasks, "dask": by_dask, "slurm": by_slurm}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", INPUTS)
def test_killed(kind: str, way: str, tmp_path: Path, processes: Processes) -> None:
    plan = Plan(kind, tmp_path)
    begun = WAYS[way](plan, processes)
    until(lambda: plan.done() >= 2)
    os.killpg(begun.pid, signal.SIGKILL)
    begun.communicate()
    there = plan.status()
    assert there["damaged"] == [] and there["output"] is None, "the work was too short to be killed"
    assert there["done"] >= 2
    end(WAYS[way](plan, processes))
    assert plan.is_right()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", INPUTS)
def test_damaged(kind: str, way: str, tmp_path: Path, processes: Processes) -> None:
    plan, chance = Plan(kind, tmp_path), random.Random(kind + way)
    terrane("run", plan.folder, "-q")
    remove(plan.output)
    sound = {path: path.read_bytes() for path in plan.objects()}
    for path in chance.sample(sorted(sound), 3):
        harm = bytearray(sound[path])
        harm[chance.randrange(len(harm))] ^= 1 << chance.randrange(8)
        path.write_bytes(harm)
    end(WAYS[way](plan, processes))
    assert plan.is_right()
    if kind == "tin":
        # What a seam has done again is not read at the end; a run reads it.
        terrane("run", plan.folder, "-q")
    assert {path: path.read_bytes() for path in plan.objects()} == sound, "and made good"


def end(process: subprocess.Popen[str]) -> str:
    """What a process printed that has to end well."""
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out


@pytest.mark.parametrize("kind", INPUTS)
def test_too_little_memory_is_not_tried_again(
    kind: str, tmp_path: Path, processes: Processes
) -> None:
    plan, calls = Plan(kind, tmp_path), tmp_path / "calls"
    program = stand_in(tmp_path / "stand-in", f'test -z "$task" || echo "$task" >>{calls}')
    how = ["--workers", 1, "--terrane", program, "--memory", "1M"]
    driver = processes.driver(plan.folder, *how)
    _, err = driver.communicate(timeout=60)
    assert driver.returncode == 75 and "of memory are needed" in err and "again" not in err, err
    assert len(calls.read_text().split()) == 1
    calls.unlink()
    processes.program = program
    by_slurm(plan, processes, "--memory", "1M").communicate(timeout=60)
    jobs = [line.split()[2] for line in (tmp_path / "jobs").read_text().splitlines()]
    assert jobs[0] == "failed" and set(jobs[1:]) == {"cancelled"}
    assert len(calls.read_text().split()) == 2, "once by each element"


@pytest.mark.parametrize("kind", INPUTS)
def test_the_function_does_what_the_command_does(kind: str, tmp_path: Path) -> None:
    plan = Plan(kind, tmp_path)
    assert TERRANE
    with Client(n_workers=2, processes=False, dashboard_address=None) as client:
        report = dask.run(plan.folder, client, terrane=TERRANE, batch_seconds=0.5)
        assert report.output == str(plan.output) and plan.is_right()
        assert (report.done, report.tasks) == (len(plan.tasks), len(plan.tasks))
        again = dask.run(plan.folder, client, terrane=TERRANE)
        assert again.done == 0 and again.skipped == len(plan.tasks)
        one = next(plan.output.iterdir()) if plan.output.is_dir() else plan.output
        one.write_bytes(one.read_bytes() + b"mine")
        with pytest.raises(dask.Stop, match="changed since") as stop:
            dask.run(plan.folder, client, terrane=TERRANE)
        assert stop.value.code == 2
        dask.run(plan.folder, client, terrane=TERRANE, overwrite=True)
        assert plan.is_right()
    told = inspect.getdoc(dask.run) or ""
    for name in inspect.signature(dask.run).parameters:
        assert f"{name}:" in told, f"{name} is explained"


def test_a_mistyped_folder_makes_no_folder(tmp_path: Path, processes: Processes) -> None:
    typo = tmp_path / "tpyo"
    slurm = processes.start("bash", SLURM, typo, env={**os.environ, "TERRANE": str(TERRANE)})
    _, err = slurm.communicate(timeout=60)
    assert slurm.returncode == 65 and "does not hold a plan" in err
    driver = processes.driver(typo, "--workers", 1)
    _, err = driver.communicate(timeout=60)
    assert driver.returncode == 65 and "does not hold a plan" in err
    assert not list(tmp_path.iterdir())


def test_slurm_goes_on_after_an_element_that_failed(tmp_path: Path, processes: Processes) -> None:
    plan, once = Plan("tin", tmp_path), tmp_path / "once"
    fails = f'if test "$task" = strip-4 && mkdir {once} 2>&-; then echo no >&2; exit 70; fi'
    processes.program = stand_in(tmp_path / "stand-in", fails)
    end(by_slurm(plan, processes))
    assert plan.status()["output"] is None
    end(by_slurm(plan, processes))
    assert plan.is_right()
    assert "nothing is left to do" in end(by_slurm(plan, processes))
