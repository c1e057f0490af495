"""Jobs on a few workers: the mesh, what is skipped, what stops a job, what is tried again."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import pytest
from processes import TERRANE, Processes, Work, stand_in, status, terrane, until
from distributed import Client, LocalCluster
from distributed.diagnostics.plugin import SchedulerPlugin

from terrane.dask.driver import Driver, Job, Stop


def test_the_mesh_is_that_of_one_run_and_what_is_done_is_skipped(
    small: Work, processes: Processes
) -> None:
    terrane("run", small.folder, "--task", "strip-3", "-q")
    first = processes.driver(small.folder, "--workers", 2, "--no-finish")
    report = json.loads(first.communicate(timeout=60)[0])
    assert (report["skipped"], report["done"]) == (1, small.tasks - 2)
    assert status(small.folder)["output"] is None
    address, _ = processes.cluster(2)
    report = json.loads(
        processes.driver(small.folder, "--scheduler", address).communicate(timeout=60)[0]
    )
    assert (report["skipped"], report["done"]) == (small.tasks - 1, 1)
    assert report["output"] == str(small.mesh) and small.is_right()
    other = small.folder.parent / "other.ply"
    again = processes.driver(small.folder, "--scheduler", address, "--output", other)
    assert json.loads(again.communicate(timeout=60)[0])["done"] == 1
    assert small.is_right(other)


def test_bad_input_stops_the_job_with_the_message(tmp_path: Path, processes: Processes) -> None:
    grid, folder = tmp_path / "grid.asc", tmp_path / "work"
    head = "ncols 600\nnrows 600\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    rows = [" ".join(str(x * y % 37) for x in range(600)) for y in range(600)]
    grid.write_text(head + "\n".join(rows) + "\n")
    how = ["--max-error", 5, "--tile", 64, "--strip-rows", 2]
    terrane("plan", "tin", grid, "-o", folder, *how, "-q")
    grid.write_text(head + "\n".join(reversed(rows)) + "\n5\n")
    driver = processes.driver(folder, "--workers", 2)
    out, err = driver.communicate(timeout=60)
    assert driver.returncode == 65 and not out
    assert "grid.asc: changed since the plan was made" in err and "Traceback" not in err


def test_what_cannot_be_begun_says_so(tmp_path: Path, processes: Processes) -> None:
    driver = processes.driver(tmp_path, "--workers", 1)
    assert "does not hold a plan" in driver.communicate(timeout=60)[1] and driver.returncode == 65
    driver = processes.python("-m", "terrane.dask", tmp_path, "--terrane", "./no", "--workers", 1)
    assert "cannot run" in driver.communicate(timeout=60)[1] and driver.returncode == 2


class Nodes(SchedulerPlugin):
    """Counts the nodes of the graph."""

    def __init__(self, cluster: LocalCluster) -> None:
        self.scheduler, self.most = cluster.scheduler, 0

    def transition(self, *args: object, **kwargs: object) -> None:
        nodes = [key for key in self.scheduler.tasks if str(key).startswith("terrane-")]
        self.most = max(self.most, len(nodes))


def test_graph_nodes_are_no_more_than_asked_for(small: Work) -> None:
    threads = LocalCluster(n_workers=2, threads_per_worker=1, processes=False, dashboard_address="")
    with threads as cluster, Client(cluster) as client:
        nodes = Nodes(cluster)
        cluster.scheduler.add_plugin(nodes)
        assert TERRANE
        job = Job(str(small.folder), TERRANE, batch_seconds=0.0, most_nodes=5)
        report = Driver(client, job).run()
        assert nodes.most == report.nodes == 5 and report.done == small.tasks
        # What a busy machine loses is handed out once more.
        assert report.batches == report.done + report.retried
        assert small.is_right()


@pytest.mark.parametrize("code, is_tried", [(69, True), (74, True), (75, False), (70, False), (2, False)])
def test_exit_codes_tell_what_is_tried_again(small: Work, code: int, is_tried: bool) -> None:
    once = small.folder / "once"
    script = f'if test "$task" = strip-4 && mkdir {once} 2>&-; then echo no >&2; exit {code}; fi'
    program = stand_in(small.folder / "stand-in", script)
    with Client(n_workers=2, processes=False, dashboard_address="") as client:
        driver = Driver(client, Job(str(small.folder), program))
        if is_tried:
            report = driver.run()
            assert report.retried == 1 and report.done == small.tasks and small.is_right()
        else:
            with pytest.raises(Stop, match="no") as stop:
                driver.run()
            assert stop.value.code == code


def test_what_fails_again_and_again_stops_the_job(small: Work) -> None:
    program = stand_in(small.folder / "stand-in", 'test "$task" = strip-4 && kill -9 $$')
    with Client(n_workers=2, processes=False, dashboard_address="") as client:
        driver = Driver(client, Job(str(small.folder), program, retries=1))
        with pytest.raises(Stop, match="strip-4: the program ended with code -9") as stop:
            driver.run()
        assert stop.value.code == 69 and driver.report.retried == 1


@pytest.mark.parametrize(
    "how", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_an_interrupted_job_leaves_nothing_running(
    large: Work, processes: Processes, how: signal.Signals
) -> None:
    driver = processes.driver(large.folder, "--workers", 2)
    large.wait_for(5)
    # As a terminal does it: to the driver and all its children.
    send = os.killpg if how == signal.SIGINT else os.kill
    send(driver.pid, how)
    out, err = driver.communicate(timeout=30)
    assert driver.returncode == 130 and not out
    assert err.strip().endswith("run again to go on") and "Traceback" not in err, err
    until(lambda: not large.runs(), 10)
    assert not list((large.folder / "objects").glob(".*"))
