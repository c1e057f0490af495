"""How jobs behave: signals, threads, progress, errors, processes."""

from __future__ import annotations

import multiprocessing
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import terrane
from lands import rough
from numpy.typing import NDArray
from tqdm import tqdm

# A minute of work and more, if nothing stops it.
LONG = "synth:rough,size=20000"


def stop_after(seconds: float) -> None:
    """Ctrl-C, so much later."""

    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)


JOBS = {
    "tin": lambda folder: terrane.tin(LONG, max_error=0.5),
    "write_tin": lambda folder: terrane.write_tin(LONG, folder / "mesh.ply", 0.5),
    "contour": lambda folder: terrane.contour(LONG, 1.0),
    "grid": lambda folder: terrane.grid("synth:cloud,size=3000", stat="p95"),
    "dtm": lambda folder: terrane.dtm("synth:cloud,size=3000"),
}


@pytest.mark.parametrize("job", JOBS)
def test_an_interrupt_stops_work_and_leaves_nothing(tmp_path: Path, job: str) -> None:
    stop_after(0.5)
    with pytest.raises(KeyboardInterrupt):
        JOBS[job](tmp_path)
    assert not list(tmp_path.iterdir())


# Work that takes long for each tile, by everything that a mesh may have to keep to.
LONG_TILES: dict[str, dict[str, Any]] = {
    "plain": {},
    "large": {"tile": 2048},
    "strict": {"tile": 1024, "strict": True},
    "fit": {"tile": 1024, "fit_heights": True},
    "any": {"tile": 1024, "triangulation": "data-dependent"},
    "surface": {"tile": 1024, "bound": "surface"},
    "angles": {"tile": 1024, "min_angle": 20.0},
    "number": {"tile": 1024, "max_vertices": 2_000_000},
}


@pytest.fixture(scope="module")
def wide() -> NDArray[np.float32]:
    """More than two seconds of work, whatever is asked for."""
    rng = np.random.default_rng(1)
    heights = np.tile(rough(1024, 1024), (5, 5))
    return heights + rng.normal(size=heights.shape).astype("f4")


@pytest.mark.parametrize("kind", LONG_TILES)
def test_an_interrupt_is_obeyed_within_a_tile(kind: str, wide: NDArray[np.float32]) -> None:
    """Measured in time that this process works, as others may be at work beside it."""
    at = [0.0]

    def stop(*_: Any) -> None:
        at[0] = time.process_time()
        raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, stop)
    goal = {} if "max_vertices" in LONG_TILES[kind] else {"max_error": 0.5}
    for delay in (0.5, 1.5):
        signal.setitimer(signal.ITIMER_REAL, delay)
        with pytest.raises(KeyboardInterrupt):
            terrane.tin(wide, **goal, **LONG_TILES[kind], threads=1)
        assert time.process_time() - at[0] < 0.2


def test_other_threads_run_meanwhile() -> None:
    done, count = threading.Event(), 0

    def tick() -> None:
        nonlocal count
        while not done.is_set():
            count += 1
            time.sleep(0.001)

    ticker = threading.Thread(target=tick)
    ticker.start()
    terrane.tin("synth:rough,size=3000", max_error=3.0, threads=1)
    done.set()
    ticker.join()
    # Held by the interpreter, it would have gone on once or twice.
    assert count > 20


