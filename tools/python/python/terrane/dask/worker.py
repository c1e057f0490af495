"""Dask worker: calls the program for each task of a batch.

Functions are sent to the workers by value, so workers need only Dask and the program.
"""

from __future__ import annotations

import contextlib
import errno
import importlib.util
import json
import os
import shutil
import socket
import subprocess
import sys
import time
from typing import TypedDict

from distributed import get_worker

# Becomes the program, which Linux then asks to stop (signal 15) when the thread that started it
# ends, as it does when the worker is killed. Not a preexec_fn: those may lock up in a process that
# has threads.
LEASH = """
import ctypes, os, sys
ctypes.CDLL(None).prctl(1, 15, 0, 0, 0)
if os.getppid() == int(sys.argv[1]):
    os.execv(sys.argv[2], sys.argv[2:])
"""
# Exit code of a task in a cancelled batch, as of an interrupted program.
INTERRUPTED = 130


class Result(TypedDict):
    """Result of a task: exit code of the program; seconds by its own clock, and including start and end; whether the
    task was made or already done; error message."""

    id: str
    code: int
    work_seconds: float
    seconds: float
    made: bool
    message: str


def run_batch(command: list[str], tasks: list[list[str]], delay: float) -> list[Result]:
    """Waits `delay` seconds, then calls `command` with the arguments of each task (the first is its name); stops
    after the first failure."""
    time.sleep(delay)
    called = [*program(command[0]), *command[1:], "--task"]
    results: list[Result] = []
    for task in tasks:
        results.append(_run_task([*called, *task], task[0]))
        if results[-1]["code"] != 0:
            break
    return results


def program(name: str) -> list[str]:
    """The command of the program `name`. By default that of this package, or `terrane` if it is not installed."""
    with contextlib.suppress(ImportError, ValueError):
        if not name and importlib.util.find_spec("terrane._terrane"):
            return [sys.executable, "-m", "terrane"]
    found = shutil.which(name or "terrane")
    if found is None:
        told = f"program {name or 'terrane'} not found on {socket.gethostname()}"
        raise FileNotFoundError(errno.ENOENT, told)
    return [found]


def _run_task(command: list[str], task: str) -> Result:
    started = time.monotonic()
    code, out, err = _call(command)
    seconds = time.monotonic() - started
    report = json.loads(out) if code == 0 else {}
    lines = err.strip().splitlines() or [f"{task}: the program ended with code {code}"]
    return Result(
        id=task,
        code=code,
        work_seconds=report.get("wall_seconds", 0.0),
        seconds=seconds,
        made=task in report.get("made", ()),
        message="" if code == 0 else lines[-1][-1000:],
    )


def _call(command: list[str]) -> tuple[int, str, str]:
    """Exit code, output and messages of a program, which is stopped if its batch is cancelled."""
    if not _is_wanted():
        return INTERRUPTED, "", ""
    if sys.platform == "linux":
        command = [sys.executable, "-I", "-S", "-c", LEASH, str(os.getpid()), *command]
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while _is_wanted():
        with contextlib.suppress(subprocess.TimeoutExpired):
            out, err = process.communicate(timeout=1)
            return process.returncode, out, err
    # Once only: a second signal makes the program exit without cleanup.
    process.terminate()
    out, err = process.communicate()
    return process.returncode, out, err


def _is_wanted() -> bool:
    """False if this batch was cancelled, by the driver or by the scheduler."""
    worker = get_worker()
    task = worker.state.tasks.get(worker.get_current_task())
    return task is not None and task.state == "executing"
