#!/usr/bin/env python3
"""The out-of-core run: a terrain far larger than the memory allowed, tile by tile.

A 16384^2 f32 store (1 GiB) is triangulated from warm pages with one thread and with two, and then
with `--memory 128M` inside a memory cgroup of 128 MiB, from warm pages and from pages that were
evicted first (only those are charged to the group). Prints a markdown table and writes
target/peers/scale.json. Standard library only.

Rates of stages are samples / seconds x threads: the stage alone, as if all threads were at it.
"""

import argparse
import contextlib
import json
import re
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "peers"))

import measure  # noqa: E402  (found by the path above)

ROOT = HERE.parent
MIB = 1 << 20
CAP = 128 * MIB
STAGES = ["read", "tiles", "seams", "write"]
ENTER = 'echo $$ > "$0/cgroup.procs" && exec "$@"'


@dataclass(frozen=True)
class Case:
    """One way of doing the job."""

    name: str
    options: tuple
    threads: int
    capped: bool = False
    evicted: bool = False


CASES = [
    Case("greedy, 1 thread", ("--no-drop",), 1),
    Case("greedy, 2 threads", ("--no-drop",), 2),
    Case("drop, 1 thread", (), 1),
    Case("drop, 2 threads", (), 2),
    Case("greedy, 2 threads, 128 MiB, warm", ("--no-drop",), 2, capped=True),
    Case("greedy, 2 threads, 128 MiB, evicted", ("--no-drop",), 2, capped=True, evicted=True),
    Case("drop, 2 threads, 128 MiB, warm", (), 2, capped=True),
    Case("drop, 2 threads, 128 MiB, evicted", (), 2, capped=True, evicted=True),
]


class Group:
    """A memory cgroup of version 1 or 2, removed at the end."""

    def __init__(self, folder, limit, peak):
        self.folder, self.limit, self.peak_file = folder, limit, peak

    def __enter__(self):
        self.folder.mkdir()
        try:
            (self.folder / self.limit).write_text(str(CAP))
        except OSError:
            self.folder.rmdir()
            raise
        return self

    def __exit__(self, *_):
        self.folder.rmdir()

    def peak_mib(self):
        file = self.folder / self.peak_file
        return int(file.read_text()) / MIB if file.is_file() else None


def new_group():
    """A group that can be made here, or `None`."""
    name, root = f"terrane-scale-{os.getpid()}", Path("/sys/fs/cgroup")
    v1 = Group(root / "memory" / name, "memory.limit_in_bytes", "memory.max_usage_in_bytes")
    v2 = Group(root / name, "memory.max", "memory.peak")
    for group in (v1, v2):
        if (group.folder.parent / "cgroup.procs").is_file():
            with contextlib.suppress(OSError), group:
                return group
    return None


def evict(path):
    """Drops the file's clean pages from the page cache."""
    with open(path, "rb") as file:
        os.fsync(file.fileno())
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def warm(path):
    """Reads the whole file, so that its pages are in the page cache."""
    with open(path, "rb") as file:
        while file.read(16 * MIB):
            pass


def run_case(case, options, store, group):
    """Medians over the rounds, as a row of the table."""
    rounds = [run_once(case, options, store, group) for _ in range(options.rounds)]
    middle = lambda key: median(r[key] for r in rounds)
    last = rounds[-1]
    return {
        **{key: last[key] for key in ("vertices", "triangles", "kept", "samples")},
        "case": case.name,
        "threads": case.threads,
        "wall": middle("wall"),
        "cpu": middle("cpu"),
        "peak_mib": max(r["peak_mib"] for r in rounds),
        "group_peak_mib": last["group_peak_mib"],
        "stages": {name: middle(name) for name in STAGES},
        "walls_of_rounds": [r["wall"] for r in rounds],
    }


def run_once(case, options, store, group):
    """One timed run, without the error figures of a report: they cost a pass of their own."""
    mesh = options.work / "mesh.ply"
    argv = [options.terrane, "tin", store, mesh, "--max-error", options.max_error, *case.options]
    argv += ["--threads", case.threads, "--overwrite"]
    (evict if case.evicted else warm)(store)
    print(f"{case.name} ...", file=sys.stderr, flush=True)
    if case.capped:
        with group:
            cost = measure.run(["sh", "-c", ENTER, group.folder, *argv, "--memory", "128M"])
            group_peak = group.peak_mib()
    else:
        cost, group_peak = measure.run(argv), None
    return {
        "wall": cost.wall, "cpu": cost.cpu, "peak_mib": cost.peak_mib, "group_peak_mib": group_peak,
        **told(cost.stdout),
    }


