"""Checks a mesh against the grid it was made of, sharing no code with any contestant.

Usage: check.py GRID.raw GRID.json MAX_ERROR MESH

Every triangle is rasterised with exact integer edge functions, and the surface is evaluated in f64
at every sample in or on it. Prints a line of JSON: vertices, triangles, the largest error, the
samples beyond MAX_ERROR, the samples under no triangle, and whether the areas of the triangles add
up to that of the grid (with no sample uncovered: no hole and no overlap).

MESH is a PLY of f64 vertices as terrane writes it, or the raw form of call_pydelatin.py.
"""

import json
import sys

import numpy as np
from numba import njit

# Rounding of the f64 evaluation itself, as a share of the tolerance.
SLACK = 1e-12


def read_ply(file, meta):
    vertices = triangles = 0
    for line in iter(file.readline, b"end_header\n"):
        words = line.split()
        if words[:2] == [b"element", b"vertex"]:
            vertices = int(words[2])
        elif words[:2] == [b"element", b"face"]:
            triangles = int(words[2])
        elif not words:
            sys.exit("not the PLY of this race: its header does not end")
    points = np.fromfile(file, "<f8", 3 * vertices).reshape(-1, 3)
    face = np.dtype([("corners", "u1"), ("ids", "<u4", 3)])
    ids = np.fromfile(file, face, triangles)["ids"]
    return to_lattice(points, meta["transform"]), ids


def to_lattice(points, transform):
    """World positions to columns and rows: samples are in the middle of their cells."""
    a, b, c, d, e, f = transform
    x, y = points[:, 0] - c, points[:, 1] - f
    area = a * e - b * d
    cols, rows = (e * x - b * y) / area - 0.5, (a * y - d * x) / area - 0.5
    return np.column_stack([cols, rows, points[:, 2]])


def read_mesh(path, meta):
    with open(path, "rb") as file:
        head = file.readline()
        if head == b"ply\n":
            return read_ply(file, meta)
        vertices, triangles = map(int, head.split())
        points = np.fromfile(file, "<f8", 3 * vertices).reshape(-1, 3)
        return points, np.fromfile(file, "<u4", 3 * triangles).reshape(-1, 3)


@njit(cache=True)
def column_range(ax, ay, bx, by, row, low, high):
    """Columns of `row` on the left of the edge a-b or on it, within low ..= high."""
    slope, start = ay - by, (by - ay) * ax + (row - ay) * (bx - ax)
    if slope > 0:
        low = max(low, -(start // slope))
    elif slope < 0:
        high = min(high, start // -slope)
    elif start < 0:
        high = low - 1
    return low, high


@njit(cache=True)
def survey(grid, places, heights, triangles, limit):
    covered = np.zeros(grid.shape, np.uint8)
    largest, area_sum, flat = 0.0, 0, 0
    beyond = np.zeros(grid.shape, np.uint8)
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay = places[i, 0], places[i, 1]
        area = (places[j, 0] - ax) * (places[k, 1] - ay) - (places[j, 1] - ay) * (places[k, 0] - ax)
        if area == 0:
            flat += 1
            continue
        if area < 0:
            j, k, area = k, j, -area
        area_sum += area
        bx, by, cx, cy = places[j, 0], places[j, 1], places[k, 0], places[k, 1]
        za, zb, zc = heights[i], heights[j], heights[k]
        for row in range(min(ay, by, cy), max(ay, by, cy) + 1):
            low, high = min(ax, bx, cx), max(ax, bx, cx)
            low, high = column_range(ax, ay, bx, by, row, low, high)
            low, high = column_range(bx, by, cx, cy, row, low, high)
            low, high = column_range(cx, cy, ax, ay, row, low, high)
            for col in range(low, high + 1):
                wb = (col - ax) * (cy - ay) - (row - ay) * (cx - ax)
                wc = (bx - ax) * (row - ay) - (by - ay) * (col - ax)
                surface = za + (wb * (zb - za) + wc * (zc - za)) / area
                error = abs(surface - grid[row, col])
                covered[row, col] = 1
                if error > largest:
                    largest = error
                if error > limit:
                    beyond[row, col] = 1
    return largest, beyond.sum(), covered.size - covered.sum(), area_sum, flat


def main(raw, meta_path, max_error, mesh):
    with open(meta_path, encoding="utf-8") as file:
        meta = json.load(file)
    width, height = meta["width"], meta["height"]
    grid = np.fromfile(raw, np.float32).reshape(height, width)
    points, triangles = read_mesh(mesh, meta)
    places = np.rint(points[:, :2]).astype(np.int64)
    if len(points) and np.abs(points[:, :2] - places).max() > 1e-3:
        sys.exit(f"{mesh}: a vertex is not at a sample")
    heights = np.ascontiguousarray(points[:, 2])
    limit = float(max_error) * (1 + SLACK)
    largest, beyond, uncovered, area, flat = survey(
        grid, places, heights, triangles.astype(np.int64), limit
    )
    facts = {
        "vertices": len(points),
        "triangles": len(triangles),
        "max_error": float(largest),
        "beyond": int(beyond),
        "uncovered": int(uncovered),
        "flat_triangles": int(flat),
        "area_matches": int(area) == 2 * (width - 1) * (height - 1),
    }
    print(json.dumps(facts))


if __name__ == "__main__":
    main(*sys.argv[1:])
