"""Proofs of meshes and tiles of grids."""

from __future__ import annotations

import os
import tempfile
from typing import Any

from terrane._errors import usage
from terrane._mesh import Mesh
from terrane._settings import Features, Path, settings
from terrane._source import opened


class Report:
    """What a proof found. True where it is `ok`."""

    def __init__(self, told: dict[str, Any]) -> None:
        self._told = told

    @property
    def ok(self) -> bool:
        """All that was promised was looked at, and is kept."""
        return bool(self._told["passed"] and self._told["judged"])

    @property
    def max_error(self) -> float | None:
        """The largest vertical distance of a sample (or point) from the mesh."""
        error: float | None = self._told.get("max_error")
        return error

    @property
    def surface_error(self) -> float | None:
        """The largest distance of any point of the lines between neighbouring samples; None of clouds."""
        error: float | None = self._told.get("surface_error")
        return error

    @property
    def failures(self) -> list[str]:
        """What is broken, and where."""
        return list(self._told["failures"])

    @property
    def not_judged(self) -> list[str]:
        """What was promised and not looked at."""
        return list(self._told["not_judged"])

    def as_dict(self) -> dict[str, Any]:
        """All of it, as `terrane verify --json` tells it."""
        return dict(self._told)

    def __bool__(self) -> bool:
        return self.ok

    def __repr__(self) -> str:
        error = "" if self.max_error is None else f"max_error {self.max_error:.6g}"
        told = "; ".join(self.failures or self.not_judged) or error
        return f"<terrane.Report: {'ok' if self.ok else 'not ok'}, {told}>"


def verify(
    mesh: Mesh | Path,
    src: Any,
    max_error: float | None = None,
    *,
    bound: str | None = None,
    min_angle: float | None = None,
    keep_points: Features | None = None,
    breaklines: Features | None = None,
    band: int | None = None,
    nodata: float | None = None,
    transform: Any = None,
    crs: Any = None,
    clip: Features | None = None,
    water: Features | None = None,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
) -> Report:
    """Proves a mesh, in memory or in a file, against the grid it was made from, by code of its own.

    Meshes of terrane state their tolerance, bound and smallest angle; for others, or other ones, pass them. `src` and what
    says how it is read are as for `tin`. A broken promise is no error: see `Report.ok`, `failures` and `not_judged`.

    >>> import numpy as np, terrane
    >>> heights = np.random.default_rng(1).normal(size=(40, 60)).astype("f4")
    >>> report = terrane.verify(terrane.tin(heights, max_error=0.5), heights)
    >>> report.ok, report.max_error <= 0.5, report.surface_error >= report.max_error
    (True, True, True)
    >>> terrane.verify(terrane.tin(heights, max_error=0.5), heights + 1, max_error=0.5).ok
    False
    """
    if not isinstance(mesh, Mesh | str | os.PathLike):
        raise usage(f"a {type(mesh).__name__} is no mesh", "pass a terrane.Mesh or a path")
    options: dict[str, Any] = {"max_error": max_error, "bound": bound, "min_angle": min_angle}
    options |= {"threads": threads, "memory": memory}
    run = settings(None, None, progress)
    with opened(
        src,
        band=band,
        nodata=nodata,
        transform=transform,
        crs=crs,
        clip=clip,
        water=water,
        keep_points=keep_points,
        breaklines=breaklines,
    ) as (grid, files):
        options |= {name: files[name] for name in ("keep_points", "breaklines")}
        if not isinstance(mesh, Mesh):
            return Report(grid.verify(os.fspath(mesh), options, run))
        with tempfile.TemporaryDirectory(prefix="terrane-") as folder:
            path = os.path.join(folder, "mesh.ply")
            mesh.write(path)
            told = grid.verify(path, options, run)
        return Report({**told, "mesh": "in memory"})


def verify_tiles(
    tiles: Path,
    src: Any,
    *,
    geoid: Path | None = None,
    band: int | None = None,
    nodata: float | None = None,
    transform: Any = None,
    crs: Any = None,
    clip: Features | None = None,
    water: Features | None = None,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
) -> Report:
    """Proves a folder of terrain tiles against the grid it was made from, by code of its own: errors of each level, borders,
    gaps between levels, which tiles there are. `src` and what says how it is read are as for `tiles`.

    >>> import os, tempfile, terrane
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "tiles")
    ...     made = terrane.tiles("synth:rough,size=129", path, max_level=11)
    ...     terrane.verify_tiles(path, "synth:rough,size=129").ok
    True
    """
    options: dict[str, Any] = {"geoid": None if geoid is None else os.fspath(geoid)}
    options |= {"threads": threads, "memory": memory}
    reading: dict[str, Any] = {"band": band, "nodata": nodata, "transform": transform, "crs": crs}
    with opened(src, **reading, clip=clip, water=water) as (grid, _):
        told = grid.verify_tiles(os.fspath(tiles), options, settings(None, None, progress))
    return Report(told)
