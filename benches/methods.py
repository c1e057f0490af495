#!/usr/bin/env python3
"""What the methods of the textbooks take, beside the engine: vertices, and how the time grows.

Runs `terrane tin --method` on synthetic terrain of growing size at one tolerance, until a size would take
a method too long. Then the four versions of greedy insertion twice more: with a fixed number of vertices m
on growing grids of n samples, and with a growing m on one grid. Growth is the slope of log(time) over log(n)
or log(m); beside it stands that of the formula of `docs/src/guide/methods.md`, taken at the same places.
Writes `methods.svg` and prints tables. Times are the CPU seconds of the whole process on one thread, reading
included, less those of the smallest job there is; the least of the rounds. Standard library only.
"""

import argparse
import json
import math
import os
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "peers"))

import measure  # noqa: E402  (found by the path above)

ROOT = HERE.parent
WAYS = {
    "greedy": [], "greedy --fit-heights": ["--fit-heights"],
    **{name: ["--method", name] for name in (
        "greedy1", "greedy2", "greedy3", "greedy4", "drop", "collapse", "kdtree", "rtin", "vip")},
}
# Work by the analysis, up to a factor.
ANALYSIS = {
    "greedy1": ("m n", lambda m, n: m * n),
    "greedy2": ("m n", lambda m, n: m * n),
    "greedy3": ("(m + n) log m log n", lambda m, n: (m + n) * math.log(m) * math.log(n)),
    "greedy4": ("(m + n) log m", lambda m, n: (m + n) * math.log(m)),
}
COLOURS = ["#111111", "#8a8a8a", "#d1495b", "#e08e2b", "#8b8000", "#3a7d44", "#1b6ca8", "#0fa3b1",
           "#6d597a", "#b5179e", "#bc6c25"]
# Times below this are left out of slopes: they are those of starting a program.
LEAST = 0.01


class Bench:
    """Grids and runs in a folder."""

    def __init__(self, options):
        self.options = options
        options.work.mkdir(parents=True, exist_ok=True)
        self.base = 0.0
        self.base = self.run(9, "greedy4", ["--max-vertices", 9])["seconds"]

    def grid(self, side):
        path = self.options.work / f"{side}.tif"
        terrain = f"{self.options.terrain},size={side},seed=7"
        measure.run([self.options.terrane, "synth", terrain, path, "--overwrite", "-q"])
        return path

    def run(self, side, way, goal):
        grid, mesh = self.grid(side), self.options.work / "mesh.ply"
        argv = [self.options.terrane, "tin", grid, mesh, *goal, *WAYS[way], "--threads", 1,
                "--overwrite", "--json"]
        rows = []
        while len(rows) < self.options.rounds and not (rows and rows[0][0] > self.options.long):
            cost = measure.run(argv)
            rows.append((cost.cpu, json.loads(cost.stdout)))
        seconds, told = min(rows, key=lambda row: row[0])
        print(f"{side}^2 {way} {goal}: {seconds:.2f} s", file=sys.stderr, flush=True)
        return {"side": side, "n": side * side, "m": told["vertices"], "error": told["max_error"],
                "seconds": max(seconds - self.base, 1e-4)}


def at_one_tolerance(bench):
    """Every method on growing grids, while a size can be had in the time."""
    series = {}
    for way in WAYS:
        rows = series[way] = []
        for side in bench.options.sides:
            if rows and rows[-1]["seconds"] * expected_growth(rows) > bench.options.most:
                break
            rows.append(bench.run(side, way, ["--max-error", bench.options.max_error]))
    return series


def expected_growth(rows):
    """How much longer four times the samples take: by the last two sizes, at least four times."""
    return 4 if len(rows) < 2 else max(4, rows[-1]["seconds"] / rows[-2]["seconds"])


def with_fixed_vertices(bench):
    goal = ["--max-vertices", bench.options.vertices[0]]
    sides = [side for side in bench.options.sides if side > 100]
    return {way: [bench.run(side, way, goal) for side in sides] for way in ANALYSIS}


