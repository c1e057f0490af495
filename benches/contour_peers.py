#!/usr/bin/env python3
"""Races terrane contour against gdal_contour, contourpy and scikit-image, and compares their lines.

    benches/contour_peers.py [DEM ...] [--interval 20] [--base 0] [--rounds 3] [--folder DIR] [--only TEXT]

Without a DEM, a synthetic terrain of 4097 x 4097 samples is written into DIR and taken. terrane and GDAL go
from a GeoTIFF to a FlatGeobuf; contourpy and scikit-image start from an array in memory, go level by level,
and write nothing, so that their column is the time of the calls alone. A process of its own for each
measurement, rounds interleaved; the medians count, of clock, processor and memory. GDAL is the
library inside pyogrio's wheel, called as its program calls it: one thread, whatever there is.

What each gives is compared with what terrane gives, level by level: lines, total length, and how far the
vertices of one are from the lines of the other ("apart", in cells, the larger of both directions). Levels
with another number of lines are counted; heights that are exactly on a level are where programs differ, so
a --base between the heights of the DEM is the stricter comparison.

Needs cargo (or TERRANE for the program), numpy, shapely, pyogrio, rasterio, contourpy and scikit-image.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import textwrap

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PEAK = """
    def peak():
        with open("/proc/self/status") as told:
            return next(int(row.split()[1]) / 1024 for row in told if row.startswith("VmHWM"))
"""
GDAL = """
    import ctypes, glob, os, sys, time, pyogrio
    folder = os.path.join(os.path.dirname(os.path.dirname(pyogrio.__file__)), "pyogrio.libs")
    gdal = ctypes.CDLL(glob.glob(os.path.join(folder, "libgdal*"))[0])
    pointer, text, number = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int
    def call(name, *args, gives=pointer):
        function = getattr(gdal, name)
        function.restype = gives
        return function(*args)
    call("GDALAllRegister")
    start = time.perf_counter(), time.process_time()
    dem = pointer(call("GDALOpen", text({dem!r}.encode()), number(0)))
    band = pointer(call("GDALGetRasterBand", dem, number(1)))
    driver = pointer(call("GDALGetDriverByName", text(b"FlatGeobuf")))
    out = pointer(call("GDALCreate", driver, text({out!r}.encode()), *[number(0)] * 4, None))
    system = pointer(call("GDALGetSpatialRef", dem))
    layer = pointer(call("GDALDatasetCreateLayer", out, text(b"contour"), system, number(2), None))
    field = pointer(call("OGR_Fld_Create", text(b"elev"), number(2)))
    call("OGR_L_CreateField", layer, field, number(1), gives=number)
    options = ["ELEV_FIELD=0", "LEVEL_INTERVAL={interval}", "LEVEL_BASE={base}"]
    has = number(0)
    nodata = call("GDALGetRasterNoDataValue", band, ctypes.byref(has), gives=ctypes.c_double)
    options += [f"NODATA={{nodata!r}}"] if has.value else []
    listed = (text * (len(options) + 1))(*[option.encode() for option in options], None)
    if call("GDALContourGenerateEx", band, layer, listed, None, None, gives=number):
        sys.exit("GDAL failed")
    call("GDALClose", out)
    print(time.perf_counter() - start[0], time.process_time() - start[1], peak())
"""
ARRAY = """
    import math, time, numpy as np, rasterio
    with rasterio.open({dem!r}) as dem:
        z = np.ma.filled(dem.read(1, masked=True).astype(float), np.nan)
        place = dem.transform
    low, high = np.nanmin(z), np.nanmax(z)
    first, last = (math.floor((end - {base}) / {interval}) for end in (low, high))
    levels = [{base} + k * {interval} for k in range(first, last + 1) if low < {base} + k * {interval} <= high]
    {before}
    start = time.perf_counter(), time.process_time()
    found = [{call} for level in levels]
    print(time.perf_counter() - start[0], time.process_time() - start[1], peak())
    chains, heights = [], []
    for level, lines in zip(levels, found):
        for line in lines:
            chains.append(np.asarray({after}, float)); heights.append(level)
    at = np.concatenate(chains) + .5
    xy = np.column_stack([place.c + place.a * at[:, 0], place.f + place.e * at[:, 1]])
    ends = np.cumsum([len(chain) for chain in chains])
    np.savez({out!r}, xy=xy, ends=ends, heights=heights)
