#!/usr/bin/env python3
"""Holds operations between reference systems against those of PROJ.

    python3 tools/compare_operations.py [--program target/debug/examples/operate] [--points N] [CODE...]
    python3 tools/compare_operations.py --table > crates/crs/src/positions.tsv

For each system, longitudes and latitudes are scattered over the area that it is made for. PROJ projects
them, and shifts them to WGS 84 by the very operation that terrane says it takes: what is compared is the
arithmetic, not the choice. terrane must find the same to a millimetre, from the map to WGS 84 and back.
(PROJ's own way back is not asked: that of equal-area projections is off by a millimetre in PROJ 9.5.)
Prints a table, and exits with 1 where anything differs or nothing was compared. With --table, it writes what
PROJ finds at a few points, for the tests of the crate. `cargo build --package terrane-crs --example operate` makes the program. Needs numpy
and pyproj.
"""

import argparse
import re
import subprocess
import sys

import numpy as np
from pyproj import CRS, Geod, Transformer

SYSTEMS = [
    # Of the datum of WGS 84.
    32611, 32733, 32660, 32661, 3857, 3395, 3031, 3413, 3995, 6933, 4087, 5041,
    # Of datums that stand for it.
    2154, 25832, 3035, 3034, 2180, 3006, 3067, 5110, 3763, 2100, 3794, 3765, 3301, 3059,
    2193, 28355, 7855, 3577, 6677, 6668, 4258, 4269, 2056, 31983, 5880, 5367, 6372, 2326,
    # State planes: Lambert's and Mercator's cones and cylinders, feet.
    2229, 2263, 6339, 6350, 5070, 6318, 26957, 2249, 3081, 26931, 6393, 3338, 6414, 3005, 3347, 3978,
    # With a shift: RD New, British and Irish grid, LV95 and LV03, Gauss-Krueger, Krovak, and others.
    28992, 27700, 29903, 21781, 31467, 31468, 31254, 31287, 5514, 3844, 27572, 27561, 23030, 23032, 3003,
    30169, 2443, 5179, 24047, 29873, 3375, 22234, 2048, 20437, 24891, 23700, 31370, 4314, 4277, 31256, 26713,
]
# Where the area of a system is larger than that of any shift: west, south, east, north.
PARTS = {
    23030: (-5.9, 36, -0.1, 43.5), 23032: (6.1, 44, 11.9, 57), 26713: (-107.9, 32, -102.1, 48.9),
    22234: (18.1, -33.8, 23.9, -26.9), 27572: (-4.5, 45.5, 7.6, 48.1), 3003: (7.9, 43.9, 11.9, 46.4),
}
SLACK = 1e-3


def area(crs):
    """West, south, east, north: a hair inside of what the system is made for."""
    if crs.to_epsg() in PARTS:
        return PARTS[crs.to_epsg()]
    west, south, east, north = crs.area_of_use.bounds
    east += 360 if east < west else 0
    pole = 89.9
    width, height = min(east - west, 358), min(north, pole) - max(south, -pole)
    middle = (west + east) / 2
    return (middle - width * 0.49, max(south, -pole) + height * 0.01,
            middle + width * 0.49, min(north, pole) - height * 0.01)


def run(program, source, target, points, everywhere):
    text = "\n".join(f"{float(x)!r} {float(y)!r}" for x, y in points)
    done = subprocess.run([program, source, target] + ["everywhere"] * everywhere, input=text, capture_output=True, text=True)
    if done.returncode != 0:
        return None, done.stderr.strip()
    said, *lines = done.stdout.splitlines()
    rows = [line.split() if not line.startswith("error") else ("nan", "nan") for line in lines]
    failed = [line for line in lines if line.startswith("error")]
    return np.array(rows, dtype=float), failed[0] if failed else said


def greenwich(base):
    """The system of the same survey that counts longitudes from Greenwich on."""
    twins = {4807: 4275, 4818: 4156, 4805: 4312, 4901: 4275, 4809: 4313}
    code = base.to_epsg()
    return CRS.from_epsg(twins.get(code, code))


