#!/usr/bin/env python3
"""Derivatives and colours of grids as terrane and gdaldem have them, sample by sample.

    compare_gdaldem.py TERRANE DEM... [--times]

Needs gdaldem and gdal_translate (Debian: gdal-bin) and numpy. Exits with 1 where a sample differs by more than
rounding in single precision, or is void in one of the two only, or where a part of a colour differs.
"""
import argparse
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

# What terrane is asked for, what gdaldem is, and how far they may be apart: numbers of single precision, computed from
# heights in single precision by gdaldem.
KINDS = [
    ("slope", [], ["slope"], 2e-3),
    ("slope", ["--percent"], ["slope", "-p"], 5e-3),
    ("slope", ["--algorithm", "zevenbergen-thorne"], ["slope", "-alg", "ZevenbergenThorne"], 2e-3),
    ("slope", ["--compute-edges"], ["slope", "-compute_edges"], 2e-3),
    ("aspect", [], ["aspect"], 2e-2),
    ("aspect", ["--zero-for-flat"], ["aspect", "-zero_for_flat"], 2e-2),
    ("hillshade", [], ["hillshade"], 1),
    ("hillshade", ["--azimuth", "100", "--altitude", "20", "--z-factor", "3"],
     ["hillshade", "-az", "100", "-alt", "20", "-z", "3"], 1),
    ("hillshade", ["--multidirectional"], ["hillshade", "-multidirectional"], 1),
    ("hillshade", ["--combined"], ["hillshade", "-combined"], 1),
    ("hillshade", ["--algorithm", "zevenbergen-thorne", "--compute-edges"],
     ["hillshade", "-alg", "ZevenbergenThorne", "-compute_edges"], 1),
    ("roughness", [], ["roughness"], 1e-3),
    ("tpi", [], ["TPI"], 1e-3),
    ("tri", [], ["TRI", "-alg", "Riley"], 1e-3),
    ("tri", ["--wilson"], ["TRI", "-alg", "Wilson"], 1e-3),
]

# A file of colours, and how it may be used; but for --exact, as gdaldem 3.6 finds the lowest entry alone.
COLOURS = """# sea to snow
0 70 120 180
10%:120:170,90
250.5\torange 128
50% 200 140 90 77
2000 BROWN
100% white
nv 1 2 3 0
"""
WAYS = [([], []), (["--alpha"], ["-alpha"]), (["--nearest", "--alpha"], ["-nearest_color_entry", "-alpha"])]


def run(command):
    start = time.perf_counter()
    subprocess.run([str(word) for word in command], check=True, capture_output=True)
    return time.perf_counter() - start


def samples(path, folder):
    """Values as numpy has them; voids are not numbers."""
    raw = folder / "raw.bin"
    run(["gdal_translate", "-q", "-of", "ENVI", "-ot", "Float32", path, raw])
    head = (folder / "raw.hdr").read_text()
    size = {key.strip(): value.strip() for key, _, value in (line.partition("=") for line in head.splitlines())}
    values = np.fromfile(raw, "<f4").reshape(int(size["lines"]), int(size["samples"])).astype(float)
    told = [value for key, value in size.items() if key == "data ignore value"]
    if told:
        values[values == np.float32(told[0])] = np.nan
    return values


def beside_edges(heights):
    """Where both have ways of their own: the corners of the grid, and its border beside voids."""
    void = np.pad(np.isnan(heights), 2, constant_values=False)
    near = np.zeros(heights.shape, bool)
    for down in range(5):
        for right in range(5):
            near |= void[down:down + heights.shape[0], right:right + heights.shape[1]]
    border = np.zeros(heights.shape, bool)
    border[[0, -1], :] = border[:, [0, -1]] = True
    near &= border
    near[[0, 0, -1, -1], [0, -1, 0, -1]] = True
    return near


def pixels(path, folder):
    """Bytes of all bands."""
    raw = folder / "raw.bin"
    run(["gdal_translate", "-q", "-of", "ENVI", "-co", "INTERLEAVE=BSQ", "-ot", "Byte", path, raw])
    return np.fromfile(raw, "u1")


