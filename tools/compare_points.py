#!/usr/bin/env python3
"""Compares points that terrane writes with those it read, as laspy reads both.

    python3 tools/compare_points.py [--terrane target/debug/terrane] [FILE...]

Each file (and some made by terrane) is written as LAS and LAZ, whose points must be those of the
input in every dimension, one by one; and as COPC, of which laspy's own reader of octrees must find
all points, those of a box, and each in one level; heights above the ground must be those above scipy's
triangulation of it; points that keep a distance must do so for scipy's tree, and leave no room; noise must be
that by scipy's tree and by numpy's table of cubes. Prints a line for each and exits with 1 when
anything differs. Needs numpy, scipy and laspy with lazrs.
"""

import argparse
import os
import subprocess
import sys
import tempfile

import laspy
import numpy as np
from laspy.copc import Bounds, CopcReader
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import cKDTree

MADE = ["cloud,size=300,density=6,seed=3", "cloud,width=900,height=60,density=9,seed=4"]


def rows(points, names):
    """Points as rows of numbers, places as they are in the world."""
    return np.column_stack([np.asarray(points[name], dtype=np.float64) for name in names])


def sorted_rows(all_rows):
    return all_rows[np.lexsort(all_rows.T)]


def dimensions(las):
    """Its dimensions by name; the coordinates come scaled."""
    places = {"X": "x", "Y": "y", "Z": "z"}
    return [places.get(name, name) for name in las.point_format.dimension_names]


def compare_file(before, after):
    """What differs between two files that should hold the same points in the same order."""
    if before.point_format.id != after.point_format.id:
        yield f"point format {after.point_format.id} of {before.point_format.id}"
    # Of several records that describe extra bytes laspy reads one, and calls what is behind that ExtraBytes.
    named = [after if name == "ExtraBytes" else name for name, after in zip(dimensions(before), dimensions(after))]
    if len(dimensions(before)) != len(named) or named != dimensions(after):
        yield f"dimensions {dimensions(after)} of {dimensions(before)}"
        return
    for old, new in zip(dimensions(before), named):
        if not np.array_equal(np.ravel(before[old]), np.ravel(after[new])):
            yield f"values of {old}"
    system = lambda las: las.header.parse_crs()
    if system(before) != system(after):
        yield "the reference system"


def compare_octree(before, path):
    """What differs between a file and the octree of its points."""
    with CopcReader.open(path) as reader:
        found = reader.query()
        names = [name for name in dimensions(before) if name in dimensions(reader.header)]
        names = [name for name in names if name not in ("scan_angle_rank", "scan_angle")]
        expected = rows(before, names)
        if not np.array_equal(sorted_rows(rows(found, names)), sorted_rows(expected)):
            yield "points"
        levels = [len(reader.query(level=level)) for level in range(16)]
        if sum(levels) != len(expected) or levels[0] == 0:
            yield f"points by level {levels}"
        low, high = reader.header.mins, reader.header.maxs
        box = [low + (high - low) * share for share in (0.31, 0.57)]
        inside = np.all([(before[a] >= box[0][i]) & (before[a] <= box[1][i]) for i, a in enumerate("xy")], axis=0)
        seen = reader.query(Bounds(mins=box[0][:2], maxs=box[1][:2]))
        if not np.array_equal(sorted_rows(rows(seen, names)), sorted_rows(expected[inside])):
            yield f"{len(seen)} of {inside.sum()} points of a box"


def compare_heights(before, after):
    """What differs between heights above the ground and those above scipy's triangulation of class 2."""
    ground = before.points[(before.classification == 2) & (before.withheld == 0)]
    # Of points at one place the lowest counts.
    places = np.column_stack([ground.X, ground.Y, ground.Z])
    places = places[np.lexsort(places.T[::-1])]
    places = places[np.unique(places[:, :2], axis=0, return_index=True)[1]].astype(float)
    # Far from zero scipy rounds too much.
    middle = places[:, :2].mean(axis=0)
    surface = LinearNDInterpolator(places[:, :2] - middle, places[:, 2])
    expected = before.Z - surface(np.column_stack([before.X, before.Y]) - middle)
    step = before.header.scales[2]
    found = np.where(np.asarray(after.HeightAboveGround.array) == -2**31, np.nan, after.HeightAboveGround / step)
    void = np.isnan(expected) != np.isnan(found)
    # Four places on a circle have two triangulations, and a border has roundings.
    off = np.nan_to_num(np.abs(expected - found)) > 0.51
    if void.mean() > 1e-3 or off.mean() > 1e-3:
        yield f"{void.sum()} heights in one only, {off.sum()} others of {len(off)}"