def test_jobs_run_side_by_side(heights: NDArray[np.float32]) -> None:
    meshes: list[terrane.Mesh] = []
    run = lambda: meshes.append(terrane.tin(heights, max_error=3.0))  # noqa: E731
    threads = [threading.Thread(target=run) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(meshes) == 6
    assert all(np.array_equal(mesh.vertices, meshes[0].vertices) for mesh in meshes)


def test_progress_is_told_in_the_calling_thread() -> None:
    told: list[tuple[str, int, int]] = []
    callers = set()

    def tell(stage: str, done: int, total: int) -> None:
        told.append((stage, done, total))
        callers.add(threading.get_ident())

    terrane.tin("synth:rough,size=2500", max_error=1.0, progress=tell)
    assert callers == {threading.get_ident()}
    stages = {stage for stage, _, _ in told}
    assert len(told) > 3
    assert all(0 <= done <= total for _, done, total in told)
    for stage in stages:
        steps = [done for name, done, _ in told if name == stage]
        assert steps == sorted(steps)


def test_what_a_callback_raises_ends_the_job() -> None:
    def tell(stage: str, done: int, total: int) -> None:
        raise LookupError(stage)

    with pytest.raises(LookupError):
        terrane.tin(LONG, max_error=0.5, progress=tell)
    with pytest.raises(terrane.Error, match="callable"):
        terrane.tin("synth:rough,size=65", max_error=1.0, progress=5)


def test_bars(capsys: pytest.CaptureFixture[str]) -> None:
    terrane.tin("synth:rough,size=1500", max_error=1.0, progress=tqdm)
    assert "100%" in capsys.readouterr().err


def test_errors_are_of_their_kind(tmp_path: Path) -> None:
    missing = tmp_path / "missing.tif"
    with pytest.raises(FileNotFoundError) as caught:
        terrane.tin(missing, max_error=1.0)
    error = caught.value
    assert isinstance(error, terrane.Error)
    assert isinstance(error, ValueError)
    assert (error.kind, error.file) == ("bad_input", str(missing))
    bad = tmp_path / "bad.asc"
    bad.write_text("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 x\n")
    with pytest.raises(ValueError, match="bad.asc") as caught_bad:
        terrane.tin(bad, max_error=1.0)
    told = caught_bad.value
    assert isinstance(told, terrane.InputError)
    assert told.file == str(bad)
    assert told.place is not None and "7" in told.place
    with pytest.raises(MemoryError) as caught_memory:
        terrane.tin("synth:rough,size=8000", max_error=0.5, memory=2_000_000)
    assert isinstance(caught_memory.value, terrane.ResourceError)
    assert caught_memory.value.remedy
    with pytest.raises(OSError, match="cannot"):
        terrane.write_tin("synth:rough,size=65", tmp_path / "no" / "mesh.ply", 1.0)
    with pytest.raises(ValueError, match="pass min_angle above 0, at most 26") as caught_usage:
        terrane.tin("synth:rough,size=65", max_error=1.0, min_angle=40.0)
    assert isinstance(caught_usage.value, terrane.Error)
    assert "--" not in str(caught_usage.value) + str(caught_usage.value.remedy)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert (str(again), again.kind, again.file) == (str(error), error.kind, error.file)


def made_elsewhere(seed: int) -> bytes:
    """A mesh, as another process makes it."""
    return terrane.tin(rough(200, 200, seed), max_error=3.0, threads=2).vertices.tobytes()


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes(method: str) -> None:
    here = [made_elsewhere(seed) for seed in (1, 2)]
    with multiprocessing.get_context(method).Pool(2) as pool:
        assert pool.map(made_elsewhere, (1, 2)) == here


def run(*args: str) -> subprocess.CompletedProcess[str]:
    """The command line."""
    return subprocess.run(
        [sys.executable, "-m", "terrane", *args], capture_output=True, text=True, check=False
    )


def test_the_command_line(tmp_path: Path) -> None:
    mesh = str(tmp_path / "mesh.ply")
    made = run("tin", "synth:rough,size=129", mesh, "--max-error", "5", "--verify")
    assert made.returncode == 0
    assert "vertices" in made.stdout
    assert terrane.verify(mesh, "synth:rough,size=129").ok
    assert run("verify", mesh, "synth:rough,size=129", "--max-error", "1").returncode == 1
    assert run("tin", "none.tif", mesh, "--max-error", "5").returncode == 65
    assert run("nothing").returncode == 2
    assert run("--version").stdout.split()[1] == terrane.__version__


def test_the_command_line_stops_on_a_signal(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "terrane", "tin", LONG, str(tmp_path / "m.ply")]
    job = subprocess.Popen([*command, "--max-error", "0.5"], stderr=subprocess.PIPE)
    time.sleep(1.5)
    job.send_signal(signal.SIGINT)
    _, told = job.communicate(timeout=20)
    assert job.returncode == 130, told
    assert not list(tmp_path.iterdir())


def test_importing_is_quick_and_takes_nothing_along() -> None:
    code = (
        "import sys, time; start = time.perf_counter(); import terrane; "
        "took = time.perf_counter() - start; "
        "print(took, [m for m in ('numpy', 'rasterio', 'xarray', 'shapely') if m in sys.modules])"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.split(maxsplit=1)[1].strip() == "[]"
    assert set(terrane.__all__) <= set(dir(terrane))
    for name in terrane.__all__:
        assert getattr(terrane, name) is not None
    with pytest.raises(AttributeError):
        _ = terrane.nothing


def test_other_interpreters_of_a_process_are_refused() -> None:
    """By an error, not by a crash."""
    code = (
        "try:\n    import _interpreters as i\nexcept ImportError:\n    import _xxsubinterpreters as i\n"
        "other = i.create()\n"
        "i.run_string(other, 'try:\\n from terrane import _terrane\\n"
        "except ImportError as error:\\n print(error, flush=True)')\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", f"import terrane._terrane\n{code}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert told.returncode == 0, told.stderr
    assert "subinterpreter" in told.stdout, told.stdout
