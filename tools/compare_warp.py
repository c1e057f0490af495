#!/usr/bin/env python3
"""Grids on other lattices as terrane and gdalwarp have them, sample by sample.

    compare_warp.py TERRANE DEM... [--times]

Needs gdalwarp, gdalinfo and gdal_translate (Debian: gdal-bin) and numpy. Exits with 1 where a height differs by more
than rounding, or is void in one of the two only. Cubic heights of coarser outputs are left out near borders, and of grids
with voids: there terrane is bilinear.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

NODATA = -9999
# A part of a unit of heights: gdalwarp takes positions from PROJ, which agree to a hundredth of a millimetre.
MOST = 0.01


def run(command):
    start = time.perf_counter()
    done = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True)
    return time.perf_counter() - start, done.stdout


def samples(path, folder):
    raw = folder / "raw.bin"
    run(["gdal_translate", "-q", "-of", "ENVI", "-ot", "Float32", path, raw])
    told = json.loads(run(["gdalinfo", "-json", path])[1])
    values = np.fromfile(raw, "<f4").reshape(told["size"][::-1]).astype(float)
    values[values == NODATA] = np.nan
    x, across, _, y, _, down = told["geoTransform"]
    (columns, rows) = told["size"]
    return values, [x, y + rows * down, x + columns * across, y]


def near_voids(values, reach):
    """Samples with a void, or what is beyond the border, so many samples away."""
    void = np.pad(np.isnan(values), reach, constant_values=True)
    rows, columns = values.shape
    near = np.zeros(values.shape, bool)
    for down in range(2 * reach + 1):
        for right in range(2 * reach + 1):
            near |= void[down:down + rows, right:right + columns]
    return near


def differ_merged(terrane, source, target, side, folder):
    """Whether a grid in another CRS below a part of it in its own is another one than that of gdalwarp."""
    below, part, ours, theirs = (folder / f"{name}.tif" for name in ("below", "part", "merged", "warped"))
    size = json.loads(run(["gdalinfo", "-json", source])[1])["size"]
    run([terrane, "convert", source, below, "--to-crs", target, "--resampling", "bilinear", "--resolution", side,
         "--out-nodata", NODATA, "--overwrite", "-q"])
    run(["gdal_translate", "-q", "-srcwin", 0, 0, size[0] // 2, size[1], source, part])
    run([terrane, "convert", below, part, ours, "--resampling", "near", "--to-crs", target, "--resolution", side,
         "--type", "float32", "--out-nodata", NODATA, "--overwrite", "-q"])
    a, extent = samples(ours, folder)
    run(["gdalwarp", "-q", "-overwrite", "-et", 0, "-r", "near", "-t_srs", target, "-tr", side, side,
         "-te", *map(repr, extent), "-ot", "Float32", "-dstnodata", NODATA, below, part, theirs])
    b, _ = samples(theirs, folder)
    same = (a == b) | np.isnan(a) & np.isnan(b)
    print(f"  merged in {target}: {(~same).sum()} of {same.size} differ", flush=True)
    return not same.all()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("terrane", type=pathlib.Path)
    parser.add_argument("dem", nargs="+", type=pathlib.Path)
    parser.add_argument("--times", action="store_true", help="tell how long both take, on one thread")
    args = parser.parse_args()
    worst = 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for dem in args.dem:
            source, ours, theirs = (folder / f"{name}.tif" for name in ("source", "ours", "theirs"))
            run([args.terrane, "convert", dem, source, "-f", "GTiff", "--overwrite", "-q"])
            about = json.loads(run([args.terrane, "info", source, "--stats", "--json"])[1])
            has_voids = about["stats"]["valid"] < about["samples"]
            is_globe = "PROJCRS" not in run(["gdalinfo", source])[1]
            # A little closer than the grid, and far coarser.
            targets = ["EPSG:32631", "EPSG:3857"] if is_globe else ["EPSG:4326"]
            for target in targets:
                worst |= differ_merged(args.terrane, source, target, repr(0.0007 if target == "EPSG:4326" else 70), folder)
                plain = [args.terrane, "convert", source, ours, "-f", "GTiff", "--type", "float32", "--out-nodata", NODATA,
                         "--to-crs", target, "--overwrite", "--json", "--threads", 1]
                run([*plain, "--resampling", "near"])
                cell = json.loads(run(["gdalinfo", "-json", ours])[1])["geoTransform"][1]
                for times in (0.8, 3):
                    for how in ("near", "bilinear", "cubic"):
                        side = repr(cell * times)
                        if how == "cubic" and times > 1 and has_voids:
                            continue
                        mine, told = run([*plain, "--resampling", how, "--resolution", side])
                        scale = json.loads(told).get("scale", [1, 1])
                        a, extent = samples(ours, folder)
                        took, _ = run(["gdalwarp", "-q", "-overwrite", "-et", 0, "-r", how, "-t_srs", target,
                                       "-tr", side, side, "-te", *map(repr, extent), "-ot", "Float32",
                                       "-wo", f"XSCALE={1 / scale[0]}", "-wo", f"YSCALE={1 / scale[1]}",
                                       "-dstnodata", NODATA, source, theirs])
                        b, _ = samples(theirs, folder)
                        void = int((np.isnan(a) != np.isnan(b)).sum())
                        both = ~np.isnan(a) & ~np.isnan(b)
                        if how == "cubic" and max(scale) > 1:
                            both &= ~near_voids(a, 3)
                        off = np.abs(a - b)[both]
                        is_wrong = void > 0 or off.max() > MOST or off.size == 0
                        worst |= is_wrong
                        seconds = f", {mine:.2f} s for {took:.2f} s" if args.times else ""
                        print(f"{dem.name} {target} {how} {scale[0]:.2f} x {scale[1]:.2f}: {off.size} samples, "
                              f"{(off == 0).mean():.5%} equal, largest {off.max():.2g}, {void} void in one only{seconds}"
                              f"{'  WRONG' if is_wrong else ''}", flush=True)
    print("differs" if worst else "all is well")
    return int(worst)


if __name__ == "__main__":
    sys.exit(main())
