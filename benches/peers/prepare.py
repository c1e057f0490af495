"""Makes one job of a grid for all contestants: a GeoTIFF, and the same heights as raw f32.

Usage: prepare.py SOURCE GRID.tif GRID.raw GRID.json

The peers know no voids, so voids are filled with the lowest height, for everyone. A source
without voids is used as it is: then GRID.tif may be SOURCE itself.
"""

import json
import sys

import numpy as np
import rasterio


def open_source(path):
    if path.endswith(".hgt.zip"):
        name = path.rsplit("/", 1)[-1].removesuffix(".zip")
        return rasterio.open(f"/vsizip/{path}/{name}")
    return rasterio.open(path)


def filled(band, nodata):
    """The heights with voids at the minimum, and the number of voids."""
    void = np.isnan(band) if np.issubdtype(band.dtype, np.floating) else np.zeros(band.shape, bool)
    if nodata is not None and not np.isnan(nodata):
        void |= band == nodata
    if void.any():
        band = np.where(void, band[~void].min(), band)
    return band, int(void.sum())


def write_tif(path, heights, source):
    options = {"driver": "GTiff", "tiled": True, "blockxsize": 256, "blockysize": 256}
    height, width = heights.shape
    with rasterio.open(
        path, "w", width=width, height=height, count=1, dtype=heights.dtype,
        crs=source.crs, transform=source.transform, **options,
    ) as out:
        out.write(heights, 1)


def main(source_path, tif, raw, meta):
    with open_source(source_path) as source:
        heights, voids = filled(source.read(1), source.nodata)
        if tif != source_path:
            write_tif(tif, heights, source)
        singles = heights.astype(np.float32)
        if not np.array_equal(singles.astype(np.float64), heights.astype(np.float64)):
            sys.exit(f"{source_path}: heights are not exact in f32, the peers cannot have them")
        singles.tofile(raw)
        facts = {
            "width": source.width,
            "height": source.height,
            "voids_filled": voids,
            "transform": list(source.transform)[:6],
            "range": [float(singles.min()), float(singles.max())],
        }
    with open(meta, "w", encoding="utf-8") as file:
        json.dump(facts, file)


if __name__ == "__main__":
    main(*sys.argv[1:])
