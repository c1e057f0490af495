#!/usr/bin/env python3
"""Compares what `terrane grid` tells of attributes, classes and layers with laspy, numpy and scipy.

usage: compare_metrics.py TERRANE CLOUD... (needs laspy[lazrs], numpy, scipy; clouds of point format 8)

For each cloud a table of cells of 5 units is made by terrane and told again from the points. The largest difference
of each statistic is printed, as a share of it where it is above 1; the exit code is 1 when one is too large.
"""
import csv
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np
from scipy import stats

CELL = 5.0
SLACK = 1e-10


def entropy(z, layer):
    """Of the heights from 0 on, as lidR has it."""
    if z.max() < 2 * layer or z.min() < 0:
        return np.nan
    layers = math.ceil(z.max() / layer)
    shares = np.histogram(z, np.arange(layers + 1) * layer)[0] / len(z)
    return stats.entropy(shares) / math.log(layers)


def mode(values):
    found, often = np.unique(values, return_counts=True)
    return found[often.argmax()]


def of_any(statistic):
    """NaN of no values."""
    return lambda values: statistic(values) if len(values) else np.nan


def of_varied(statistic):
    """NaN of values that are all one."""
    return lambda values: statistic(values) if np.ptp(values) > 0 else np.nan


def statistics(base):
    """By name, from the points of a cell; `base` is a height below all."""
    kurtosis = of_varied(lambda z: stats.kurtosis(z, fisher=False))
    mean, p90 = of_any(np.mean), of_any(lambda z: np.percentile(z, 90))
    return {
        "count": lambda p: len(p["z"]),
        "skewness": lambda p: of_varied(stats.skew)(p["z"]),
        "kurtosis": lambda p: kurtosis(p["z"]),
        "entropy:layer=20": lambda p: entropy(p["z"], 20.0),
        "mode": lambda p: mode(p["classification"]),
        "variety": lambda p: len(np.unique(p["classification"])),
        "max:attribute=intensity": lambda p: p["intensity"].max(),
        "std:attribute=intensity": lambda p: p["intensity"].std(),
        "p37:attribute=angle": lambda p: np.percentile(p["angle"], 37),
        "mean:attribute=time": lambda p: p["gps_time"].mean(),
        "std:attribute=time": lambda p: p["gps_time"].std(),
        "p95:attribute=time": lambda p: np.percentile(p["gps_time"], 95),
        "range:attribute=nir": lambda p: np.ptp(p["nir"]),
        "mean:attribute=red,class=2": lambda p: mean(p["red"][p["classification"] == 2]),
        "count:class=3+4+5": lambda p: np.isin(p["classification"], (3, 4, 5)).sum(),
        "count:return=only": lambda p: (p["number_of_returns"] == 1).sum(),
        f"share:min={base},max={base + 30}": lambda p: (
            (p["z"] >= base) & (p["z"] < base + 30)
        ).mean(),
        f"cover:above={base + 50}": lambda p: mean(
            (p["z"] > base + 50)[p["return_number"] == 1].astype(float)
        ),
        f"p90:above={base + 20.5}": lambda p: p90(p["z"][p["z"] > base + 20.5]),
    }


def points(cloud):
    """What is known of the points that are not withheld, by name."""
    las = laspy.read(cloud)
    kept = np.asarray(las.withheld) == 0
    names = ["classification", "gps_time", "intensity", "nir", "number_of_returns", "red", "return_number"]
    found = {name: np.asarray(las[name])[kept].astype(float) for name in names}
    found["angle"] = np.asarray(las.scan_angle)[kept] * 0.006
    return found | {axis: np.asarray(las[axis])[kept] for axis in "xyz"}


def table(terrane, cloud, names):
    """The values of each cell by its column and row."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "table.csv"
        subprocess.run(
            [terrane, "grid", cloud, output, "--cell", str(CELL), "--stat", ",".join(names),
             "--type", "float64", "-q"],
            check=True,
        )
        with open(output, newline="", encoding="utf-8") as file:
            heading, *rows = csv.reader(file)
    assert heading == ["x", "y", *names], heading
    return {
        (math.floor(float(x) / CELL), math.floor(float(y) / CELL)):
            [float(value or "nan") for value in values]
        for x, y, *values in rows
    }


def compare(terrane, cloud):
    """Prints the differences for one cloud; returns whether all are small."""
    known = points(cloud)
    wanted = statistics(math.floor(known["z"].min()))
    found = table(terrane, cloud, wanted)
    at = [np.floor(known[axis] / CELL + 1e-9).astype(int) for axis in "xy"]
    cells = {}
    for point, cell in enumerate(zip(*at)):
        cells.setdefault(cell, []).append(point)
    assert found.keys() == cells.keys()
    worst = dict.fromkeys(wanted, 0.0)
    for cell, own in cells.items():
        some = {name: values[own] for name, values in known.items()}
        for (name, statistic), value in zip(wanted.items(), found[cell]):
            expected = statistic(some)
            is_void = np.isnan(value) and np.isnan(expected)
            apart = 0.0 if is_void else abs(value - expected) / max(1.0, abs(expected))
            worst[name] = max(worst[name], math.inf if np.isnan(apart) else apart)
    print(f"{Path(cloud).name}, {len(cells)} cells, {len(known['z'])} points:")
    for name, value in worst.items():
        print(f"  {name:32} {value:.1e}")
    return all(value <= SLACK for value in worst.values())


def main():
    terrane, *clouds = sys.argv[1:]
    done = [compare(terrane, cloud) for cloud in clouds]
    sys.exit(0 if done and all(done) else 1)


if __name__ == "__main__":
    main()