def operations(said):
    """The codes of the operations that terrane takes."""
    return [int(found) for found in re.findall(r"\(EPSG:(\d+)\)", said)]


def shifted(codes, lon, lat):
    """To WGS 84 by PROJ, by operations of EPSG's."""
    for code in codes:
        # As EPSG has them: latitudes first.
        step = Transformer.from_pipeline(f"urn:ogc:def:coordinateOperation:EPSG::{code}")
        lat, lon = step.transform(lat, lon)
    return np.array(lon), np.array(lat)


def scattered(crs, count, rng):
    """Longitudes and latitudes, and where PROJ has them on the map."""
    west, south, east, north = area(crs)
    lon = rng.uniform(west, east, count)
    # As many in any two areas of one size.
    low, high = np.sin(np.radians([south, north]))
    lat = np.degrees(np.arcsin(rng.uniform(low, high, count)))
    xs, ys = Transformer.from_crs(greenwich(crs.geodetic_crs), crs, always_xy=True).transform(lon, lat)
    return lon, lat, xs, ys


def compare(program, code, count, rng):
    """What terrane says, and the largest distance in metres from what PROJ finds, there and back."""
    crs = CRS.from_epsg(code)
    west, south, east, north = area(crs)
    lon, lat, xs, ys = scattered(crs, count, rng)
    everywhere = north > 85 or south < -85
    ours, said = run(program, f"EPSG:{code}", "EPSG:4326", zip(xs, ys), everywhere)
    if ours is None or np.isnan(ours).any():
        return said, None, None
    want_lon, want_lat = shifted(operations(said), lon, lat)
    there = np.abs(Geod(ellps="WGS84").inv(ours[:, 0], ours[:, 1], want_lon, want_lat)[2]).max()
    # Not cut at 180 degrees.
    middle = (west + east) / 2
    want_lon = middle + (want_lon - middle + 180) % 360 - 180
    turned, told = run(program, "EPSG:4326", f"EPSG:{code}", zip(want_lon, want_lat), everywhere)
    if turned is None or np.isnan(turned).any():
        return told, there, None
    across, unit = turned[:, 0] - xs, np.radians(1) * 6378137
    if crs.is_projected:
        unit = crs.axis_info[0].unit_conversion_factor
    else:
        across = (across + 180) % 360 - 180
    return said, there, np.hypot(across, turned[:, 1] - ys).max() * unit


def table(program, rng):
    """Lines of code, x, y, and longitude and latitude on WGS 84, as PROJ finds them."""
    for code in SYSTEMS:
        lon, lat, xs, ys = scattered(CRS.from_epsg(code), 3, rng)
        _, said = run(program, f"EPSG:{code}", "EPSG:4326", zip(xs, ys), False)
        lon, lat = shifted(operations(said), lon, lat)
        for row in zip(xs, ys, lon, lat):
            yield "\t".join([str(code), *[f"{value:.10f}".rstrip("0") for value in row]])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default="target/debug/examples/operate")
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--table", action="store_true")
    parser.add_argument("codes", nargs="*", type=int)
    args = parser.parse_args()
    rng = np.random.default_rng(12)
    if args.table:
        print("\n".join(table(args.program, rng)))
        return
    differ = compared = 0
    for code in args.codes or SYSTEMS:
        said, there, back = compare(args.program, code, args.points, rng)
        is_same = there is not None and back is not None and max(there, back) <= SLACK
        differ += not is_same
        compared += 1
        figures = [f"{1000 * value:9.4f}" if value is not None else f"{'-':>9}" for value in (there, back)]
        print(f"{'' if is_same else 'DIFFERS ':8}{code:6} {' '.join(figures)} mm  {CRS.from_epsg(code).name:48.48} {said}")
    print(f"{compared} systems compared at {args.points} points each, {differ} differ")
    sys.exit(1 if differ or not compared else 0)


if __name__ == "__main__":
    main()
