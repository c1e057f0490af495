#!/usr/bin/env python3
"""Holds heights brought to the ellipsoid against those of PROJ, by the same grids of geoids.

    python3 tools/compare_geoids.py [--program target/debug/terrane]

Geoids are made up and written by GDAL as PROJ's network has them (Geodetic TIFF grids) and as GTX: of a part of the
globe and of all of it, samples at points and of areas, floats and whole numbers with a scale, tiled and not. A mesh of
every sample of a small grid is written with heights above the ellipsoid (`--to-crs EPSG:4979 --geoid`), and PROJ is
given the positions in it (`+proj=vgridshift`). Prints a table, and exits with 1 where any height differs by more than
a micrometre, or nothing was compared. Needs numpy, rasterio and pyproj.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import rasterio
from pyproj import Transformer
from rasterio.transform import Affine

SLACK = 1e-6
KIND = {"TYPE": "VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL"}
# West, north, step, columns, rows; and what else there is to a file.
PART, GLOBE = (5.0, 49.0, 0.25, 21, 17), (-180.0, 90.0, 1.0, 360, 181)
FILES = {
    "points.tif": (PART, {"AREA_OR_POINT": "Point"}, {}),
    "areas.tif": (PART, {"AREA_OR_POINT": "Area"}, {}),
    "globe.tif": (GLOBE, {"AREA_OR_POINT": "Point"}, {"tiled": True, "blockxsize": 256, "blockysize": 256, "compress": "deflate", "predictor": 3}),
    "whole.tif": (GLOBE, {"AREA_OR_POINT": "Point"}, {"dtype": "int16"}),
    "globe.gtx": (GLOBE, {}, {"driver": "GTX"}),
}
# Where grids of heights lie: longitude and latitude of their south-western corner.
PLACES = {"points.tif": [(7.1, 46.2)], "areas.tif": [(7.1, 46.2)]}
ANYWHERE = [(7.1, 46.2), (-70.03, -33.3), (179.985, 10.0), (-179.99, -60.0), (0.0, 0.0), (-0.01, 89.95)]


def make_geoid(path, place, tags, how):
    """Writes heights of -100 to 90 metres."""
    west, north, step, columns, rows = place
    rng = np.random.default_rng(columns)
    heights = (rng.random((rows, columns)) * 190 - 100).astype("f4")
    profile = {"driver": "GTiff", "dtype": "float32", "crs": "EPSG:4326", "count": 1, **how}
    # GDAL counts from the corners of cells, whose middles are the samples.
    transform = Affine(step, 0, west - step / 2, 0, -step, north + step / 2)
    if profile["driver"] == "GTX":
        flat = np.concatenate([[north - step * (rows - 1), west, step, step]]).astype(">f8").tobytes()
        path.write_bytes(flat + np.array([rows, columns], ">i4").tobytes() + heights[::-1].astype(">f4").tobytes())
        return
    is_whole = profile["dtype"] == "int16"
    stored = np.round(heights * 100).astype("i2") if is_whole else heights
    with rasterio.open(path, "w", width=columns, height=rows, transform=transform, **profile) as out:
        out.write(stored[None])
        out.update_tags(**KIND, **tags)
        out.set_band_description(1, "geoid_undulation")
        out.units = ["metre"]
        if is_whole:
            out.scales, out.offsets = [0.01], [0.0]


def vertices(path):
    data = path.read_bytes()
    head, body = data.split(b"end_header\n", 1)
    count = next(int(line.split()[2]) for line in head.decode().splitlines() if line.startswith("element vertex"))
    return np.frombuffer(body, "<f8", 3 * count).reshape(-1, 3)


def compare(program, folder, geoid, corner):
    """The number of heights, and how far the furthest is from that of PROJ."""
    heights = np.random.default_rng(3).random((21, 21)) * 1000
    with open(folder / "dem.asc", "w") as out:
        out.write(f"ncols 21\nnrows 21\nxllcenter {corner[0]}\nyllcenter {corner[1]}\ncellsize 0.001\n")
        np.savetxt(out, heights, "%.3f")
    (folder / "dem.prj").write_text("EPSG:4326")
    made = [program, "tin", folder / "dem.asc", "--max-error", "0", "--overwrite", "-q"]
    subprocess.run([*made, folder / "low.ply"], check=True)
    subprocess.run([*made, folder / "high.ply", "--to-crs", "EPSG:4979", "--geoid", geoid], check=True)
    low, high = vertices(folder / "low.ply"), vertices(folder / "high.ply")
    degrees = "+proj=unitconvert +xy_in={} +xy_out={}"
    steps = [degrees.format("deg", "rad"), f"+proj=vgridshift +grids={geoid} +multiplier=1", degrees.format("rad", "deg")]
    transformer = Transformer.from_pipeline("+proj=pipeline " + " ".join("+step " + step for step in steps))
    lon = (low[:, 0] + 180) % 360 - 180
    _, _, want = transformer.transform(lon, low[:, 1], low[:, 2], errcheck=True)
    return len(low), np.abs(want - high[:, 2]).max()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default="target/debug/terrane")
    program = str(pathlib.Path(parser.parse_args().program).absolute())
    compared = differ = 0
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name, (place, tags, how) in FILES.items():
            make_geoid(folder / name, place, tags, how)
            for corner in PLACES.get(name, ANYWHERE):
                count, off = compare(program, folder, folder / name, corner)
                is_same = off <= SLACK
                compared, differ = compared + count, differ + (not is_same)
                print(f"{name:12} {corner[0]:9} {corner[1]:7} {count:5} heights  {off:.1e} m  {'' if is_same else 'DIFFERS'}")
    print(f"{compared:,} heights, {differ} places where they differ")
    sys.exit(differ > 0 or compared == 0)


if __name__ == "__main__":
    main()
