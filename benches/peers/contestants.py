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
        edges = told.cpu * edge_share(report)
        return Run(cost.wall, cost.cpu, cost.peak_mib, max(cost.cpu - edges, 0.0))

    return run


def edge_share(report):
    """The share of a run with a report that reading and writing took.

    The share, and not the seconds: a worker that has to wait for a busy processor takes longer in
    every stage, which the CPU time of the process does not show.
    """
    stages = json.loads(report.read_text(encoding="utf-8"))["stages"]
    edges = sum(s["thread_seconds"] for s in stages if s["name"] in ("read", "write"))
    return edges / sum(s["thread_seconds"] for s in stages)


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
