"""Races terrane against pydelatin and delatin on the same grids. Start it with `run`."""

import argparse
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import grids
import measure
import table
from contestants import CONTESTANTS
from tolerances import SHARES, Tolerances

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Tools:
    """Where everything is."""

    work: Path
    terrane: Path
    root: Path = HERE.parent.parent
    here: Path = HERE

    @property
    def python(self):
        return self.work / "venv/bin/python"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, required=True, help="folder for everything made")
    parser.add_argument("--terrane", type=Path, required=True, help="the program to race")
    parser.add_argument("--rounds", type=int, default=3, help="runs of each (default 3)")
    parser.add_argument("--grids", nargs="+", choices=grids.NAMES, default=grids.NAMES)
    parser.add_argument("--shares", nargs="+", type=float, choices=SHARES, default=SHARES,
                        help="shares of the samples that pydelatin keeps")
    parser.add_argument("--contestants", nargs="+", metavar="WORD", default=[""],
                        help="only those whose names hold one of the words; pydelatin always runs")
    parser.add_argument("--retune", action="store_true", help="search for all tolerances again")
    return parser.parse_args()


def chosen(words):
    fits = lambda c: any(word in c.name for word in words)
    return [c for i, c in enumerate(CONTESTANTS) if i == 0 or fits(c)]


def race(tools, grid, share, tolerance, contestants, rounds):
    """All rounds of one job, the order turned by one each round; one row per contestant."""
    runs = {c.name: [] for c in contestants}
    meshes = {c.name: tools.work / "meshes" / f"{grid.name}-{c.slug()}.mesh" for c in contestants}
    for turn in range(rounds):
        for i in range(len(contestants)):
            c = contestants[(turn + i) % len(contestants)]
            note(f"{grid.name} at {tolerance:g}: round {turn + 1} of {rounds}, {c.name}")
            runs[c.name].append(c.run(tools, grid, tolerance, meshes[c.name]))
    return [row(tools, grid, share, tolerance, c, runs[c.name], meshes[c.name]) for c in contestants]


def row(tools, grid, share, tolerance, contestant, runs, mesh):
    """Medians of the runs, and what the independent check says of the last mesh."""
    middle = lambda key: median(getattr(run, key) for run in runs)
    checked = measure.run([tools.python, HERE / "check.py", grid.raw, grid.meta, tolerance, mesh])
    mesh.unlink()
    return {
        "grid": grid.name,
        "samples": grid.samples,
        "share": share,
        "tolerance": tolerance,
        "contestant": contestant.name,
        "wall": middle("wall"),
        "cpu": middle("cpu"),
        "kernels": None if runs[0].kernels is None else middle("kernels"),
        "peak_mib": max(run.peak_mib for run in runs),
        "cpu_of_rounds": [run.cpu for run in runs],
        **json.loads(checked.stdout.splitlines()[-1]),
    }


def note(text):
    print(text, file=sys.stderr, flush=True)


def header(tools, options):
    return {
        "date": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
        "machine": measure.machine(),
        "commit": measure.commit(tools.root),
        "command": " ".join(["benches/peers/run", *sys.argv[5:]]),
        "rounds": options.rounds,
    }


def main():
    options = arguments()
    tools = Tools(options.work.resolve(), options.terrane.resolve())
    (tools.work / "meshes").mkdir(parents=True, exist_ok=True)
    results = {**header(tools, options), "rows": [], "skipped": []}
    tolerances = Tolerances(HERE / "tolerances.json")
    for name in options.grids:
        grid = grids.prepare(name, tools)
        if grid is None:
            note(f"{name}: skipped, no {grids.data_folder(tools.root) / grids.REAL[name]}")
            results["skipped"].append(name)
            continue
        for share in options.shares:
            tolerance = tolerances.of(tools, grid, share, options.retune)
            results["rows"] += race(
                tools, grid, share, tolerance, chosen(options.contestants), options.rounds
            )
            text = json.dumps(results, indent=1) + "\n"
            (tools.work / "results.json").write_text(text, encoding="utf-8")
    print(table.markdown(results))


if __name__ == "__main__":
    try:
        main()
    except measure.Failed as failure:
        sys.exit(str(failure))
