#!/usr/bin/env python3
"""Compares `terrane grid` cell by cell with laspy and numpy.

usage: compare_grid.py TERRANE CLOUD... (needs laspy[lazrs], numpy, rasterio)

For each cloud, grids of several cell sizes are made by terrane and told again from the points with
numpy: count, min, max, mean, std, median, p95, and idw by brute force on a part of the cells. The
largest difference of each is printed; the exit code is 1 when one is too large.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np
import rasterio

STATS = ["count", "min", "max", "mean", "std", "median", "p95", "idw"]
SLACK = {"count": 0.0, "idw": 1e-6}
USUAL_SLACK = 2e-7


def grid(terrane, cloud, cell, output):
    """Makes the grid and returns its bands, nodata as NaN, with its north-western corner."""
    subprocess.run(
        [terrane, "grid", cloud, output, "--cell", str(cell), "--stat", ",".join(STATS),
         "--type", "float64", "-q"],
        check=True,
    )
    with rasterio.open(output) as file:
        assert list(file.descriptions) == STATS, file.descriptions
        assert file.nodata == -9999 and file.transform.e == -cell, file.profile
        bands = {name: file.read(i + 1) for i, name in enumerate(STATS)}
        return {k: np.where(v == -9999, np.nan, v) for k, v in bands.items()}, file.transform


def statistics(x, y, z, shape, transform, cell):
    """The same, but for idw, from points sorted by cell."""
    height, width = shape
    col = np.floor(x / cell + 1e-9).astype(np.int64) - round(transform.c / cell)
    row = round(transform.f / cell) - 1 - np.floor(y / cell + 1e-9).astype(np.int64)
    assert col.min() >= 0 and col.max() < width and row.min() >= 0 and row.max() < height
    key = row * width + col
    order = np.lexsort((z, key))
    key, z = key[order], z[order]
    cells, first, count = np.unique(key, return_index=True, return_counts=True)
    out = {name: np.full(height * width, np.nan) for name in STATS}
    out["count"][:] = 0
    out["count"][cells] = count
    out["min"][cells] = z[first]
    out["max"][cells] = z[first + count - 1]
    mean = np.add.reduceat(z - z.mean(), first) / count + z.mean()
    out["mean"][cells] = mean
    spread = np.add.reduceat((z - np.repeat(mean, count)) ** 2, first)
    out["std"][cells] = np.sqrt(spread / count)
    for name, rank in [("median", 50), ("p95", 95)]:
        place = rank / 100 * (count - 1)
        low = np.floor(place).astype(np.int64)
        high = np.minimum(low + 1, count - 1)
        out[name][cells] = z[first + low] + (z[first + high] - z[first + low]) * (place - low)
    return {name: values.reshape(shape) for name, values in out.items()}


def idw(x, y, z, transform, cell, picked):
    """Inverse distance weighting of all points within cell * sqrt(2), for the picked cells."""
    radius = cell * np.sqrt(2)
    order = np.argsort(x)
    x, y, z = x[order], y[order], z[order]
    for row, col in picked:
        cx, cy = transform.c + (col + 0.5) * cell, transform.f - (row + 0.5) * cell
        part = slice(np.searchsorted(x, cx - radius), np.searchsorted(x, cx + radius, "right"))
        distance = np.hypot(x[part] - cx, y[part] - cy)
        near = distance < radius - 1e-9
        distance, height = distance[near], z[part][near]
        if not near.any():
            yield np.nan
        elif (distance < 1e-9).any():
            yield height[distance < 1e-9].min()
        else:
            yield np.sum(height / distance) / np.sum(1 / distance)


def apart(found, expected):
    """Largest difference; infinite where only one of both is void."""
    if (np.isnan(found) != np.isnan(expected)).any():
        return np.inf
    return float(np.nanmax(np.abs(found - expected), initial=0.0))


def compare(terrane, cloud, cell, folder):
    """Prints the differences for one cloud and cell size; returns whether all are small."""
    found, transform = grid(terrane, cloud, cell, str(Path(folder) / "grid.tif"))
    las = laspy.read(cloud)
    kept = np.asarray(las.withheld) == 0 if "withheld" in las.point_format.dimension_names else ...
    x, y, z = (np.asarray(v)[kept] for v in (las.x, las.y, las.z))
    shape = found["count"].shape
    expected = statistics(x, y, z, shape, transform, cell)
    generator = np.random.default_rng(1)
    picked = [tuple(generator.integers(0, side) for side in shape) for _ in range(1000)]
    idws = np.array([found["idw"][at] for at in picked])
    apart_by = {n: apart(found[n], expected[n]) for n in STATS if n != "idw"}
    apart_by["idw"] = apart(idws, np.array(list(idw(x, y, z, transform, cell, picked))))
    told = ", ".join(f"{name} {value:.1e}" for name, value in apart_by.items())
    print(f"{Path(cloud).name}, cell {cell}, {shape[1]} x {shape[0]}, {len(x)} points: {told}")
    return all(value <= SLACK.get(name, USUAL_SLACK) for name, value in apart_by.items())


def main():
    terrane, *clouds = sys.argv[1:]
    done = []
    for cloud in clouds:
        for cell in (1.0, 2.5):
            with tempfile.TemporaryDirectory() as folder:
                done.append(compare(terrane, cloud, cell, folder))
    sys.exit(0 if done and all(done) else 1)


if __name__ == "__main__":
    main()
