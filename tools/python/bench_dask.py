#!/usr/bin/env python3
"""Measures the overhead of Dask: wall time by Dask with one worker, beside the sum of the program's
own wall times.

    python bench_overhead.py [--terrane PATH] [--seconds 30] [--strips 4] [--folder FOLDER]

A synthetic plan is made whose strips take about `--seconds` each on this machine, one thread,
measured on a small plan first. Prints JSON: `overhead` is that of the job on a cluster that is up,
`with_start` that of the job and of starting and stopping the cluster. 0.05 is the most it may be
with tasks of 30 seconds.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
import time
from pathlib import Path

from distributed import Client

from terrane.dask.driver import Driver, Job

WIDTH, TILE = 4096, 512


def plan(terrane: str, folder: Path, rows: int, strips: int) -> None:
    """A plan with a number of strips and rows of tiles."""
    grid = f"synth:rough,width={WIDTH},height={rows * strips * TILE},seed=3"
    how = ["--max-error", "0.2", "--tile", str(TILE), "--strip-rows", str(rows), "-q"]
    subprocess.run([terrane, "plan", "tin", grid, "-o", str(folder), *how], check=True)


def seconds_a_row(terrane: str, folder: Path) -> float:
    """Seconds per row of tiles, from a plan of a single strip."""
    plan(terrane, folder, 2, 1)
    started = time.monotonic()
    how = ["--task", "strip-0", "--threads", "1", "-q"]
    subprocess.run([terrane, "run", str(folder), *how], check=True)
    return (time.monotonic() - started) / 2


def main() -> None:
    """Plans, runs, reports."""
    parser = argparse.ArgumentParser(description="Measure what Dask adds to the work.")
    parser.add_argument("--terrane", default="terrane", help="the program")
    parser.add_argument("--seconds", type=float, default=30.0, help="a strip, about")
    parser.add_argument("--strips", type=int, default=4)
    parser.add_argument("--folder", help="for the plans [default: the system's temporary one]")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=args.folder) as folder:
        row = seconds_a_row(args.terrane, Path(folder, "small"))
        rows = max(2, round(args.seconds / row))
        plan(args.terrane, Path(folder, "work"), rows, args.strips)
        started = time.monotonic()
        how = {"processes": True, "memory_limit": None, "dashboard_address": None}
        with Client(n_workers=1, threads_per_worker=1, **how) as client:
            report = Driver(client, Job(str(Path(folder, "work")), args.terrane)).run()
        whole = time.monotonic() - started
    figures = {
        "tasks": report.tasks,
        "batches": report.batches,
        "work_seconds": round(report.work_seconds, 3),
        "wall_seconds": round(report.wall_seconds, 3),
        "overhead": round(report.wall_seconds / report.work_seconds - 1, 4),
        "with_start": round(whole / report.work_seconds - 1, 4),
    }
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
