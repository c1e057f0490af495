"""Runs a command and tells what it cost. Standard library only.

A process inherits the peak of the one it was forked from, so the caller has to stay small: nothing
in the racing process imports numpy.
"""

import os
import subprocess
import time
from dataclasses import dataclass


@dataclass(frozen=True)
class Cost:
    """What a whole process took: seconds, and MiB resident at the peak."""

    wall: float
    cpu: float
    peak_mib: float
    stdout: str


class Failed(Exception):
    """A command that did not end well."""


def run(argv, env=None):
    """Runs `argv` to its end; raises `Failed` with its messages when it exits with an error."""
    argv = [str(arg) for arg in argv]
    started = time.perf_counter()
    with subprocess.Popen(
        argv, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=env
    ) as child:
        stdout = child.stdout.read()
        _, status, usage = os.wait4(child.pid, 0)
        wall = time.perf_counter() - started
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise Failed(f"exit {child.returncode}: {' '.join(argv)}\n{stdout.strip()}")
    return Cost(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, stdout)


def machine():
    """One line about the computer and how busy it is."""
    model = "unknown processor"
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        names = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    model = names[0] if names else model
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    load = os.getloadavg()[0]
    return f"{model}, {vectors()}, {os.cpu_count()} cores, {memory:.0f} GiB; load average {load:.1f} at the start"


def vectors():
    """The widest vectors of the processor."""
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        flags = next((line for line in file if line.startswith("flags")), "").split()
    return "AVX-512" if "avx512f" in flags else "AVX2" if "avx2" in flags else "no AVX2"


def commit(root):
    """The revision that is checked out, with a mark when files differ from it."""
    argv = ["git", "-C", str(root), "describe", "--always", "--dirty", "--exclude", "*"]
    try:
        return run(argv).stdout.strip()
    except (Failed, FileNotFoundError):
        return "unknown revision"
