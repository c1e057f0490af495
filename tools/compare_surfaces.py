#!/usr/bin/env python3
"""Filled voids as GDAL has them, and differences and volumes as numpy has them, of real grids.

    compare_surfaces.py TERRANE DEM...

Discs of each grid are made void. Heights that differ from those of GDAL's fillnodata are found anew from all samples by
both rules, which assign samples on the axes to other quadrants; both are held against the heights that were there.
Differences are held against numpy on the same lattice, and against a reference in another system that is interpolated at
the positions of PROJ: the reprojected grids of rasterio are interpolated at approximate positions. Needs rasterio and
numpy. Exits with 1 where more differs than rounding explains.
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
import rasterio
from rasterio.fill import fillnodata
from rasterio.warp import Resampling, calculate_default_transform, reproject, transform, transform_bounds

NODATA = -99999.0
DISTANCE = 40
DISCS = 120
# Voids that are found anew.
CHECKED = 3000
# A part of a unit of heights: GDAL fills in single precision, and takes positions from PROJ, which agree to a hundredth of
# a millimetre.
MOST = 0.01
AXIS, SQUARED = 6378137.0, 0.006694379990141316


def read(path):
    with rasterio.open(path) as grid:
        return grid.read(1, masked=True).astype("f8").filled(np.nan), grid.profile


def write(path, heights, profile, **more):
    profile = {
        **{key: profile[key] for key in ("crs", "transform")}, "driver": "GTiff", "count": 1, "dtype": "float32",
        "height": heights.shape[0], "width": heights.shape[1], "nodata": NODATA, **more,
    }
    with rasterio.open(path, "w", **profile) as grid:
        grid.write(np.where(np.isnan(heights), NODATA, heights).astype(profile["dtype"]), 1)
    return path


def by_terrane(terrane, *words):
    """The heights that a run writes, its report and its seconds."""
    start = time.perf_counter()
    words = [str(word) for word in (terrane, *words, "--overwrite", "--json", "--threads", "1")]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    report = json.loads(done.stdout)
    return read(report["output"])[0], report, time.perf_counter() - start


def with_voids(heights, draw):
    """Heights with discs made void."""
    rows, columns = np.indices(heights.shape)
    holes = np.zeros(heights.shape, bool)
    for _ in range(DISCS):
        row, column, radius = (draw.uniform(0, most) for most in (*heights.shape, 18))
        holes |= (rows - row) ** 2 + (columns - column) ** 2 < radius**2
    return np.where(holes, np.nan, heights), holes & ~np.isnan(heights)


def nearest_exactly(right, squared):
    """Of equally near samples the one in the nearer column."""
    return np.lexsort((abs(right), squared))[0]


def nearest_of_gdal(right, squared):
    """The same by squares of rounded roots, as which GDAL keeps distances: some are greater than what they are roots of."""
    best, found = np.inf, 0
    for at in np.lexsort((squared, abs(right))):
        if squared[at] < best * best:
            best, found = np.sqrt(squared[at]), at
    return found


def filled(heights, row, column, quadrants, nearest_in):
    """The height of a void from all samples around it, by a rule of quadrants."""
    top, left = max(row - DISTANCE, 0), max(column - DISTANCE, 0)
    window = heights[top : row + DISTANCE + 1, left : column + DISTANCE + 1]
    rows, columns = np.nonzero(~np.isnan(window))
    down, right = rows + top - row, columns + left - column
    squared = down**2 + right**2
    values = window[rows, columns]
    total = weights = 0.0
    for own in quadrants(right, down):
        own = own & (squared <= DISTANCE**2)
        if own.any():
            nearest = nearest_in(right[own], squared[own])
            weight = 1 / np.sqrt(squared[own][nearest])
            total, weights = total + weight * values[own][nearest], weights + weight
    return total / weights if weights else np.nan


def of_terrane(right, down):
    return (
        (right >= 0) & (down < 0), (right > 0) & (down >= 0), (right <= 0) & (down > 0), (right < 0) & (down <= 0),
    )


def of_gdal(right, down):
    return (
        (right > 0) & (down <= 0), (right > 0) & (down > 0), (right <= 0) & (down > 0), (right <= 0) & (down <= 0),
    )


def alike(a, b, most=MOST):
    return (abs(a - b) <= most) | (np.isnan(a) & np.isnan(b))


def compare_fill(terrane, dem, folder):
    truth, profile = read(dem)
    truth = truth.astype("f4").astype("f8")
    heights, holes = with_voids(truth, np.random.default_rng(7))
    path = write(folder / "holes.tif", heights, profile)
    ours, report, seconds = by_terrane(terrane, "fill", path, folder / "o.tif", "--max-distance", DISTANCE)
    start = time.perf_counter()
    theirs = fillnodata(heights.astype("f4"), ~np.isnan(heights), DISTANCE, 0).astype("f8")
    voids = np.isnan(heights)
    # What is left, GDAL keeps as it was.
    reached = voids & ~np.isnan(ours)
    theirs[voids & ~np.isfinite(theirs)] = np.nan
    print(f"{dem.name}: {voids.sum()} voids, {seconds:.2f} s, GDAL {time.perf_counter() - start:.2f} s", end="; ")
    differing = np.argwhere(reached & ~alike(ours, theirs))
    chosen = np.random.default_rng(8).permutation(differing)[:CHECKED]
    explained, wrong = 0, 0
    for row, column in chosen:
        own = filled(heights, row, column, of_terrane, nearest_exactly)
        other = filled(heights, row, column, of_gdal, nearest_of_gdal)
        wrong += not alike(ours[row, column], own)
        explained += bool(alike(theirs[row, column], other))
    for row, column in np.random.default_rng(9).permutation(np.argwhere(voids))[:CHECKED]:
        wrong += not alike(ours[row, column], filled(heights, row, column, of_terrane, nearest_exactly))
    share = explained / max(len(chosen), 1)
    errors = [np.sqrt(np.nanmean((grid[holes & reached] - truth[holes & reached]) ** 2)) for grid in (ours, theirs)]
    print(
        f"{len(differing)} differ from GDAL, {share:.1%} of them by the rule for axes and ties; "
        f"RMSE {errors[0]:.3f}, GDAL {errors[1]:.3f}; {wrong} wrong"
    )
    counts = [report["filled"] - reached.sum(), report["left"] - np.isnan(ours).sum()]
    changed = ~alike(ours, heights, 0) & ~voids
    return wrong + (share < 0.99) + (errors[0] > 1.02 * errors[1]) + any(counts) + changed.sum()


def area(profile, shape):
    """Square metres of the cells of each row."""
    map = profile["transform"]
    if not profile["crs"].is_geographic:
        return np.full(shape[0], abs(map.a * map.e)) * profile["crs"].linear_units_factor[1] ** 2
    sine = np.sin(np.radians(map.f + map.e * np.arange(shape[0] + 1)))
    e = np.sqrt(SQUARED)
    band = AXIS**2 * (1 - SQUARED) / 2 * (sine / (1 - SQUARED * sine**2) + np.arctanh(e * sine) / e)
    return abs(np.diff(band)) * np.radians(map.a)


def compare_differences(terrane, dem, folder):
    heights, profile = read(dem)
    heights = heights.astype("f4").astype("f8")
    draw = np.random.default_rng(10)
    other = (with_voids(heights, draw)[0] + draw.normal(0.2, 1, heights.shape)).astype("f4").astype("f8")
    paths = [write(folder / f"{name}.tif", grid, profile) for name, grid in (("a", heights), ("b", other))]
    found, report, seconds = by_terrane(terrane, "difference", *paths, folder / "o.tif")
    expected = heights - other
    valid = expected[~np.isnan(expected)]
    wrong = (~alike(found, expected.astype("f4"), 0)).sum()
    volumes = expected * area(profile, heights.shape)[:, None]
    figures = {
        "compared": valid.size, "mean": valid.mean(), "rmse": np.sqrt((valid**2).mean()), "stdev": valid.std(),
        "mean_absolute": abs(valid).mean(), "lowest": valid.min(), "highest": valid.max(),
        "volume_above": np.nansum(volumes[expected > 0]), "volume_below": -np.nansum(volumes[expected < 0]),
    }
    # Cells of degrees by differences of bands lose five digits.
    odd = [name for name, value in figures.items() if abs(report[name] - value) > 1e-9 * max(1, abs(value))]
    print(f"  differences {seconds:.2f} s; {wrong} differ from numpy; {', '.join(odd) or 'no figure'} differs")
    return wrong + len(odd)


def bilinear(heights, rows, columns):
    """Heights between samples, where all four are valid; and whether the nearest is certainly void."""
    top, left = (np.floor(at).astype(int) for at in (rows, columns))
    padded = np.pad(heights, 2, constant_values=np.nan)
    down, right = rows - top, columns - left
    inside = (top >= -1) & (left >= -1) & (top < heights.shape[0]) & (left < heights.shape[1])
    top, left = (np.where(inside, at + 2, 0) for at in (top, left))
    mixed = (padded[top, left] * (1 - right) + padded[top, left + 1] * right) * (1 - down)
    mixed += (padded[top + 1, left] * (1 - right) + padded[top + 1, left + 1] * right) * down
    nearest = padded[top + (down > 0.5), left + (right > 0.5)]
    # On a border of cells, rounding decides which sample is nearest.
    is_sure = (abs(down - 0.5) > 1e-6) & (abs(right - 0.5) > 1e-6)
    return np.where(inside, mixed, np.nan), (np.isnan(nearest) | ~inside) & is_sure


def compare_reprojected(terrane, dem, folder):
    heights, profile = read(dem)
    heights = heights.astype("f4").astype("f8")
    crs, map = profile["crs"], profile["transform"]
    with rasterio.open(dem) as grid:
        bounds = grid.bounds
    west, south, east, north = transform_bounds(crs, "EPSG:4326", *bounds)
    utm = 32600 + int((west + east) / 2 // 6) + 31
    target = rasterio.crs.CRS.from_epsg(utm if crs.is_geographic else 4326)
    # Coarser than the grid, so that no kernel is widened.
    there, width, height = calculate_default_transform(crs, target, profile["width"], profile["height"], *bounds)
    there = there * there.scale(1.5)
    moved = np.full((height * 2 // 3, width * 2 // 3), np.nan)
    options = {"resampling": Resampling.bilinear, "src_nodata": np.nan, "dst_nodata": np.nan, "tolerance": 0}
    reproject(heights, moved, src_transform=map, src_crs=crs, dst_transform=there, dst_crs=target, **options)
    moved = moved.astype("f4").astype("f8")
    own = write(folder / "a.tif", heights, profile)
    reference = write(folder / "b.tif", moved, {"crs": target, "transform": there})
    found, report, seconds = by_terrane(terrane, "difference", own, reference, folder / "o.tif")
    rows, columns = (at.ravel() + 0.5 for at in np.indices(heights.shape))
    x, y = transform(crs, target, map.c + map.a * columns, map.f + map.e * rows)
    columns, rows = ~there * (np.array(x), np.array(y))
    back, is_void = bilinear(moved, rows - 0.5, columns - 0.5)
    expected = heights - back.reshape(heights.shape)
    known = ~np.isnan(expected)
    wrong = (known & ~alike(found, expected)).sum() + (is_void.reshape(heights.shape) & ~np.isnan(found)).sum()
    # Of all samples, those beside voids and the border, too.
    rmse = np.sqrt(np.nanmean(found**2))
    print(f"  reference in {target}: {seconds:.2f} s; {wrong} of {known.sum()} differ; RMSE {report['rmse']:.4f}, {rmse:.4f}")
    return wrong + int(abs(report["rmse"] - rmse) > 1e-6 * rmse)


def main():
    terrane, *dems = (pathlib.Path(name).resolve() for name in sys.argv[1:])
    compared = (compare_fill, compare_differences, compare_reprojected)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        wrong = sum(compare(terrane, dem, folder) for dem in dems for compare in compared)
    print(f"{wrong} values differ")
    sys.exit(1 if wrong or not dems else 0)


main()
