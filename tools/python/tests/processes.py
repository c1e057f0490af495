"""Plans to work on, meshes to compare with, and processes to kill."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

ROOT = Path(__file__).resolve().parents[3]
BUILDS = [ROOT / "target" / build / "terrane" for build in ("release", "debug")]
# Makes this package one that cannot be imported.
HIDE = "import sys; sys.modules['terrane'] = None"
TERRANE = os.environ.get("TERRANE") or next(
    (str(path) for path in BUILDS if path.exists()), shutil.which("terrane")
)

# A shell without job control lets what it puts into the background ignore interrupts, and with it all
# that is started from there. A handler, unlike that, is not inherited.
signal.signal(signal.SIGINT, signal.default_int_handler)


def terrane(*arguments: object) -> str:
    """What the program prints; fails with its message."""
    assert TERRANE, "set TERRANE to the program"
    command = [TERRANE, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def status(folder: Path) -> dict[str, Any]:
    """How far a plan has come."""
    return dict(json.loads(terrane("status", folder, "--json")))


class Work:
    """A plan of many short tasks, and the mesh that has to come of it."""

    def __init__(self, folder: Path, height: int, error: float) -> None:
        self.grid = f"synth:rough,width=2000,height={height},seed=3"
        self.how = ["--max-error", str(error), "--tile", "128"]
        self.folder, self.mesh = folder / "work", folder / "work" / "mesh.ply"
        terrane("plan", "tin", self.grid, "-o", self.folder, *self.how, "--strip-rows", 2, "-q")
        self.tasks = len(status(self.folder)["to_do"])

    def is_right(self, mesh: Path | None = None) -> bool:
        """True when the mesh has the bytes that one run without a plan makes."""
        reference = self.folder.parent / "reference.ply"
        if not reference.exists():
            terrane("tin", self.grid, reference, *self.how, "-q")
        return (mesh or self.mesh).read_bytes() == reference.read_bytes()

    def wait_for(self, tasks: int) -> None:
        """Waits until so many tasks are done."""
        until(lambda: len(list((self.folder / "objects").glob("*.json"))) >= tasks)

    def runs(self) -> list[psutil.Process]:
        """The programs that work on this plan."""
        found = []
        for process in psutil.process_iter(["cmdline"]):
            line = process.info["cmdline"] or []
            if str(self.folder) in line and line[line.index(str(self.folder)) - 1] == "run":
                found.append(process)
        return found


def until(is_so: Callable[[], object], seconds: float = 60.0) -> None:
    """Waits; fails when it takes too long."""
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.05)


def stand_in(path: Path, script: str) -> str:
    """A program that is not terrane, or not always: `$task` is what it is asked for."""
    task = 'task=""; for a; do test "$last" = --task && task=$a; last=$a; done'
    path.write_text(f'#!/bin/sh\n{task}\n{script}\nexec {TERRANE} "$@"\n')
    path.chmod(0o755)
    return str(path)


class Processes:
    """Processes that end with the test."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.started: list[subprocess.Popen[str]] = []
        # What stands for the program, where something does.
        self.program: str | None = None

    def python(self, *arguments: object, cwd: Path | None = None) -> subprocess.Popen[str]:
        """Starts Python."""
        return self.start(sys.executable, *arguments, cwd=cwd)

    def start(
        self, *arguments: object, cwd: Path | None = None, env: dict[str, str] | None = None
    ) -> subprocess.Popen[str]:
        """Starts a program, in a process group of its own."""
        pipe = subprocess.PIPE
        process = subprocess.Popen(
            [*map(str, arguments)],
            stdout=pipe,
            stderr=pipe,
            text=True,
            cwd=cwd,
            env=env,
            start_new_session=True,
        )
        self.started.append(process)
        return process

    def driver(self, folder: Path, *options: object) -> subprocess.Popen[str]:
        """Starts the driver with short batches."""
        how = ["--terrane", TERRANE, "--batch-seconds", 0.5, *options]
        return self.python("-m", "terrane.dask", folder, *how)

    def cluster(self, workers: int) -> tuple[str, subprocess.Popen[str]]:
        """Starts a scheduler and workers; their address, and the scheduler."""
        file = self.folder / f"scheduler-{len(self.started)}.json"
        how = ["--scheduler-file", file, "--no-dashboard"]
        scheduler = self.quiet("dask_scheduler", "--port", 0, *how)
        until(file.exists)
        few = ["--nworkers", workers, "--nthreads", 1, "--memory-limit", 0, "--death-timeout", 20]
        # Spawned processes begin anew and have to be told, too.
        self.quiet("dask_worker", *few, *how, "--preload", HIDE)
        return str(json.loads(file.read_text())["address"]), scheduler

    def quiet(self, cli: str, *arguments: object) -> subprocess.Popen[str]:
        """A part of a cluster, where this package cannot be imported."""
        main = f"from distributed.cli.{cli} import main; main()"
        code = f"import sys, os; sys.stdout = sys.stderr = open(os.devnull, 'w'); {main}"
        return self.python("-c", f"{HIDE}; {code}", *arguments, cwd=self.folder)

    def stop(self) -> None:
        """Kills all that is left, with its children."""
        for process in self.started:
            if process.poll() is None:
                family = psutil.Process(process.pid)
                for member in [*family.children(recursive=True), family]:
                    member.kill()
            process.communicate()


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    """For processes that have to end with the test."""
    started = Processes(tmp_path)
    yield started
    started.stop()


@pytest.fixture
def small(tmp_path: Path) -> Work:
    """A second of work."""
    return Work(tmp_path, 4000, 2.0)


@pytest.fixture
def large(tmp_path: Path) -> Work:
    """Some ten seconds of work, long enough to kill things in its middle."""
    return Work(tmp_path, 9000, 0.15)
