#!/usr/bin/env python3
"""Compares what terrane reads of grids with what GDAL (rasterio) reads of them.

    python3 tools/compare_rasterio.py [--terrane target/debug/terrane] FILE_OR_FOLDER...

Every band of every file is converted to a store. The store as rasterio reads it must equal the
source as rasterio reads it: values, mask, transform, CRS, type, nodata, scale, offset, unit and
AREA_OR_POINT; so must `terrane info --json` of source and store. Text has no type: terrane
takes the narrowest that holds all values, which is not called a difference. Prints a table (file,
band, outcome, reason) and exits with 1 when anything differs. Needs numpy and rasterio.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import warnings

import numpy as np
import rasterio

GRIDS = (
    *(".tif", ".tiff", ".hgt", ".hgt.zip", ".asc", ".flt", ".bil", ".bip", ".bsq"),
    *(".dt0", ".dt1", ".dt2", ".dem", ".xyz"),
)


def grids(paths):
    """Files to compare: those given, and those of the known endings in the folders given."""
    for path in paths:
        if os.path.isdir(path):
            names = sorted(os.listdir(path))
            yield from (os.path.join(path, n) for n in names if n.lower().endswith(GRIDS))
        else:
            yield path


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout, done.stderr.strip()


def opened(path):
    """A dataset, and the name GDAL wants where the tile is zipped."""
    if not path.lower().endswith(".zip"):
        return rasterio.open(path)
    import zipfile
    inside = [n for n in zipfile.ZipFile(path).namelist() if n.lower().endswith(".hgt")]
    return rasterio.open(f"/vsizip/{os.path.abspath(path)}/{inside[0]}")


def void(dataset, band, values):
    """Voids as terrane has them: masked, or declared nodata, or not finite."""
    masked = dataset.read_masks(band) == 0
    nodata = dataset.nodatavals[band - 1]
    if nodata is not None and not np.isnan(nodata):
        masked |= values == np.array(nodata).astype(values.dtype) if fits(nodata, values) else False
    if values.dtype.kind == "f":
        masked |= ~np.isfinite(values)
    last = dataset.count
    if band != last and dataset.colorinterp[-1] == rasterio.enums.ColorInterp.alpha:
        masked |= dataset.read(last) == 0
    return masked


def fits(nodata, values):
    if values.dtype.kind == "f":
        return True
    limits = np.iinfo(values.dtype)
    return nodata == int(nodata) and limits.min <= nodata <= limits.max


def same_number(a, b):
    if a is None or b is None:
        return a is b
    return a == b or (np.isnan(a) and np.isnan(b)) or np.float32(a) == np.float32(b)


def same_heights(a, b, scale, offset):
    """Scaled doubles are compared as heights: several stored values may stand for one."""
    if (scale, offset) == (1.0, 0.0):
        return np.array_equal(a, b)
    return np.array_equal(a * np.float64(scale) + offset, b * np.float64(scale) + offset)


def spare_value(values):
    """A value that no sample has, for voids of types without NaN."""
    limits = np.iinfo(values.dtype)
    candidates = [limits.min, limits.max, -9999]
    present = set(np.unique(values).tolist())
    return next((v for v in candidates if v not in present and limits.min <= v <= limits.max), None)


def position(dataset):
    return dataset.tags().get("AREA_OR_POINT", "Area")


def crs_text(dataset):
    """Well-known text; what GDAL makes of a GeoTIFF that says PixelIsPoint and no CRS is none."""
    text = dataset.crs.to_wkt() if dataset.crs else None
    return None if text and text.startswith('LOCAL_CS["unnamed"') else text


def compare(source, band, store, given):
    """Names of what differs between band `band` of the source and the store."""
    a, b = source.read(band), store.read(1)
    lost, kept = void(source, band, a), void(store, 1, b)
    gone = source.transform.is_identity
    is_text = source.driver == "AAIGrid"
    cell = abs(source.transform.a)
    near = all(abs(x - y) <= 1e-9 * cell for x, y in zip(source.transform, store.transform))
    epsg = [d.crs.to_epsg() if d.crs else None for d in (source, store)]
    wkt = [crs_text(d) for d in (source, store)]
    facts = {
        "size": a.shape == b.shape,
        "type": a.dtype == b.dtype or is_text and np.can_cast(b.dtype, a.dtype),
        "mask": np.array_equal(lost, kept),
        "values": same_heights(a[~lost], b[~lost], source.scales[band - 1], source.offsets[band - 1]),
        "transform": gone and store.transform.is_identity or near,
        "EPSG": epsg[0] == epsg[1],
        "CRS": epsg[0] is not None or wkt[0] == wkt[1],
        "nodata": given or is_text and not lost.any() or same_number(source.nodatavals[band - 1], store.nodatavals[0]),
        "scale": source.scales[band - 1] == store.scales[0],
        "offset": source.offsets[band - 1] == store.offsets[0],
        "unit": (source.units[band - 1] or None) == (store.units[0] or None),
        "AREA_OR_POINT": position(source) == position(store),
    }
    told = {
        "type": (a.dtype, b.dtype),
        "EPSG": epsg,
        "CRS": wkt,
        "nodata": (source.nodatavals[band - 1], store.nodatavals[0]),
        "unit": (source.units[band - 1], store.units[0]),
        "AREA_OR_POINT": (position(source), position(store)),
        "transform": (source.transform.to_gdal(), store.transform.to_gdal()),
        "mask": (int(lost.sum()), int(kept.sum())),
    }
    return [f"{name} {told.get(name, '')}".strip() for name, same in facts.items() if not same]


def compare_info(terrane, path, band, source):
    """Names of what `terrane info --json` tells otherwise than rasterio."""
    code, out, err = run(terrane, "info", "--json", "--stats", "--band", str(band), path)
    if code != 0:
        return [f"info: {err}"]
    told = json.loads(out)
    gdal = source.transform.to_gdal()
    cell = abs(source.transform.a)
    near = all(abs(x - y) <= 1e-9 * cell for x, y in zip(gdal, told["geotransform"]))
    epsg = source.crs.to_epsg() if source.crs else None
    values = source.read(band)
    valid = int((~void(source, band, values)).sum())
    facts = {
        "info size": (told["width"], told["height"]) == (source.width, source.height),
        "info transform": near or not told["georeferenced"] and source.transform.is_identity,
        f"info EPSG {told['epsg']} {epsg}": told["epsg"] == epsg or epsg is None,
        f"info valid {told['stats']['valid']} {valid}": told["stats"]["valid"] == valid,
    }
    return [name for name, same in facts.items() if not same]


def check(terrane, path, band, folder):
    """(outcome, reason) for one band of one file."""
    store = os.path.join(folder, "store.tif")
    convert = [terrane, "convert", path, store, "--overwrite", "--quiet", "--band", str(band)]
    code, _, err = run(*convert)
    try:
        with opened(path) as source:
            source.read(band)
            given = []
            if code != 0 and "--nodata" in err and source.nodatavals[band - 1] is None:
                given = ["--nodata", str(spare_value(source.read(band)))]
                code, _, err = run(*convert, *given)
            if code != 0:
                return "refused" if "not supported" in err else "ERROR", err
            with rasterio.open(store) as copy:
                differs = compare(source, band, copy, bool(given))
            differs += compare_info(terrane, path, band, source)
    except rasterio.errors.RasterioError as error:
        return ("both refuse", err) if code != 0 else ("only terrane reads", str(error))
    return ("DIFFERS", "; ".join(differs)) if differs else ("same", " ".join(given))


def bands_of(path):
    try:
        with opened(path) as source:
            return source.count
    except rasterio.errors.RasterioError:
        return 1


def main():
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--terrane", default="target/debug/terrane")
    parser.add_argument("paths", nargs="+")
    options = parser.parse_args()
    counts = {}
    with tempfile.TemporaryDirectory() as folder:
        for path in grids(options.paths):
            for band in range(1, bands_of(path) + 1):
                outcome, reason = check(options.terrane, path, band, folder)
                counts[outcome] = counts.get(outcome, 0) + 1
                print(f"{os.path.basename(path)}\t{band}\t{outcome}\t{reason}")
    print(", ".join(f"{count} {outcome}" for outcome, count in sorted(counts.items())))
    bad = {"DIFFERS", "ERROR", "only terrane reads"}
    return 1 if bad & counts.keys() or not counts else 0


if __name__ == "__main__":
    sys.exit(main())
