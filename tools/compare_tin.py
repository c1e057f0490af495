#!/usr/bin/env python3
"""Compares `terrane grid --stat tin` with scipy's linear Delaunay interpolation, cell by cell.

    tools/compare_tin.py [--terrane PATH] [--cell 1] [--class 2] CLOUD...

Both take the lowest of points at one position. Exits with 1 when a cell has a value in one and none
in the other, or values differ by more than 1e-6. (Where four points lie on one circle both
triangulations of them are right, and may differ: that would show here.) Needs laspy, lazrs, numpy,
scipy and rasterio.
"""

import argparse
import os
import subprocess
import sys
import tempfile

import laspy
import numpy as np
import rasterio
from scipy.interpolate import LinearNDInterpolator

SLACK = 1e-6


def terrane_grid(terrane, cloud, cell, points, folder):
    """Values and transform."""
    output = os.path.join(folder, "tin.tif")
    options = ["--stat", "tin", "--class", points, "--type", "float64", "--overwrite", "-q"]
    subprocess.run([terrane, "grid", cloud, output, "--cell", str(cell), *options], check=True)
    with rasterio.open(output) as grid:
        return grid.read(1, masked=True).filled(np.nan), grid.transform


def scipy_grid(cloud, points, shape, transform):
    """The same from scipy, in steps of the file's coordinates around their mean."""
    las = laspy.read(cloud)
    wanted = np.isin(np.asarray(las.classification), [int(code) for code in points.split(",")])
    x, y, z = (np.asarray(values)[wanted] for values in (las.X, las.Y, las.z))
    order = np.lexsort((z, y, x))
    x, y, z = x[order], y[order], z[order]
    first = np.r_[True, (np.diff(x) != 0) | (np.diff(y) != 0)]
    x, y, z = x[first], y[first], z[first]
    columns = transform.c + (np.arange(shape[1]) + 0.5) * transform.a
    rows = transform.f + (np.arange(shape[0]) + 0.5) * transform.e
    middle = x.mean(), y.mean()
    u = (columns - las.header.offsets[0]) / las.header.scales[0] - middle[0]
    v = (rows - las.header.offsets[1]) / las.header.scales[1] - middle[1]
    surface = LinearNDInterpolator(np.c_[x - middle[0], y - middle[1]], z)
    return surface(*np.meshgrid(u, v))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--terrane", default="terrane")
    parser.add_argument("--cell", type=float, default=1.0)
    parser.add_argument("--class", dest="points", default="2")
    parser.add_argument("clouds", nargs="+")
    args = parser.parse_args()
    wrong = 0
    for cloud in args.clouds:
        with tempfile.TemporaryDirectory() as folder:
            ours, transform = terrane_grid(args.terrane, cloud, args.cell, args.points, folder)
        theirs = scipy_grid(cloud, args.points, ours.shape, transform)
        in_both = np.isfinite(ours) & np.isfinite(theirs)
        in_one = (np.isfinite(ours) != np.isfinite(theirs)).sum()
        apart = np.abs(ours - theirs)[in_both]
        print(f"{cloud}: {in_both.sum()} cells in both, {in_one} in one, apart by {apart.max():.1e}")
        wrong += in_one + (apart > SLACK).sum()
    sys.exit(int(wrong > 0))


if __name__ == "__main__":
    main()
