#!/usr/bin/env python3
"""Statistics within polygons as exactextract has them, and heights at points as GDAL's, of real grids.

    compare_zonal.py TERRANE DEM...

Zones are star-shaped polygons with holes, of a few to many cells, some beyond the grid. Needs exactextract, numpy and
rasterio. Exits with 1 where a statistic differs by more than rounding; prints the processor seconds of both.
"""
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile
import time

import numpy as np
import rasterio
from exactextract import exact_extract

STATISTICS = ["count", "sum", "mean", "min", "max", "stdev", "variance", "variety"]
ZONES = 60
POINTS = 500
# Relative; exactextract sums in floats of another order.
MOST = 1e-6


def star(center, radii):
    """A ring around a centre."""
    turn = 2 * math.pi / len(radii)
    ring = [
        [center[0] + radius * math.cos(i * turn), center[1] + radius * math.sin(i * turn)]
        for i, radius in enumerate(radii)
    ]
    return [*ring, ring[0]]


def zones(bounds, crs):
    """Polygons over a grid."""
    draw = random.Random(5)
    width, height = bounds.right - bounds.left, bounds.top - bounds.bottom
    features = []
    for number in range(ZONES):
        center = [bounds.left + draw.uniform(-0.1, 1.1) * width, bounds.bottom + draw.uniform(-0.1, 1.1) * height]
        size = min(width, height) * draw.choice([0.002, 0.02, 0.2])
        radii = [size * draw.uniform(0.4, 1.0) for _ in range(draw.randint(5, 40))]
        rings = [star(center, radii)]
        if number % 3 == 0:
            rings.append(star(center, [radius * 0.5 for radius in radii])[::-1])
        features.append(
            {"type": "Feature", "properties": {"id": number}, "geometry": {"type": "Polygon", "coordinates": rings}}
        )
    name = {"type": "name", "properties": {"name": crs}}
    return {"type": "FeatureCollection", "crs": name, "features": features}


def by_terrane(terrane, verb, dem, inputs, folder, *options):
    """The properties that terrane finds, in the order of the features, and its processor seconds."""
    source, made = folder / "in.geojson", folder / "out.geojson"
    source.write_text(json.dumps(inputs))
    start = time.perf_counter()
    subprocess.run([terrane, verb, dem, source, made, "--overwrite", "-q", "--threads", "1", *options], check=True)
    seconds = time.perf_counter() - start
    return [feature["properties"] for feature in json.loads(made.read_text())["features"]], seconds


def differ(ours, theirs, most=MOST):
    """True if two numbers differ by more than rounding; none and nan are the same."""
    missing = [value is None or math.isnan(value) for value in (ours, theirs)]
    if any(missing):
        return missing[0] != missing[1]
    return abs(ours - theirs) > most * max(1.0, abs(theirs))


def compare_zones(terrane, dem, folder):
    with rasterio.open(dem) as grid:
        inputs = zones(grid.bounds, f"urn:ogc:def:crs:EPSG::{grid.crs.to_epsg()}")
    ours, seconds = by_terrane(terrane, "zonal", dem, inputs, folder, "--stat", ",".join(STATISTICS))
    start = time.perf_counter()
    found = exact_extract(str(dem), inputs["features"], STATISTICS)
    theirs = [feature["properties"] for feature in found]
    print(f"{dem.name}: {len(ours)} zones, {seconds:.2f} s, exactextract {time.perf_counter() - start:.2f} s")
    wrong = [
        f"  zone {own['id']}, {name}: {own[name]}, exactextract {other[name]}"
        for own, other in zip(ours, theirs, strict=True)
        for name in STATISTICS
        # Of zones without a sample exactextract has the sum 0. Cells of which less than 1e-9 is covered count there.
        if differ(own[name], other[name], 1.0 if name == "variety" and abs(own[name] - other[name]) <= 2 else MOST)
        and not (name == "sum" and own["count"] == 0)
    ]
    print("\n".join(wrong[:10]), end="\n" if wrong else "")
    return len(wrong)


def compare_points(terrane, dem, folder):
    with rasterio.open(dem) as grid:
        draw, bounds = random.Random(6), grid.bounds
        places = [(draw.uniform(bounds.left, bounds.right), draw.uniform(bounds.bottom, bounds.top)) for _ in range(POINTS)]
        values = [value[0] for value in grid.sample(places, masked=True)]
        crs = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{grid.crs.to_epsg()}"}}
    theirs = [None if np.ma.is_masked(value) else float(value) for value in values]
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": place}} for place in places
    ]
    inputs = {"type": "FeatureCollection", "crs": crs, "features": features}
    ours, _ = by_terrane(terrane, "sample", dem, inputs, folder, "--resampling", "near")
    wrong = [
        f"  {place}: {own['height']}, GDAL {other}"
        for place, own, other in zip(places, ours, theirs, strict=True)
        if differ(own["height"], other)
    ]
    print("\n".join(wrong[:10]), end="\n" if wrong else "")
    return len(wrong)


def main():
    terrane, *dems = (pathlib.Path(name).resolve() for name in sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        wrong = sum(compare(terrane, dem, folder) for dem in dems for compare in (compare_zones, compare_points))
    print(f"{wrong} values differ")
    sys.exit(1 if wrong or not dems else 0)


main()
