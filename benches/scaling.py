#!/usr/bin/env python3
"""How time, memory and vertices grow with samples, threads, tile size and tolerance.

Runs `terrane tin` on synthetic terrain of 1k^2 up to 32k^2 samples, every size with every number of
threads, tile size and tolerance (large sizes with the first tile size and tolerance only), and
writes `scaling.csv`, `scaling.svg` and a markdown table. Terrain comes from the generator as it is
read, so its time is part of the stage "read". Times are medians over the rounds, fitted by
a*n + b*m for n samples and m vertices. Standard library only.
"""

import argparse
import csv
import json
import math
import os
import sys
import time
from itertools import product
from pathlib import Path
from statistics import median

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "peers"))

import measure  # noqa: E402  (found by the path above)

ROOT = HERE.parent
STAGES = ["read", "tiles", "seams", "write"]
COLUMNS = ["size", "samples", "threads", "tile", "max_error", "seconds", "cpu", "msamples_s",
           "peak_mib", "vertices", "kept", *STAGES]
COLOURS = ["#1b6ca8", "#c8553d", "#588157", "#6d597a", "#bc6c25", "#333333"]


def combinations(options):
    """Sizes with all else; beyond `--cross-up-to` with the first tile size and tolerance only."""
    for size, threads, tile, error in product(
        options.sizes, options.threads, options.tiles, options.max_errors
    ):
        if size <= options.cross_up_to or (tile, error) == (options.tiles[0], options.max_errors[0]):
            yield size, threads, tile, error


def run_case(size, threads, tile, error, options):
    rounds = [run_once(size, threads, tile, error, options) for _ in range(options.rounds)]
    last = rounds[-1]
    middle = {key: median(r[key] for r in rounds) for key in ("seconds", "cpu", *STAGES)}
    return {**last, **middle, "peak_mib": max(r["peak_mib"] for r in rounds),
            "msamples_s": last["samples"] / middle["seconds"] / 1e6}


def run_once(size, threads, tile, error, options):
    mesh, report = options.work / "mesh.ply", options.work / "report.json"
    terrain = f"synth:{options.terrain},size={size + 1},seed=7"
    argv = [options.terrane, "tin", terrain, mesh, "--max-error", error, "--tile", tile,
            "--threads", threads, "--overwrite", "--report", report, "--quiet"]
    print(f"{size}^2, {threads} threads, tile {tile}, error {error} ...", file=sys.stderr, flush=True)
    cost = measure.run(argv)
    told = json.loads(report.read_text())
    stages = {stage["name"]: stage["thread_seconds"] for stage in told["stages"]}
    return {
        "size": size, "samples": told["samples"], "threads": threads, "tile": tile,
        "max_error": error, "seconds": cost.wall, "cpu": cost.cpu, "peak_mib": cost.peak_mib,
        "vertices": told["vertices"], "kept": told["kept"],
        **{name: stages.get(name, 0.0) for name in STAGES},
    }


def fit(rows):
    """The a and b of `seconds = a*n + b*m` with the least sum of squared relative errors."""
    terms = [(r["samples"] / r["seconds"], r["vertices"] / r["seconds"]) for r in rows]
    nn, nm, mm = (sum(f(n, m) for n, m in terms)
                  for f in (lambda n, _: n * n, lambda n, m: n * m, lambda _, m: m * m))
    n1, m1 = sum(n for n, _ in terms), sum(m for _, m in terms)
    determinant = nn * mm - nm * nm
    if determinant <= 1e-12 * nn * mm:
        return n1 / nn, 0.0
    return (n1 * mm - m1 * nm) / determinant, (m1 * nn - n1 * nm) / determinant


def table(rows):
    yield "| samples | threads | tile | max error | s | M samples/s | peak MiB | vertices | kept |"
    yield "|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
    for r in rows:
        yield (f"| {r['size']}^2 | {r['threads']} | {r['tile']} | {r['max_error']} |"
               f" {r['seconds']:.2f} | {r['msamples_s']:.1f} | {r['peak_mib']:.0f} |"
               f" {r['vertices']:,} | {100 * r['kept']:.3f} % |")
    yield ""
    large = [r for r in rows if r["size"] >= 4096]
    for threads in sorted({r["threads"] for r in large}):
        own = [r for r in large if r["threads"] == threads]
        a, b = fit(own)
        worst = max(abs(a * r["samples"] + b * r["vertices"] - r["seconds"]) / r["seconds"] for r in own)
        yield (f"{threads} thread{'s' * (threads > 1)}, from 4096^2 on: {a * 1e9:.2f} ns a sample +"
               f" {b * 1e9:.0f} ns a vertex; off by {100 * worst:.0f} % at most.")
    yield from efficiency(rows)