"""
CONTOURPY = """import contourpy
    drawn = contourpy.contour_generator(z=np.ma.masked_invalid(z), name="serial",
                                        line_type=contourpy.LineType.Separate)"""


def program(text, **known):
    return [sys.executable, "-c", textwrap.dedent(PEAK + text.format(**known))]


def programs(terrane, dem, out, interval, base):
    """Name, command, where its lines are."""
    known = {"dem": dem, "out": out, "interval": interval, "base": base}
    here = [terrane, "contour", dem, "-o", out + ".fgb", "--overwrite", "--json", f"--interval={interval}",
            f"--base={base}"]
    arrays = {"dem": dem, "out": out + ".npz", "interval": interval, "base": base}
    return [
        ("terrane, 1 thread", here + ["--threads", "1"], out + ".fgb"),
        ("terrane", here, out + ".fgb"),
        ("gdal_contour", program(GDAL, **{**known, "out": out + ".fgb"}), out + ".fgb"),
        ("contourpy serial", program(ARRAY, before=CONTOURPY, call="drawn.lines(level)", after="line", **arrays),
         out + ".npz"),
        ("scikit-image", program(ARRAY, before="from skimage.measure import find_contours",
                                 call="find_contours(z, level)", after="line[:, ::-1]", **arrays), out + ".npz"),
    ]


def lines(path):
    """By level: the lines."""
    import pyogrio
    import shapely
    if path.endswith(".npz"):
        with np.load(path) as data:
            starts = np.concatenate([[0], data["ends"][:-1]])
            index = np.repeat(np.arange(len(starts)), data["ends"] - starts)
            shapes, heights = shapely.linestrings(data["xy"], indices=index), data["heights"]
    else:
        _, _, shapes, columns = pyogrio.raw.read(path, columns=["elev"])
        shapes, heights = shapely.from_wkb(shapes), columns[0]
    return {level: shapes[heights == level] for level in np.unique(heights)}


def apart(some, others):
    """The largest distance of a vertex of some lines from the nearest of others."""
    import shapely
    if not len(some) or not len(others):
        return 0.0
    points = shapely.points(np.unique(shapely.get_coordinates(some), axis=0))
    ends, line = shapely.get_coordinates(others, return_index=True)
    pairs = np.stack([ends[:-1], ends[1:]], axis=1)[line[:-1] == line[1:]]
    tree = shapely.STRtree(shapely.linestrings(pairs))
    _, distances = tree.query_nearest(points, return_distance=True, all_matches=False)
    return float(distances.max())


def compare(ours, theirs):
    """Lines, length, levels with another number of lines, largest distance."""
    import shapely
    levels = sorted(set(ours) | set(theirs))
    none = np.array([], dtype=object)
    pairs = [(ours.get(level, none), theirs.get(level, none)) for level in levels]
    count = sum(len(b) for _, b in pairs)
    length = sum(float(shapely.length(b).sum()) for _, b in pairs)
    differ = sum(len(a) != len(b) for a, b in pairs)
    most = max(max(apart(a, b), apart(b, a)) for a, b in pairs)
    return count, length, differ, len(levels), most


def measure(command):
    """Seconds on the clock and of the processor, and the peak of memory in MiB."""
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    text = child.stdout.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit(f"failed: {command[:3]}")
    if text.startswith("{"):
        report = json.loads(text)
        return report["wall_seconds"], usage.ru_utime + usage.ru_stime, report["peak_memory"] / 2**20
    return tuple(map(float, text.split()))


def built():
    """The program, as `cargo build --release` leaves it."""
    text = subprocess.run(["cargo", "build", "--release", "--bin", "terrane", "--message-format=json"],
                          cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = [json.loads(row) for row in text.splitlines() if row.startswith("{")]
    return [row["executable"] for row in messages if row.get("executable")][-1]


def race(terrane, dem, args, folder):
    import rasterio
    with rasterio.open(dem) as grid:
        size, cell = f"{grid.width} x {grid.height}", abs(grid.transform.a)
    wanted = [job for job in programs(terrane, dem, os.path.join(folder, "out"), args.interval, args.base)
              if args.only in job[0] or job[0] == "terrane"]
    runs, found = {job[0]: [] for job in wanted}, {}
    for turn in range(args.rounds):
        for name, command, out in wanted:
            if os.path.exists(out):
                os.remove(out)
            runs[name].append(measure(command))
            if turn == 0:
                found[name] = lines(out)
    ours = found["terrane"]
    for name in runs:
        wall, cpu, peak = (statistics.median(run[i] for run in runs[name]) for i in range(3))
        count, length, differ, levels, most = compare(ours, found[name])
        print(f"| {os.path.basename(dem)} | {size} | {name} | {wall:.3f} | {cpu:.3f} | {peak:.0f} | {count:,} | "
              f"{length / cell:,.1f} | {differ} of {levels} | {most / cell:.2g} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("dem", nargs="*")
    parser.add_argument("--interval", type=float, default=20)
    parser.add_argument("--base", type=float, default=0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder")
    parser.add_argument("--only", default="", help="programs with this in their name, and terrane")
    args = parser.parse_args()
    terrane = os.environ.get("TERRANE") or built()
    with tempfile.TemporaryDirectory() as temporary:
        folder = os.path.abspath(args.folder or temporary)
        os.makedirs(folder, exist_ok=True)
        dems = args.dem
        if not dems:
            dems = [os.path.join(folder, "synth.tif")]
            command = [terrane, "synth", "rough,size=4097,seed=7", dems[0], "--overwrite", "--quiet"]
            subprocess.run(command, check=True)
        print(f"machine: {platform.processor() or platform.machine()}, {os.cpu_count()} cores  ")
        print(f"command: benches/contour_peers.py --interval {args.interval:g} --base {args.base:g} "
              f"--rounds {args.rounds}  \n")
        print("| grid | samples | program | s | CPU s | MiB | lines | length, cells | levels that differ | apart, cells |")
        print("|---|---|---|---:|---:|---:|---:|---:|---:|---:|")
        for dem in dems:
            race(terrane, os.path.abspath(dem), args, folder)


if __name__ == "__main__":
    main()
