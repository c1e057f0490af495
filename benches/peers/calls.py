"""What the peers of `../race.py` do: a function for each, run in a process of its own, and how peers are installed.

Usage: calls.py NAME ARGUMENT...

The whole process is measured, unless the function returns a call: then only the call is, and a line of JSON tells
its seconds.
"""

import functools
import importlib.metadata
import json
import math
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import threading
import time

GDAL = "apt install gdal-bin"
PROGRAMS = {"gdaldem": GDAL, "gdalwarp": GDAL, "gdal_contour": GDAL, "gdal_translate": GDAL, "gdalbuildvrt": GDAL,
            "mapshaper": "npm install -g mapshaper"}
CELL, WEST, NORTH = 10, 499995, 4750005  # of `terrane synth`, in metres
CALLS = {}


def call(label="", packages=""):
    """Registers a function, with its label in tables and the packages it needs."""
    return lambda function: CALLS.setdefault(function.__name__, (function, label, packages.split()))[0]


@call("pydelatin", "pydelatin numpy")
def pydelatin(raw, side, error):
    import call_pydelatin
    call_pydelatin.main(raw, side, side, error)


@call("rasterio", "rasterio numpy")
def rasterio_blocks(path, threads):
    import rasterio

    def read(first):
        with rasterio.open(path) as grid:
            for _, window in list(grid.block_windows(1))[first::int(threads)]:
                grid.read(1, window=window)

    def read_all():
        workers = [threading.Thread(target=read, args=(first,)) for first in range(int(threads))]
        for step in (threading.Thread.start, threading.Thread.join):
            for worker in workers:
                step(worker)
    return read_all


@call("exactextract", "exactextract rasterio")
def exactextract(grid, zones, stats):
    from exactextract import exact_extract
    exact_extract(grid, json.loads(pathlib.Path(zones).read_text())["features"], stats.split(","))


@call("laspy + numpy", "laspy lazrs numpy")
def laspy_grid(cloud, threads):
    os.environ["RAYON_NUM_THREADS"] = threads
    import laspy, numpy as np
    backend = laspy.LazBackend.Lazrs if threads == "1" else laspy.LazBackend.LazrsParallel
    with laspy.open(cloud, laz_backend=backend) as reader:
        header = reader.header
        west, north = np.floor(header.mins[0]), np.floor(header.maxs[1]) + 1
        columns, rows = int(np.floor(header.maxs[0]) + 1 - west), int(north - np.floor(header.mins[1]))
        count, total = np.zeros(columns * rows, np.int64), np.zeros(columns * rows)
        low, high = np.full(columns * rows, np.inf), np.full(columns * rows, -np.inf)
        for points in reader.chunk_iterator(1_000_000):
            cell = (np.ceil(north - np.asarray(points.y)).astype(np.int64) - 1) * columns
            cell += (np.asarray(points.x) - west).astype(np.int64)
            z = np.asarray(points.z)
            count += np.bincount(cell, minlength=columns * rows)
            total += np.bincount(cell, z, minlength=columns * rows)
            np.minimum.at(low, cell, z)
            np.maximum.at(high, cell, z)


@call("laspy + lazrs", "laspy lazrs numpy")
def laspy_copy(source, target):
    import laspy
    backend = laspy.LazBackend.Lazrs
    with laspy.open(source, laz_backend=backend) as reader:
        with laspy.open(target, mode="w", header=reader.header, laz_backend=backend) as writer:
            for points in reader.chunk_iterator(1_000_000):
                writer.write_points(points)


def ground_points(cloud):
    import laspy, numpy as np
    points = laspy.read(cloud)
    return np.c_[points.x, points.y, points.z][points.classification == 2]


@call("scipy", "scipy laspy numpy")
def scipy_tin(cloud):
    import numpy as np
    from scipy.interpolate import LinearNDInterpolator
    points = ground_points(cloud)
    axes = [np.arange(np.floor(points[:, i].min()) + 0.5, points[:, i].max()) for i in (0, 1)]
    LinearNDInterpolator(points[:, :2], points[:, 2])(*np.meshgrid(*axes))