def on_one_grid(bench):
    side = bench.options.side
    goals = [["--max-vertices", count] for count in bench.options.vertices]
    return {way: [bench.run(side, way, goal) for goal in goals] for way in ANALYSIS}


def slope(pairs):
    """Of log y over log x, by least squares; None for fewer than two places."""
    logs = [(math.log(x), math.log(y)) for x, y in pairs]
    if len(logs) < 2:
        return None
    mean = [sum(values) / len(logs) for values in zip(*logs)]
    over = sum((x - mean[0]) * (y - mean[1]) for x, y in logs)
    return over / sum((x - mean[0]) ** 2 for x, _ in logs)


def slopes(way, rows, by):
    """Measured, and by the analysis where there is a formula."""
    rows = [row for row in rows if row["seconds"] >= LEAST]
    work = ANALYSIS[way][1] if way in ANALYSIS else None
    measured = slope([(row[by], row["seconds"]) for row in rows])
    return measured, slope([(row[by], work(row["m"], row["n"])) for row in rows]) if work else None


def told(value):
    return "" if value is None else f"{value:.2f}"


def tables(tolerance, fixed, growing, options):
    yield f"`{options.terrain}`, largest error {options.max_error}: vertices, and CPU seconds\n"
    yield "| method | " + " | ".join(f"{s} x {s}" for s in options.sides) + " | growth by n |"
    yield "|---|" + "---:|" * (len(options.sides) + 1)
    for way, rows in tolerance.items():
        cells = [f"{row['m']:,}, {row['seconds']:.2f}" for row in rows]
        cells += [""] * (len(options.sides) - len(rows))
        yield f"| `{way}` | {' | '.join(cells)} | {told(slopes(way, rows, 'n')[0])} |"
    yield "\nGrowth of greedy insertion, measured / by the analysis\n"
    yield (f"| method | work | by n, m is {options.vertices[0]} | by m, n is {options.side}^2 "
           f"| by n, error {options.max_error} |")
    yield "|---|---|---:|---:|---:|"
    for way, (formula, _) in ANALYSIS.items():
        cells = [slopes(way, fixed[way], "n"), slopes(way, growing[way], "m"),
                 slopes(way, tolerance[way], "n")]
        yield (f"| `{way}` | {formula} | "
               + " | ".join(f"{told(a)} / {told(b)}" for a, b in cells) + " |")


def plot(tolerance, growing, options):
    left = Chart(60, "samples", [r["n"] for rows in tolerance.values() for r in rows],
                 [r["seconds"] for rows in tolerance.values() for r in rows],
                 f"every method, largest error {options.max_error}")
    right = Chart(520, "vertices", [r["m"] for rows in growing.values() for r in rows],
                  [r["seconds"] for rows in growing.values() for r in rows],
                  f"{options.side} x {options.side} samples; dashed: the analysis")
    colours = dict(zip(WAYS, COLOURS))
    for way, rows in tolerance.items():
        left.line([(r["n"], r["seconds"]) for r in rows], colours[way])
    for way, rows in growing.items():
        right.line([(r["m"], r["seconds"]) for r in rows], colours[way])
        work = [ANALYSIS[way][1](r["m"], r["n"]) for r in rows]
        last = rows[-1]["seconds"] / work[-1]
        right.line([(r["m"], w * last) for r, w in zip(rows, work)], colours[way], dashed=True)
    legend = [f'<g stroke="{colour}" fill="{colour}"><path d="M880 {64 + 20 * i}h22" stroke-width="2"/>'
              f'<text x="908" y="{68 + 20 * i}" stroke="none">{way}</text></g>'
              for i, (way, colour) in enumerate(colours.items())]
    head = ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1010 420" font-family="sans-serif" '
            'font-size="12"><rect width="100%" height="100%" fill="white"/>')
    options.svg.write_text("\n".join([head, *left.parts, *right.parts, *legend, "</svg>"]) + "\n")