def compare_distances(before, after, least):
    """What is wrong with points of a file that keep a distance in space."""
    # Whole steps from a corner of the cloud: far from zero doubles are too coarse.
    corner = np.array([before.X.min(), before.Y.min(), before.Z.min()], dtype=np.int64)
    steps = lambda las: np.column_stack([las.X, las.Y, las.Z]).astype(np.int64)
    places = lambda las: (steps(las) - corner) * las.header.scales
    kept = cKDTree(places(after))
    near = kept.query(places(after), k=2)[0][:, 1].min() if len(after) > 1 else least
    far = kept.query(places(before))[0].max()
    hair = 1e-9 * least
    if near < least - hair or far >= least + hair:
        yield f"{len(after)} points {near} from each other, and one {far} from all"


def noise_by_cubes(places, steps, side, most):
    """Points with no more than so many in the 27 cubes around and with their own, which are so many steps."""
    cubes = places // np.round(side / steps).astype(int)
    cubes, own, counts = np.unique(cubes, axis=0, return_inverse=True, return_counts=True)
    beside = cKDTree(cubes).query_ball_point(cubes, 1, p=np.inf)
    return np.array([counts[near].sum() <= most for near in beside])[own.ravel()]


def noise_by_distances(places, steps, k, m):
    """Points whose mean distance to their nearest others is far above the mean of that; and which are near the limit."""
    places = (places - places.min(axis=0)) * steps
    mean = cKDTree(places).query(places, k=k + 1)[0][:, 1:].mean(axis=1)
    limit = mean.mean() + m * mean.std(ddof=1)
    return mean > limit, np.abs(mean - limit) < steps.max() / 500


def compare_noise(before, after, method):
    """What differs between classes and those of a slow search in another program's trees."""
    classes = np.asarray(before.classification).copy()
    seen = ~np.isin(classes, [7, 18]) & (np.asarray(before.withheld) == 0)
    crs = before.header.parse_crs()
    metres = [axis.unit_conversion_factor for axis in crs.axis_info] if crs else [1.0]
    # Heights of no known unit are in that of x and y.
    steps = before.header.scales * np.array([metres[0], metres[0], metres[2] if len(metres) > 2 else metres[0]])
    zero = np.round(before.header.offsets / before.header.scales).astype(np.int64)
    places = (np.column_stack([before.X, before.Y, before.Z]).astype(np.int64) + zero)[seen]
    if method == "voxel":
        noise, unsure = noise_by_cubes(places, steps, 2.0, 9), False
    else:
        noise, unsure = noise_by_distances(places, steps, 8, 2.0)
    classes[np.flatnonzero(seen)[noise]] = 7
    differs = classes != np.asarray(after.classification)
    differs[np.flatnonzero(seen)] &= ~np.broadcast_to(unsure, noise.shape)
    if differs.any() or not noise.any() and len(noise) > 10000 and method == "statistical":
        yield f"{differs.sum()} classes by {method}, {noise.sum()} of noise"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--terrane", default="target/debug/terrane")
    parser.add_argument("files", nargs="*")
    args = parser.parse_args()
    terrane = os.path.abspath(args.terrane)
    compared = differing = 0
    with tempfile.TemporaryDirectory() as folder:
        run = lambda *words: subprocess.run([terrane, *words, "-q", "--overwrite"], check=True, cwd=folder)
        made = []
        for number, name in enumerate(MADE):
            path = os.path.join(folder, f"made{number}.laz")
            run("synth", name, path, "--point-format", str(3 + 4 * number))
            made.append(path)
        for file in [*made, *map(os.path.abspath, args.files)]:
            before = laspy.read(file)
            for ending in ["las", "laz", "copc.laz"]:
                path = os.path.join(folder, f"out.{ending}")
                run("points", file, path)
                found = compare_octree(before, path) if ending == "copc.laz" else compare_file(before, laspy.read(path))
                wrong = list(found)
                if ending == "laz" and (np.asarray(before.classification) == 2).sum() > 100:
                    run("points", file, path, "--height-above-ground")
                    wrong += compare_heights(before, laspy.read(path))
                if ending == "las":
                    for least in [0.7, 5]:
                        run("points", file, path, "--thin-distance", str(least))
                        wrong += compare_distances(before, laspy.read(path), least)
                if ending == "laz":
                    for method, asked in [("voxel", "voxel:step=2,isolated=9"), ("statistical", "statistical")]:
                        run("points", file, path, "--classify", f"noise:{asked}")
                        wrong += compare_noise(before, laspy.read(path), method)
                compared += 1
                differing += bool(wrong)
                print(f"{os.path.basename(file)} as {ending}: {'; '.join(wrong) or f'{len(before)} points, the same'}")
    print(f"{differing} of {compared} differ")
    return 1 if differing or not compared else 0


if __name__ == "__main__":
    sys.exit(main())