def compare_colours(terrane, dem, name, folder, times):
    """Whether colours differ."""
    colours, ours, other, worst = folder / "colours.txt", folder / "ours.tif", folder / "other.tif", False
    colours.write_text(COLOURS)
    # Shares are of all heights, as statistics beside the file tell, which may be those of the grid before.
    dem.with_name(dem.name + ".aux.xml").unlink(missing_ok=True)
    run(["gdalinfo", "-stats", dem])
    for more, theirs in WAYS:
        mine = run([terrane, "color-relief", dem, colours, ours, *more, "--threads", 1, "--overwrite", "-q"])
        took = run(["gdaldem", "color-relief", dem, colours, other, *theirs, "-q"])
        a, b = pixels(ours, folder), pixels(other, folder)
        off = int((a != b).sum()) if a.shape == b.shape else max(a.size, b.size)
        worst |= off > 0
        seconds = f", {mine:.2f} s for {took:.2f} s" if times else ""
        print(f"{name} color-relief {' '.join(more)}: {off} of {a.size} bytes differ{seconds}{'  WRONG' if off else ''}")
    return worst


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
            dem_tif = folder / "dem.tif"
            run([args.terrane, "convert", dem, dem_tif, "-f", "GTiff", "--overwrite", "-q"])
            info = subprocess.run(["gdalinfo", dem_tif], check=True, capture_output=True, text=True).stdout
            scale = 111_120 if "DEGREE" in info.upper() and "PROJCRS" not in info else 1
            heights = samples(dem_tif, folder)
            run([args.terrane, "slope", dem_tif, folder / "steep.tif", "--percent", *(["--scale", scale] if scale != 1 else []),
                 "--overwrite", "-q"])
            steep = np.nan_to_num(samples(folder / "steep.tif", folder)) / 100
            worst |= compare_colours(args.terrane, dem_tif, dem.name, folder, args.times)
            for verb, more, theirs, most in KINDS:
                ours, other = folder / f"ours-{verb}.tif", folder / f"other-{verb}.tif"
                of_slopes = verb in ("slope", "aspect", "hillshade")
                scaled = ["--scale", scale] if scale != 1 and of_slopes else []
                mine = run([args.terrane, verb, dem_tif, ours, *more, *scaled, "--threads", 1, "--overwrite", "-q"])
                scaled = ["-s", scale] if scale != 1 and theirs[0] in ("slope", "hillshade") else []
                took = run(["gdaldem", theirs[0], dem_tif, other, *theirs[1:], *scaled, "-q"])
                a, b = samples(ours, folder), samples(other, folder)
                off = np.abs(a - b)
                allowed = np.full(off.shape, most, float)
                if verb == "aspect":
                    off = np.minimum(off, 360 - off)
                    # Of almost level ground it is noise where heights are in single precision.
                    allowed = most + 1e-3 / np.maximum(steep, 1e-9)
                    allowed[steep < 1e-5] = 360
                if "--compute-edges" in more:
                    allowed[beside_edges(heights)] = np.inf
                # There 0 stands for none, too.
                a = np.nan_to_num(a) if "--zero-for-flat" in more else a
                b = np.nan_to_num(b) if "--zero-for-flat" in more else b
                is_void = np.isnan(a) != np.isnan(b)
                if verb == "aspect":
                    is_void &= steep >= 1e-5
                void, far = int(is_void.sum()), int((off > allowed).sum())
                is_wrong = void > 0 or far > 0
                worst |= is_wrong
                times = f", {mine:.2f} s for {took:.2f} s" if args.times else ""
                print(f"{dem.name} {verb} {' '.join(map(str, more))}: largest {np.nanmax(off):.2g}, {far} beyond {most}, "
                      f"{void} void in one only{times}{'  WRONG' if is_wrong else ''}")
    print("differs" if worst else "all is well")
    return int(worst)


if __name__ == "__main__":
    sys.exit(main())
