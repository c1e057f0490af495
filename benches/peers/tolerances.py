"""Which tolerance makes pydelatin keep a given share of the samples. Standard library only."""

import json
import math

import measure

SHARES = [0.002, 0.01, 0.05]
CLOSE_ENOUGH = 0.05
MAX_STEPS = 8


class Tolerances:
    """Tolerances found earlier, kept in a file so that reruns race the same jobs."""

    def __init__(self, path):
        self.path = path
        self.known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}

    def of(self, tools, grid, share, anew=False):
        """The tolerance for a share of the grid's samples; searched for when not known."""
        found = self.known.setdefault(grid.name, {})
        if anew or f"{share:g}" not in found:
            found[f"{share:g}"] = search(tools, grid, share)
            text = json.dumps(self.known, indent=2) + "\n"
            self.path.write_text(text, encoding="utf-8")
        return found[f"{share:g}"]


def search(tools, grid, share):
    """Bisection on the logarithm, after a start from the error that so many vertices leave."""
    wanted = share * grid.samples
    tolerance = three_digits(call(tools, grid, f"points={wanted:.0f}")["error"])
    low = high = None
    best = (math.inf, tolerance)
    for _ in range(MAX_STEPS):
        kept = call(tools, grid, tolerance)["vertices"]
        best = min(best, (abs(math.log(kept / wanted)), tolerance))
        if best[0] < CLOSE_ENOUGH:
            break
        low, high = (tolerance, high) if kept > wanted else (low, tolerance)
        tolerance = three_digits(between(low, high))
        if tolerance in (low, high):
            break
    return best[1]


def between(low, high):
    """The middle of a bracket, or a step out of it while one end is open."""
    if low is None:
        return high / 1.5
    return low * 1.5 if high is None else math.sqrt(low * high)


def three_digits(value):
    return float(f"{value:.3g}")


def call(tools, grid, goal):
    script = tools.here / "call_pydelatin.py"
    cost = measure.run([tools.python, script, grid.raw, grid.width, grid.height, goal])
    return json.loads(cost.stdout.splitlines()[-1])
