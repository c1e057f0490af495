#!/usr/bin/env python3
"""Ground that terrane finds, beside the points that people classified as ground, or that are known to be it.

    compare_ground.py TERRANE [CLOUD...] [--methods pmf,csf,...] [--most-cells 8]

For each cloud and method: a model of the ground in cells of a metre from what the method finds, against the one
from points of class 2 (root mean square in metres, and the share of cells that are off by more than half a
metre); and of the last returns that are no noise the ground that was refused (type I) and what else was taken for
it (type II). Clouds made by terrane come first; their ground is known. At the end, how many times the error of the
best method each has, in the geometric mean over clouds and at worst. Exits with 1 where `csf-ptd` has more such
cells than --most-cells percent. Needs numpy, rasterio and laspy with lazrs.
"""
import argparse
import pathlib
import subprocess
import sys
import tempfile

import laspy
import numpy as np
import rasterio

MADE = ["cloud,size=400,density=6,seed=3", "cloud,size=400,density=2,seed=11"]
NOISE = (7, 18)


def model(run, cloud, path, ground, cell):
    """Heights of a model in metres, and metres of a unit."""
    run("grid", cloud, path, "--dtm", "--ground", ground, "--cell", cell)
    with rasterio.open(path) as grid:
        heights = grid.read(1, masked=True).filled(np.nan)
        unit = grid.crs.linear_units_factor[1] if grid.crs and grid.crs.is_projected else 1.0
    return heights * unit, unit


def classes(before, after):
    """Shares of ground refused and of others taken, of last returns that are no noise."""
    number, returns, kind = (np.asarray(before[name]) for name in ("return_number", "number_of_returns", "classification"))
    looked = (number >= returns) & ~np.isin(kind, NOISE)
    is_ground, is_found = (np.asarray(cloud.classification)[looked] == 2 for cloud in (before, after))
    return (is_ground & ~is_found).sum() / is_ground.sum(), (~is_ground & is_found).sum() / max(1, (~is_ground).sum())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("terrane", type=pathlib.Path)
    parser.add_argument("clouds", nargs="*", type=pathlib.Path)
    parser.add_argument("--methods", default="pmf,smrf,csf,ptd,csf-ptd")
    parser.add_argument("--most-cells", type=float, default=8.0, metavar="PERCENT")
    args = parser.parse_args()
    compared = worse = 0
    errors = []
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)

        def run(*words):
            words = [str(word) for word in (args.terrane.resolve(), *words, "-q", "--overwrite")]
            subprocess.run(words, check=True, cwd=folder)

        made = []
        for number, name in enumerate(MADE):
            made.append(folder / f"made{number}.laz")
            run("synth", name, made[-1])
        for cloud in [*made, *(path.resolve() for path in args.clouds)]:
            before = laspy.read(cloud)
            if (np.asarray(before.classification) == 2).sum() < 100:
                continue
            cell = 1.0
            expected, unit = model(run, cloud, folder / "class.tif", "class", cell)
            if unit != 1.0:
                cell = 1.0 / unit
                expected, _ = model(run, cloud, folder / "class.tif", "class", cell)
            errors.append({})
            for method in args.methods.split(","):
                found, _ = model(run, cloud, folder / "found.tif", method, cell)
                off = np.abs(found - expected)
                off = off[np.isfinite(off)]
                run("points", cloud, folder / "found.laz", "--classify", "ground", "--ground", method)
                kinds = classes(before, laspy.read(folder / "found.laz"))
                cells = 100 * (off > 0.5).mean()
                compared += 1
                errors[-1][method] = np.sqrt((off**2).mean())
                worse += method == "csf-ptd" and cells > args.most_cells
                print(f"{cloud.name} {method}: {np.sqrt((off**2).mean()):.3f} m, {cells:.2f} % of cells; "
                      f"type I {100 * kinds[0]:.1f} %, type II {100 * kinds[1]:.1f} %", flush=True)
    for method in args.methods.split(",") if errors else []:
        # Five millimetres are no difference.
        times = [max(one[method], 0.005) / max(min(one.values()), 0.005) for one in errors]
        mean = np.exp(np.log(times).mean())
        print(f"{method}: {mean:.3f} times the best in the geometric mean, {max(times):.2f} at worst")
    print(f"{worse} of {compared} are worse than they may be")
    return 1 if worse or not compared else 0


if __name__ == "__main__":
    sys.exit(main())