class Chart:
    """Two logarithmic axes, and lines between them."""

    def __init__(self, left, what, xs, ys, title):
        self.box = (left, 40, left + 330, 360)
        self.x_range = padded(xs)
        self.y_range = padded([y for y in ys if y >= LEAST / 2])
        x0, y0, x1, y1 = self.box
        self.parts = [f'<text x="{(x0 + x1) / 2}" y="24" text-anchor="middle">{title}</text>',
                      f'<path d="M{x0} {y0}H{x1}V{y1}H{x0}Z" fill="none" stroke="#999"/>',
                      f'<text x="{(x0 + x1) / 2}" y="{y1 + 40}" text-anchor="middle">{what}</text>',
                      f'<text x="{x0 - 44}" y="{(y0 + y1) / 2}" text-anchor="middle" '
                      f'transform="rotate(-90 {x0 - 44} {(y0 + y1) / 2})">CPU seconds</text>']
        for v in ticks(self.x_range):
            self.parts.append(f'<path d="M{self.x(v):.1f} {y0}V{y1}" stroke="#e4e4e4"/>'
                              f'<text x="{self.x(v):.1f}" y="{y1 + 18}" text-anchor="middle">{v:,.0f}</text>')
        for v in ticks(self.y_range):
            self.parts.append(f'<path d="M{x0} {self.y(v):.1f}H{x1}" stroke="#e4e4e4"/>'
                              f'<text x="{x0 - 6}" y="{self.y(v) + 4:.1f}" text-anchor="end">{v:g}</text>')

    def x(self, value):
        low, high = self.x_range
        x0, _, x1, _ = self.box
        return x0 + math.log(value / low) / math.log(high / low) * (x1 - x0)

    def y(self, value):
        low, high = self.y_range
        _, y0, _, y1 = self.box
        return y1 - math.log(value / low) / math.log(high / low) * (y1 - y0)

    def line(self, points, colour, dashed=False):
        seen = [(self.x(x), self.y(y)) for x, y in points if y >= self.y_range[0]]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in seen)
        style = ' stroke-dasharray="3 4"' if dashed else ' stroke-width="2"'
        dots = "" if dashed else "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2"/>' for x, y in seen)
        self.parts.append(f'<g stroke="{colour}" fill="{colour}"><polyline points="{path}" fill="none"{style}/>'
                          f"{dots}</g>")


def padded(values):
    return min(values) / 1.3, max(values) * 1.3


def ticks(bounds):
    """Powers of ten within the bounds, or where there are few, two and five times them as well."""
    low, high = bounds
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1,), (1, 3), (1, 2, 5)):
        found = [s * 10.0**p for p in powers for s in steps if low <= s * 10.0**p <= high]
        if len(found) >= 3:
            break
    return found


def numbers(text):
    return [int(word) for word in text.split(",")]


def arguments():
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    binary = Path(os.environ.get("TERRANE", target / "release/terrane"))
    parser = argparse.ArgumentParser(description="The methods beside each other, and how they grow.")
    parser.add_argument("--terrane", type=Path, default=binary)
    parser.add_argument("--work", type=Path, default=target / "peers/methods")
    parser.add_argument("--svg", type=Path, default=ROOT / "docs/src/guide/methods.svg")
    parser.add_argument("--terrain", default="rough")
    parser.add_argument("--max-error", type=float, default=5.0)
    parser.add_argument("--sides", type=numbers, default=[65, 129, 257, 513, 1025])
    parser.add_argument("--side", type=int, default=257, help="of the grid for growing numbers of vertices")
    parser.add_argument("--vertices", type=numbers, default=[250, 500, 1000, 2000])
    parser.add_argument("--most", type=float, default=15.0, help="seconds that a size may be expected to take")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--long", type=float, default=1.0, help="seconds from which one round is enough")
    return parser.parse_args()


def main():
    options = arguments()
    started = time.perf_counter()
    bench = Bench(options)
    tolerance, fixed, growing = at_one_tolerance(bench), with_fixed_vertices(bench), on_one_grid(bench)
    plot(tolerance, growing, options)
    print(f"{time.strftime('%Y-%m-%d')}; {measure.machine()}; {measure.commit(ROOT)}; "
          f"{time.perf_counter() - started:.0f} s in all; `{' '.join(sys.argv)}`\n")
    print("\n".join(tables(tolerance, fixed, growing, options)))


if __name__ == "__main__":
    main()