def told(summary):
    """What the summary of a run says: counts, and seconds of each stage over all threads."""
    count = lambda name: int(re.search(rf"{name} +([\d,]+)", summary)[1].replace(",", ""))
    seconds = dict(re.findall(r"(read|tiles|seams|write) ([\d.]+) s", summary))
    samples, vertices = count("samples"), count("vertices")
    return {
        "samples": samples, "vertices": vertices, "triangles": count("triangles"),
        "kept": vertices / samples, **{name: float(seconds.get(name, 0)) for name in STAGES},
    }


def markdown(results):
    heads = ["case", "wall s", "CPU s", "M samples/s", *(f"{s} M/s" for s in STAGES), "peak MiB",
             "group peak MiB"]
    yield from (f"{key}: {results[key]}  " for key in ("date", "machine", "commit", "command", "job"))
    yield from (f"Skipped: {text}" for text in results["skipped"])
    yield ""
    yield f"| {' | '.join(heads)} |"
    yield f"|---|{'---:|' * (len(heads) - 1)}"
    for row in results["rows"]:
        yield f"| {' | '.join(cells(row))} |"
    yield ""
    yield from scaling(results["rows"])


def cells(row):
    rate = lambda seconds: row["samples"] / seconds / 1e6 if seconds else float("inf")
    stages = [f"{rate(row['stages'][name] / row['threads']):.0f}" for name in STAGES]
    group = "" if row["group_peak_mib"] is None else f"{row['group_peak_mib']:.0f}"
    return [
        row["case"], f"{row['wall']:.2f}", f"{row['cpu']:.2f}", f"{rate(row['wall']):.0f}",
        *stages, f"{row['peak_mib']:.0f}", group,
    ]


def scaling(rows):
    """Two threads against one, for each method that was run with both."""
    walls = {row["case"]: row["wall"] for row in rows}
    for method in ("greedy", "drop"):
        one, two = (walls.get(f"{method}, {n}") for n in ("1 thread", "2 threads"))
        if one and two:
            yield f"Two threads against one, {method}, whole job: {one / two:.2f}x."


def arguments():
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    parser = argparse.ArgumentParser(description="Times the out-of-core run.")
    parser.add_argument("--terrane", type=Path, default=target / "release/terrane")
    parser.add_argument("--work", type=Path, default=target / "peers/scale")
    parser.add_argument("--size", type=int, default=16384, help="samples along a side")
    parser.add_argument("--max-error", type=float, default=3.0, help="keeps about 1 %% (default 3)")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default="", metavar="WORD", help="cases whose names hold the word")
    return parser.parse_args()


def make_store(options):
    store = options.work / f"rough-{options.size}.tif"
    options.work.mkdir(parents=True, exist_ok=True)
    if not store.is_file():
        terrain = f"rough,size={options.size},seed=7"
        measure.run([options.terrane, "synth", terrain, store, "--quiet"])
    return store


def main():
    options = arguments()
    results = {
        "date": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
        "machine": measure.machine(),
        "commit": measure.commit(ROOT),
        "command": " ".join(["benches/scale.py", *sys.argv[1:]]),
        "skipped": [],
        "rows": [],
    }
    store, group = make_store(options), new_group()
    for case in (case for case in CASES if options.only in case.name):
        if case.capped and group is None:
            results["skipped"].append(f"{case.name}, no memory cgroup can be made here.  ")
            continue
        results["rows"].append(run_case(case, options, store, group))
    kept = ", ".join(f"{r['case']} {100 * r['kept']:.2f} %" for r in results["rows"][:4])
    results["job"] = f"rough {options.size}^2 at {options.max_error:g}; kept: {kept}"
    (options.work / "scale.json").write_text(json.dumps(results, indent=1) + "\n")
    print("\n".join(markdown(results)))


if __name__ == "__main__":
    try:
        main()
    except measure.Failed as failure:
        sys.exit(str(failure))
