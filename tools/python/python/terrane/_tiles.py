"""Terrain for viewers of the globe."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from terrane._errors import refuse_existing
from terrane._numbers import number
from terrane._settings import Features, Path, settings
from terrane._source import opened


def tiles(
    src: Any,
    path: Path,
    *,
    format: str | Sequence[str] = "quantized-mesh",
    geoid: Path | None = None,
    max_level: int | None = None,
    beyond: str = "taper",
    tile_edges: bool = False,
    meshopt: bool = False,
    normals: bool = True,
    compress: bool = True,
    band: int | None = None,
    nodata: float | None = None,
    transform: Any = None,
    crs: Any = None,
    clip: Features | None = None,
    water: Features | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    memory: int | str | None = None,
    temp_dir: Path | None = None,
    progress: Any = None,
) -> dict[str, Any]:
    """A folder of tiles of a grid of heights at every level of detail, out of core, no sample further from a tile, as viewers
    decode it, than they take its level to be off by. The folder appears whole or not at all. Returns what
    `terrane tiles --json` tells.

    Parameters
    ----------
    src, band, nodata, transform, crs, clip, water, threads, memory, progress
        As for `tin`. The grid must say where on the globe it lies.
    path
        The folder. An old one of tiles is replaced with `overwrite`.
    format
        "quantized-mesh" (CesiumJS and others) or "3dtiles" (3D Tiles 1.1); of several, a folder for each in `path`.
    geoid
        A file (GTX or GeoTIFF) with the heights above the ellipsoid of the geoid that heights are counted from. Without it they
        are taken from the ellipsoid on.
    max_level
        The deepest level, 0 to 20; else the first whose tiles have at most 64 samples along a side.
    beyond
        The ground between the edge of the grid and the sides of the tiles that hold it: "taper" falls to the ellipsoid, "level"
        goes on at the heights of the edge.
    tile_edges, meshopt
        Of 3D Tiles: name the vertices of sides, as CesiumJS wants it of terrain; compress what is in a tile.
    normals, compress
        Write what viewers light the ground by; compress each file with gzip.

    Raises
    ------
    terrane.Error
        Grids that do not say where they lie, reach around a pole or across 180 degrees, and all else that `tin` raises.

    Examples
    --------
    >>> import os, tempfile, terrane
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = terrane.tiles("synth:rough,size=129", os.path.join(folder, "tiles"), max_level=11)
    ...     all(level["error"] <= level["tolerance"] for level in made["levels"])
    True
    """
    refuse_existing(os.fspath(path), overwrite)
    asked = {
        "formats": [format] if isinstance(format, str) else list(format),
        "geoid": None if geoid is None else os.fspath(geoid),
        "max_level": number("max_level", max_level),
        "beyond": beyond,
        "tile_edges": tile_edges,
        "meshopt": meshopt,
        "normals": normals,
        "compress": compress,
    }
    run = settings(threads, memory, progress, temp_dir)
    with opened(
        src, band=band, nodata=nodata, transform=transform, crs=crs, clip=clip, water=water
    ) as (grid, _):
        return grid.tiles(os.fspath(path), asked, overwrite, run)
