#!/usr/bin/env python3
"""Holds the reference systems of what terrane writes against what GDAL reads of them.

    python3 tools/compare_crs.py [--terrane target/debug/terrane] [--codes N] [GRID...]

Grids of every kind of system are made (custom projections by every method that GeoTIFF has a code
for, an Esri code, compound ones in metres and feet, geographic in three dimensions, local, none), or
those given are taken. Each goes through every writer: meshes (their .prj), grids and contours. What
rasterio and pyogrio then read must be what rasterio reads of the grid itself, part by part. With
--codes, that many EPSG codes are also read from .prj files in GDAL's, Esri's and the second dialect;
`terrane info` must tell the code, or at least no other one. Prints a table of differences and exits
with 1 when there are any. Needs numpy, rasterio and pyogrio.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import warnings

import numpy as np
import pyogrio
import rasterio
from rasterio.crs import CRS
from rasterio.transform import from_origin

warnings.filterwarnings("ignore")
# Codes that were given up are to stay what they are.
os.environ["OSR_USE_NON_DEPRECATED"] = "NO"
ELLIPSOID = "+ellps=GRS80 +x_0=100 +y_0=200"
TWO = "+lat_1=45 +lat_2=49 +lat_0=46 +lon_0=9"
CENTRE = "+lat_0=46 +lon_0=9"
SYSTEMS = {
    "tmerc": f"+proj=tmerc +lat_0=1 +lon_0=9 +k=0.9999 {ELLIPSOID}",
    "tmerc_feet": f"+proj=tmerc +lat_0=1 +lon_0=9 +k=0.9999 {ELLIPSOID} +units=us-ft",
    "tmerc_km": f"+proj=tmerc +lat_0=1 +lon_0=9 +k=0.9999 {ELLIPSOID} +units=km",
    "tmerc_south": f"+proj=tmerc +axis=wsu +lat_0=1 +lon_0=9 +k=0.9999 {ELLIPSOID}",
    "lcc_1sp": f"+proj=lcc +lat_1=45 +lat_0=45 +lon_0=9 +k_0=0.9999 {ELLIPSOID}",
    "lcc_2sp": f"+proj=lcc {TWO} {ELLIPSOID}",
    "lcc_paris": "+proj=lcc +lat_1=46.8 +lat_0=46.8 +lon_0=0 +k_0=0.99987742 +x_0=600000 "
    "+y_0=2200000 +a=6378249.2 +b=6356515 +pm=paris",
    "aea": f"+proj=aea {TWO} {ELLIPSOID}",
    "eqdc": f"+proj=eqdc {TWO} {ELLIPSOID}",
    "laea": f"+proj=laea {CENTRE} {ELLIPSOID}",
    "aeqd": f"+proj=aeqd {CENTRE} {ELLIPSOID}",
    "stere": f"+proj=stere {CENTRE} +k=0.99 {ELLIPSOID}",
    "stere_polar_a": f"+proj=stere +lat_0=90 +k=0.99 +lon_0=9 {ELLIPSOID}",
    "stere_polar_b": f"+proj=stere +lat_0=90 +lat_ts=71 +lon_0=9 {ELLIPSOID}",
    "stere_south": f"+proj=stere +lat_0=-90 +lat_ts=-71 +lon_0=9 {ELLIPSOID}",
    "sterea": "+proj=sterea +lat_0=52 +lon_0=5 +k=0.9999079 +x_0=155000 +y_0=463000 +ellps=bessel",
    "merc_1sp": f"+proj=merc +lon_0=9 +k=0.99 {ELLIPSOID}",
    "merc_2sp": f"+proj=merc +lat_ts=30 +lon_0=9 {ELLIPSOID}",
    "eqc": f"+proj=eqc +lat_ts=30 +lat_0=1 +lon_0=9 {ELLIPSOID}",
    "cass": f"+proj=cass {CENTRE} {ELLIPSOID}",
    "cea": f"+proj=cea +lat_ts=30 +lon_0=9 {ELLIPSOID}",
    "omerc_a": f"+proj=omerc +no_uoff +lat_0=46 +lonc=9 +alpha=30 +gamma=31 +k=0.99 {ELLIPSOID}",
    "omerc_b": f"+proj=omerc +lat_0=46 +lonc=9 +alpha=30 +gamma=31 +k=0.99 {ELLIPSOID}",
    "somerc": "+proj=somerc +lat_0=46.95 +lon_0=7.439 +x_0=600000 +y_0=200000 +ellps=bessel",
    "poly": f"+proj=poly +lat_0=1 +lon_0=9 {ELLIPSOID}",
    "sinu": f"+proj=sinu +lon_0=9 {ELLIPSOID}",
    "robin": f"+proj=robin +lon_0=9 {ELLIPSOID}",
    "moll": f"+proj=moll +lon_0=9 {ELLIPSOID}",
    "mill": f"+proj=mill +lon_0=9 {ELLIPSOID}",
    "ortho": f"+proj=ortho {CENTRE} +x_0=100 +y_0=200 +a=6370000 +b=6370000",
    "gnom": f"+proj=gnom {CENTRE} +x_0=100 +y_0=200 +a=6370000 +b=6370000",
    "krovak": "+proj=krovak +lat_0=49.5 +lon_0=24.83333 +alpha=30.2881 +k=0.9999 +ellps=bessel",
    "geographic": "+proj=longlat +a=6378000 +b=6357000",
    "nad27_utm": "+proj=utm +zone=11 +datum=NAD27",
    "esri_102003": "ESRI:102003",
    "web_mercator": "EPSG:3857",
    "grads": "EPSG:27572",
    "utm": "EPSG:32611",
    "rd": "EPSG:28992",
    "wgs84": "EPSG:4326",
    "compound_metre": "EPSG:6339+5703",
    "compound_us_foot": "EPSG:6339+6360",
    "compound_foot": "EPSG:2229+8228",
    "compound_egm96": "EPSG:4326+5773",
    "compound_code": "EPSG:7415",
    "geographic_3d": "EPSG:4937",
    "local": 'LOCAL_CS["Arbitrary (m)",UNIT["metre",1,AUTHORITY["EPSG","9001"]],'
    'AXIS["Easting",EAST],AXIS["Northing",NORTH]]',
    "none": None,
}
GRIDS = [("s.tif", "store"), ("g.tif", "GTiff"), ("c.tif", "COG"), ("a.asc", "AAIGrid"),
         ("f.flt", "GridFloat"), ("p.png", "PNG")]
MESHES = ["m.ply", "o.obj", "t.stl", "b.glb"]
LINES = ["l.shp", "l.fgb", "l.geojson"]
# PNG is a picture to GDAL, which has no .prj; the .asc stands in for it.
STAND_IN = "stand.asc"


def make(path, system):
    heights = np.fromfunction(lambda r, c: 100 + 10 * np.sin(c / 9) * np.cos(r / 7), (60, 80))
    place = from_origin(5, 50, 0.01, 0.01)
    with rasterio.open(path, "w", driver="GTiff", width=80, height=60, count=1, dtype="float32",
                       transform=place, crs=system and CRS.from_string(system),
                       GEOTIFF_VERSION="1.1") as out:
        out.write(np.round(heights).astype("f4"), 1)


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout, done.stderr.strip()


def of_prj(path):
    """What GDAL reads of the .prj beside `path`."""
    prj = os.path.splitext(path)[0] + ".prj"
    if not os.path.exists(prj):
        return None
    stand = os.path.join(os.path.dirname(path), STAND_IN)
    with open(stand, "w") as out:
        out.write("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 4\n")
    with open(os.path.splitext(stand)[0] + ".prj", "w") as out:
        out.write(open(prj).read())
    with rasterio.open(stand) as grid:
        return grid.crs


def of_lines(path):
    text = pyogrio.read_info(path)["crs"]
    return CRS.from_user_input(text) if text else None


def of_grid(path):
    with rasterio.open(path) as grid:
        return grid.crs


def tree(text):
    """Well-known text as nested lists: [KEYWORD, value, ...]."""
    at = 0

    def value():
        nonlocal at
        if text[at] == '"':
            end = text.index('"', at + 1)
            word, at = text[at + 1:end], end + 1
            return word
        start = at
        while at < len(text) and text[at] not in "[],":
            at += 1
        word = text[start:at].strip()
        if at < len(text) and text[at] == "[":
            node = [word]
            while text[at] != "]":
                at += 1
                node.append(value())
            at += 1
            return node
        try:
            return float(word)
        except ValueError:
            return word

    return value()


def unbound(node):
    """The same without the shifts to other datums that some texts bring along."""
    if not isinstance(node, list):
        return node
    if node[0] == "BOUNDCRS":
        return unbound(node[1][1])
    return [unbound(inner) for inner in node]


def find(node, *keywords):
    """All nodes with one of the keywords, from the outside in."""
    if not isinstance(node, list):
        return
    if node[0] in keywords:
        yield node
    for inner in node[1:]:
        yield from find(inner, *keywords)


def unit_of(node, default=1.0):
    """The size of the unit of a node."""
    units = [n for n in node if isinstance(n, list) and n[0].endswith("UNIT")]
    return units[0][2] if units else default


def meaning(crs):
    """A system as sorted facts, none of which is a name that programs spell in their own way."""
    if crs is None:
        return {}
    text = crs.to_wkt(version="WKT2_2019")
    root = unbound(tree(text))
    facts = {"kind": root[0]}
    for node in find(root, "ELLIPSOID"):
        facts["ellipsoid"] = (round(node[2], 3), round(node[3], 7))
        break
    for node in find(root, "PRIMEM"):
        facts["meridian"] = round(node[2] * unit_of(node, 0.0174532925199433), 10)
        break
    for node in find(root, "METHOD"):
        facts["method"] = node[1]
        break
    for node in find(root, "PARAMETER"):
        # An empty parameter is as good as none.
        if node[2] not in (0.0,):
            facts[node[1]] = float(f"{node[2] * unit_of(node):.9g}")
    for node in find(root, "PROJCRS", "GEOGCRS", "ENGCRS"):
        axes = [axis for axis in node if isinstance(axis, list) and axis[0] == "AXIS"]
        facts["axes"] = len(axes)
        facts["unit"] = float(f"{unit_of(axes[0], unit_of(node)):.9g}")
        break
    for node in find(root, "VERTCRS"):
        axis = next(find(node, "AXIS"))
        datum = next(find(node, "VDATUM", "ENSEMBLE"))
        facts["vertical"] = (datum[1], float(f"{unit_of(axis, unit_of(node)):.9g}"))
    return facts


def same(a, b):
    return meaning(a) == meaning(b) or (a is not None and b is not None and a == b)


def difference(a, b):
    a, b = meaning(a), meaning(b)
    keys = [k for k in {**a, **b} if a.get(k) != b.get(k)]
    return "; ".join(f"{k}: {a.get(k)} -> {b.get(k)}" for k in keys) or "other"


def compare(terrane, source, folder):
    """(writer, difference) of each output whose system is not that of the source."""
    want = of_grid(source)
    jobs = [(out, of_grid if not out.endswith("png") else of_prj,
             ("convert", source, out, "-f", name)) for out, name in GRIDS]
    jobs += [(out, of_prj, ("tin", source, out, "--max-error", "1")) for out in MESHES]
    jobs += [(out, of_lines, ("contour", source, "-o", out, "--interval", "3")) for out in LINES]
    for out, read, command in jobs:
        path = os.path.join(folder, out)
        command = [path if part == out else part for part in command]
        command += ["--round"] if out.endswith("png") else []
        code, _, err = run(terrane, *command, "--overwrite", "-q")
        if code != 0:
            yield out, err
            continue
        found = read(path)
        # GeoJSON without a word is in WGS 84, which terrane says in a note.
        if out.endswith("geojson") and (want is None or want.to_epsg() == 4326):
            continue
        if not same(want, found):
            yield out, difference(want, found)


def compare_codes(terrane, count, folder):
    """(code and dialect, difference) of .prj files that are read for another system."""
    with open(os.path.join(folder, "x.asc"), "w") as out:
        out.write("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 4\n")
    codes = [c for c in range(2000, 33000)]
    np.random.default_rng(7).shuffle(codes)
    done = 0
    for code in codes:
        try:
            crs = CRS.from_epsg(code)
        except Exception:
            continue
        if done == count:
            return
        # Compound systems are told by their parts.
        if not crs.to_wkt(version="WKT2_2019").startswith(("PROJCRS", "GEOGCRS")):
            continue
        done += 1
        for dialect in ("WKT1_GDAL", "WKT1_ESRI", "WKT2_2019"):
            try:
                text = crs.to_wkt(version=dialect)
            except Exception:
                continue
            with open(os.path.join(folder, "x.prj"), "w") as out:
                out.write(text)
            status, out, err = run(terrane, "info", os.path.join(folder, "x.asc"), "--json")
            told = json.loads(out)["epsg"] if status == 0 else err
            # Esri's dialect has no codes.
            if told != code and (told is not None or dialect != "WKT1_ESRI"):
                yield f"{code} {dialect}", str(told)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--terrane", default="target/debug/terrane")
    parser.add_argument("--codes", type=int, default=0)
    parser.add_argument("grids", nargs="*")
    args = parser.parse_args()
    differences = compared = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, system in {} if args.grids else SYSTEMS.items():
            path = os.path.join(folder, f"in_{name}.tif")
            make(path, system)
            args.grids.append(path)
        for path in args.grids:
            for out, what in compare(args.terrane, path, folder):
                differences += 1
                print(f"{os.path.basename(path):28} {out:10} {what}")
            compared += len(GRIDS) + len(MESHES) + len(LINES)
        for what, told in compare_codes(args.terrane, args.codes, folder):
            differences += 1
            print(f"{what:28} {'.prj':10} {told}")
    print(f"{compared} outputs and {args.codes} codes compared, {differences} differ")
    sys.exit(1 if differences or not compared + args.codes else 0)


if __name__ == "__main__":
    main()
