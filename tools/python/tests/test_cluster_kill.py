"""Whatever is killed, the bytes are the same and nothing is done twice that was done."""

from __future__ import annotations

import json
import os
import random
import time
from pathlib import Path

import psutil
import pytest
from processes import Processes, Work, stand_in, until


def workers(driver: int) -> list[psutil.Process]:
    """The worker processes of a driver that is its own cluster."""
    children = psutil.Process(driver).children()
    alive = [child for child in children if child.status() != psutil.STATUS_ZOMBIE]
    return [child for child in alive if "spawn_main" in " ".join(child.cmdline())]


# A task without end, so that what is stopped has not just ended.
SLEEP = f'test "$task" = strip-4 && exec sleep 1234.{os.getpid()}'


def sleepers() -> list[psutil.Process]:
    """The programs that would not end."""
    processes = psutil.process_iter(["cmdline"])
    return [p for p in processes if (p.info["cmdline"] or [])[1:] == [SLEEP.split()[-1]]]


@pytest.mark.parametrize("kills", [1, pytest.param(5, marks=pytest.mark.slow)])
def test_workers_are_killed(tmp_path: Path, processes: Processes, kills: int) -> None:
    work, chance = Work(tmp_path, 1500 + 1500 * kills, 0.15), random.Random(kills)
    driver = processes.driver(work.folder, "--workers", 3)
    for _ in range(kills):
        until(work.runs)
        time.sleep(chance.uniform(0, 1))
        chance.choice(workers(driver.pid)).kill()
    assert driver.poll() is None, "the work was too short to kill anybody"
    out, err = driver.communicate(timeout=120)
    assert driver.returncode == 0, err
    report = json.loads(out)
    assert (report["skipped"], report["done"]) == (0, work.tasks) and work.is_right()


def test_programs_end_with_their_worker_and_with_their_job(
    small: Work, processes: Processes
) -> None:
    program = stand_in(small.folder / "stand-in", SLEEP)
    driver = processes.driver(small.folder, "--workers", 2, "--terrane", program)
    until(sleepers)
    first = sleepers()[0]
    worker = first.parent()
    assert worker
    worker.kill()
    until(lambda: not first.is_running())
    until(sleepers)
    second = sleepers()[0]
    driver.terminate()
    driver.communicate(timeout=60)
    until(lambda: not second.is_running())


@pytest.mark.slow
def test_driver_and_scheduler_are_killed(large: Work, processes: Processes) -> None:
    address, scheduler = processes.cluster(3)
    driver = processes.driver(large.folder, "--scheduler", address)
    large.wait_for(10)
    driver.kill()
    scheduler.kill()
    until(lambda: not large.runs())
    done = len(list((large.folder / "objects").glob("*.json")))
    address, _ = processes.cluster(3)
    out, err = processes.driver(large.folder, "--scheduler", address).communicate(timeout=120)
    report = json.loads(out)
    assert report["skipped"] == done >= 10, err
    assert report["done"] == large.tasks - done and large.is_right()


def test_the_driver_is_killed_and_the_cluster_lives(small: Work, processes: Processes) -> None:
    address, _ = processes.cluster(2)
    program = stand_in(small.folder / "stand-in", SLEEP)
    driver = processes.driver(small.folder, "--scheduler", address, "--terrane", program)
    until(sleepers)
    small.wait_for(5)
    driver.kill()
    until(lambda: not sleepers() and not small.runs())
    done = len(list((small.folder / "objects").glob("*.json")))
    out, err = processes.driver(small.folder, "--scheduler", address).communicate(timeout=120)
    report = json.loads(out)
    assert (report["skipped"], report["done"]) == (done, small.tasks - done), err
    assert small.is_right()


@pytest.mark.slow
def test_the_scheduler_is_killed_and_the_driver_says_so(large: Work, processes: Processes) -> None:
    address, scheduler = processes.cluster(2)
    driver = processes.driver(large.folder, "--scheduler", address)
    large.wait_for(5)
    scheduler.kill()
    _, err = driver.communicate(timeout=90)
    assert driver.returncode == 69 and "the cluster is gone" in err and "Traceback" not in err


@pytest.mark.slow
def test_a_task_that_kills_its_worker_stops_the_job(large: Work, processes: Processes) -> None:
    """As one that runs out of memory may."""
    script = 'test "$task" = strip-9 && kill -9 $PPID'
    program = stand_in(large.folder / "stand-in", script)
    how = ["--workers", 2, "--terrane", program, "--retries", 1]
    driver = processes.driver(large.folder, *how)
    _, err = driver.communicate(timeout=120)
    assert driver.returncode == 69 and "strip-9: its worker died repeatedly" in err
