#!/usr/bin/env python3
"""Compares what terrane writes of features with what was to be written, as GDAL reads both.

    python3 tools/compare_vector.py [--terrane target/debug/terrane] [FILE...]

Each file (and some made here: with and without heights, several types, none) is written by
`terrane line --tolerance 0` in every format that holds it, and opened with pyogrio and fiona,
which have GDALs of their own. Features, geometries, heights, properties and the name of the layer
must be those of the input: a line alone is the same as several of one, features may be in another
order, and rings may begin elsewhere and go round the other way. Prints a line for each file and
format and exits with 1 when anything differs. Needs numpy, pyogrio, fiona and shapely.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile

import fiona
import numpy as np
import pyogrio
import shapely

FORMATS = {"GeoJSON": "geojson", "GeoJSONSeq": "geojsonl", "Shapefile": "shp", "FlatGeobuf": "fgb"}


def feature(number, kind, coordinates):
    properties = {"name": f"n{number}", "number": number, "real": number + 0.5}
    geometry = kind and {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def made(folder):
    """Files with features of few and many types, with and without heights."""
    flat, high = [[0, 0], [1, 1], [2, 0]], [[0, 0, 5], [1, 1, 6], [2, 0, 7]]
    ring, raised = [[0, 0], [4, 0], [4, 4], [0, 0]], [[0, 0, 1], [4, 0, 2], [4, 4, 3], [0, 0, 1]]
    worlds = {
        "one_line": [("LineString", flat)],
        "lines_2d_3d": [("LineString", flat), ("LineString", high)],
        "lines_single_multi": [("LineString", flat), ("MultiLineString", [flat, flat])],
        "lines_single_multi_3d": [("LineString", high), ("MultiLineString", [high, high])],
        "polygons_single_multi_3d": [("Polygon", [ring]), ("MultiPolygon", [[raised], [raised]])],
        "points_single_multi_3d": [("Point", high[0]), ("MultiPoint", high), (None, None)],
        "empty_3d": [("LineString", high), ("MultiLineString", [])],
        "empty_polygon_3d": [("Polygon", [raised]), ("Polygon", []), ("MultiPolygon", [])],
        "all_2d": [("Point", flat[0]), ("LineString", flat), ("Polygon", [ring])],
    }
    for name, features in worlds.items():
        path = os.path.join(folder, f"{name}.geojson")
        features = [feature(n, kind, own) for n, (kind, own) in enumerate(features)]
        with open(path, "w") as file:
            json.dump({"type": "FeatureCollection", "features": features}, file)
        yield path


def plain(geometry):
    """Parts of a geometry, in an order that neither types nor directions of rings change."""
    if geometry is None or geometry.is_empty:
        return []
    parts = []
    for part in shapely.get_parts(shapely.get_parts(geometry)):
        rings = [part]
        if part.geom_type == "Polygon":
            rings = [part.exterior, *part.interiors]
        for ring in rings:
            points = shapely.get_coordinates(ring, include_z=True)
            points = [(x, y, None if math.isnan(z) else z) for x, y, z in points]
            if part.geom_type == "Polygon":
                points = sorted(set(points), key=str)
            parts.append(points)
    return sorted(parts, key=str)


def rows(path):
    """Geometry and properties of each feature, in an order that does not depend on the file's."""
    meta, _, geometries, fields = pyogrio.raw.read(path)
    names = [str(name) for name in meta["fields"]]
    found = []
    for at, geometry in enumerate(shapely.from_wkb(geometries)):
        values = {n: str(f[at]) for n, f in zip(names, fields) if n not in ("id", "FID")}
        found.append([plain(geometry), values])
    return found


def same(want, got, zeros):
    """Whether both are the same features; `zeros` where no height may be 0."""

    def key(row):
        parts, values = row
        if zeros:
            parts = [[(x, y, z or 0.0) for x, y, z in part] for part in parts]
        return str((sorted(parts, key=str), sorted(values.items())))

    return sorted(map(key, want)) == sorted(map(key, got))


def compare(terrane, source, name, folder):
    """What differs in one format; None where it cannot hold the features."""
    stem = os.path.splitext(os.path.basename(source))[0]
    output = os.path.join(folder, f"{stem}.{FORMATS[name]}")
    command = [terrane, "line", source, output, "--tolerance", "0", "--overwrite", "-q"]
    command += ["--format", name]
    ran = subprocess.run(command, capture_output=True, text=True)
    if ran.returncode == 2 and "supports one geometry type" in ran.stderr:
        return None
    if ran.returncode != 0:
        return ran.stderr.strip()
    try:
        layers = pyogrio.list_layers(output)
        got = rows(output)
        with fiona.open(output) as opened:
            seen = sum(1 for _ in opened)
    except Exception as error:  # Whatever they raise is what a user would see.
        return f"does not open: {error!r}"
    want = rows(source)
    if name in ("Shapefile", "FlatGeobuf") and layers[0][0] != stem:
        return f"the layer is called {layers[0][0]!r}"
    if len(got) != len(want) or seen != len(want):
        return f"{len(got)} and {seen} features of {len(want)}"
    if not same(want, got, zeros=name == "Shapefile"):
        return f"features differ: {got} for {want}"
    return ""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--terrane", default="target/debug/terrane")
    parser.add_argument("files", nargs="*", metavar="FILE")
    args = parser.parse_args()
    failed = looked_at = 0
    with tempfile.TemporaryDirectory() as inputs, tempfile.TemporaryDirectory() as folder:
        for source in [*made(inputs), *args.files]:
            for name in FORMATS:
                what = compare(args.terrane, source, name, folder)
                looked_at += what is not None
                failed += bool(what)
                told = {None: "cannot hold it", "": "same"}.get(what, what)
                print(f"{os.path.basename(source):32} {name:12} {told}")
    print(f"{failed} of {looked_at} differ")
    return 1 if failed or not looked_at else 0


if __name__ == "__main__":
    np.seterr(all="ignore")
    sys.exit(main())