def efficiency(rows):
    """Two threads against one, for every case run with both."""
    key = lambda r: (r["size"], r["tile"], r["max_error"])
    one = {key(r): r["seconds"] for r in rows if r["threads"] == 1}
    two = {key(r): r["seconds"] for r in rows if r["threads"] == 2}
    shares = {k: one[k] / two[k] / 2 for k in one if k in two and k[0] >= 4096}
    if shares:
        low, high = min(shares.values()), max(shares.values())
        yield (f"Efficiency of two threads, from 4096^2 on: {100 * median(shares.values()):.0f} %"
               f" ({100 * low:.0f} to {100 * high:.0f}).")


def plot(rows, path):
    """Seconds over samples, both logarithmic, a line for each number of threads, tile and error."""
    width, height, left, bottom = 760, 480, 70, 60
    logs = lambda key: [math.log10(r[key]) for r in rows]
    x0, x1 = math.floor(min(logs("samples"))), math.ceil(max(logs("samples")))
    y0, y1 = math.floor(min(logs("seconds"))), math.ceil(max(logs("seconds")))
    x = lambda v: left + (math.log10(v) - x0) / (x1 - x0) * (width - left - 190)
    y = lambda v: height - bottom - (math.log10(v) - y0) / (y1 - y0) * (height - bottom - 30)
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
             'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>']
    for p in range(x0, x1 + 1):
        parts.append(f'<path d="M{x(10**p):.1f} {y(10**y0):.1f}V{y(10**y1):.1f}" stroke="#ddd"/>'
                     f'<text x="{x(10**p):.1f}" y="{height - bottom + 18}" text-anchor="middle">1e{p}</text>')
    for p in range(y0, y1 + 1):
        parts.append(f'<path d="M{left} {y(10**p):.1f}H{width - 190}" stroke="#ddd"/>'
                     f'<text x="{left - 8}" y="{y(10**p) + 4:.1f}" text-anchor="end">{10.0**p:g}</text>')
    series = {}
    for r in rows:
        series.setdefault((r["threads"], r["tile"], r["max_error"]), []).append(r)
    for i, ((threads, tile, error), own) in enumerate(sorted(series.items())):
        colour = COLOURS[i % len(COLOURS)]
        dashes = "" if threads == 1 else ' stroke-dasharray="5 3"'
        points = " ".join(f"{x(r['samples']):.1f},{y(r['seconds']):.1f}" for r in own)
        dots = "".join(f'<circle cx="{x(r["samples"]):.1f}" cy="{y(r["seconds"]):.1f}" r="3"/>' for r in own)
        label = f"{threads} thr, tile {tile}, {error}"
        parts.append(f'<g stroke="{colour}" fill="{colour}"><polyline points="{points}" fill="none"{dashes}/>{dots}</g>'
                     f'<text x="{width - 180}" y="{40 + 16 * i}" fill="{colour}">{label}</text>')
    parts.append(f'<text x="{(left + width - 190) / 2}" y="{height - 15}" text-anchor="middle">samples</text>'
                 f'<text x="16" y="{height / 2}" transform="rotate(-90 16 {height / 2})" '
                 'text-anchor="middle">seconds</text></svg>')
    path.write_text("\n".join(parts) + "\n")


def numbers(kind):
    return lambda text: [kind(word) for word in text.split(",")]


def arguments():
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    parser = argparse.ArgumentParser(description="How a job grows.")
    parser.add_argument("--terrane", type=Path, default=target / "release/terrane")
    parser.add_argument("--work", type=Path, default=target / "peers/scaling")
    parser.add_argument("--terrain", default="rough")
    parser.add_argument("--sizes", type=numbers(int), default=[1024, 2048, 4096, 8192, 16384, 32768])
    parser.add_argument("--threads", type=numbers(int), default=[1, 2])
    parser.add_argument("--tiles", type=numbers(int), default=[512, 256, 1024])
    parser.add_argument("--max-errors", type=numbers(float), default=[6.0, 2.0])
    parser.add_argument("--cross-up-to", type=int, default=8192, metavar="SIZE")
    parser.add_argument("--rounds", type=int, default=3)
    return parser.parse_args()


def main():
    options = arguments()
    options.work.mkdir(parents=True, exist_ok=True)
    rows = [run_case(*case, options) for case in combinations(options)]
    with open(options.work / "scaling.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    plot(rows, options.work / "scaling.svg")
    print(f"date: {time.strftime('%Y-%m-%d')}  \ncommand: {' '.join(sys.argv)}  \n")
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
