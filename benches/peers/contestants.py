"""The contestants: each runs a job once and tells what it took. Standard library only."""

import json
from dataclasses import dataclass
from typing import Callable

import measure


@dataclass(frozen=True)
class Run:
    """One run. Peers: the call alone. terrane: the process, and inside it the kernels."""

    wall: float
    cpu: float
    peak_mib: float
    kernels: float | None = None


@dataclass(frozen=True)
class Contestant:
    """A name for the table, and what runs a job (tools, grid, tolerance, mesh file to write)."""

    name: str
    run: Callable

    def slug(self):
        return "".join(c if c.isalnum() else "-" for c in self.name)


def terrane(*options):
    """The whole process, reading and writing included. A second run asks for the report."""

    def run(tools, grid, tolerance, mesh):
        ply = mesh.with_suffix(".ply")
        report = mesh.with_suffix(".json")
        argv = [tools.terrane, "tin", grid.tif, ply, "--max-error", tolerance]
        argv += ["--overwrite", "--quiet", *options]
        cost = measure.run(argv)
        told = measure.run([*argv, "--report", report])
        ply.replace(mesh)
        return Run(cost.wall, cost.cpu, cost.peak_mib, told.cpu * kernel_share(report))

    return run


def kernel_share(report):
    """The share of the stages that do what the peers' call does.

    The share, and not the seconds: a worker that has to wait for a busy processor takes longer in
    every stage, which the CPU time of the process does not show.
    """
    stages = json.loads(report.read_text(encoding="utf-8"))["stages"]
    kernels = sum(s["cpu_seconds"] for s in stages if s["name"] in ("tiles", "seams"))
    return kernels / sum(s["cpu_seconds"] for s in stages)


def called(argv):
    facts = json.loads(measure.run(argv).stdout.splitlines()[-1])
    return Run(facts["wall"], facts["cpu"], facts["peak_mib"])


def pydelatin(tools, grid, tolerance, mesh):
    script = tools.here / "call_pydelatin.py"
    return called([tools.python, script, grid.raw, grid.width, grid.height, tolerance, mesh])


def delatin(tools, grid, tolerance, mesh):
    script, module = tools.here / "call_delatin.mjs", tools.work / "npm/node_modules/delatin"
    # Its arrays grow with the mesh; node's default heap is too small for the largest of them.
    argv = ["node", "--max-old-space-size=8192", script, module]
    return called([*argv, grid.raw, grid.width, grid.height, tolerance, mesh])


PEER = "pydelatin"
CONTESTANTS = [
    Contestant(PEER, pydelatin),
    Contestant("delatin (npm)", delatin),
    Contestant("terrane greedy, 1 thread", terrane("--no-drop", "--threads", "1")),
    Contestant("terrane, 1 thread", terrane("--threads", "1")),
    Contestant("terrane, 2 threads", terrane("--threads", "2")),
]