@call("startin", "startinpy laspy numpy")
def startin(cloud):
    import startinpy
    points, mesh = ground_points(cloud), startinpy.DT()
    return lambda: mesh.insert(points)


@call("shapely", "shapely pyogrio numpy")
def shapely_simplify(path, tolerance, topology):
    import pyogrio, shapely
    shapes = shapely.from_wkb(pyogrio.raw.read(path)[2])
    return lambda: shapely.simplify(shapes, float(tolerance), preserve_topology=topology == "yes")


@call("rasterio", "rasterio numpy")
def lerc(source, target, tiled):
    import rasterio
    with rasterio.open(source) as grid:
        blocks = {"blockxsize": 512, "blockysize": 512} if tiled == "yes" else {}
        profile = {"driver": "GTiff", "count": 1, "dtype": "float32", "crs": grid.crs, "transform": grid.transform}
        with rasterio.open(target, "w", width=grid.width, height=grid.height, compress="LERC", max_z_error=0.01,
                           tiled=tiled, **blocks, **profile) as out:
            out.write(grid.read())


@call()
def colours(path):
    pathlib.Path(path).write_text("0 0 60 120\n200 40 130 60\n600 200 190 90\n1000 150 90 50\n1500 255 255 255\n")


@call()
def zones(path, side):
    """Star-shaped polygons of a few to many cells, some beyond the grid."""
    draw, extent, features = random.Random(5), CELL * int(side), []
    for number in range(60):
        x, y = WEST + draw.uniform(-0.1, 1.1) * extent, NORTH - draw.uniform(-0.1, 1.1) * extent
        longest, corners = extent * draw.choice([0.002, 0.02, 0.2]), draw.randint(5, 40)
        polar = [(longest * draw.uniform(0.4, 1), math.tau * i / corners) for i in range(corners)]
        ring = [[x + radius * math.cos(angle), y + radius * math.sin(angle)] for radius, angle in polar]
        geometry = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
        features.append({"type": "Feature", "properties": {"id": number}, "geometry": geometry})
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32631"}}
    pathlib.Path(path).write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}))


def is_call(argv):
    return __file__ in map(str, argv)


def label(command):
    """Name of the program or package in the table."""
    name = command.split()[0]
    return CALLS[name][1] if name in CALLS else name


class Missing(Exception):
    """A program or packages that are not installed: how to install them."""


@functools.cache
def version(command):
    """Names and versions of what a command needs; raises `Missing`."""
    name = command.split()[0]
    if name not in CALLS:
        if not shutil.which(name):
            raise Missing(PROGRAMS[name])
        done = subprocess.run([name, "--version"], capture_output=True, text=True)
        number = re.search(r"\d+\.\d+(\.\d+)?", done.stdout + done.stderr)
        return f"{'GDAL' if PROGRAMS[name] == GDAL else name} {number[0] if number else '?'}"
    versions = {package: installed(package) for package in CALLS[name][2]}
    if absent := [package for package, number in versions.items() if number is None]:
        raise Missing(f"pip install {' '.join(absent)}")
    return ", ".join(f"{package} {number}" for package, number in versions.items())


def installed(package):
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def versions(commands):
    """Names and versions of the installed peers among commands."""
    here = set()
    for command in set(filter(None, commands)):
        try:
            here |= set(version(command).split(", "))
        except Missing:
            pass
    return ", ".join(sorted(here, key=str.lower))


def argv_of(words):
    """A command as it is started; None if it is not a peer's. Raises `Missing`."""
    if words[0] not in CALLS and words[0] not in PROGRAMS:
        return None
    version(words[0])
    return [sys.executable, __file__, *words] if words[0] in CALLS else words


def called(name, *args):
    """Runs a registered function; prints what the call that it returns took."""
    measured = CALLS[name][0](*args)
    if measured:
        wall, cpu = time.perf_counter(), time.process_time()
        measured()
        print(json.dumps({"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}))


if __name__ == "__main__":
    called(*sys.argv[1:])
