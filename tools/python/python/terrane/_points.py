"""Point clouds to files of points."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any

from terrane import _terrane
from terrane._clouds import cloud_of
from terrane._errors import refuse_existing, usage
from terrane._numbers import needed, number
from terrane._plans import Plan
from terrane._settings import Path, settings, system
from terrane._source import names_of


def points_of(
    *,
    point_format: int | None = None,
    las_version: str | float | None = None,
    dedupe: bool = False,
    thin: str | float | None = None,
    heights: str | None = None,
    classify: str | Sequence[str] = (),
    ground: str | None = None,
    tile: float | None = None,
    split: str | None = None,
    buffer: float | None = None,
    buffer_mark: str = "withheld",
) -> dict[str, Any]:
    """What is asked of points, as the library takes it."""
    if tile is None and buffer is not None:
        raise usage("buffer is around squares", "pass tile=SIDE, or leave it out")
    if tile is not None and split is not None:
        raise usage("tile and split both divide points into files", "pass one of them")
    return {
        "point_format": number("point_format", point_format),
        "las_version": None if las_version is None else str(las_version),
        "dedupe": dedupe,
        "thin": None if thin is None else str(thin),
        "heights": text("heights", heights),
        "classify": [classify] if isinstance(classify, str) else list(classify),
        "ground": text("ground", ground),
        "tile": number("side", tile, "tile"),
        "split": text("split", split),
        "buffer": 0.0 if buffer is None else number("buffer", buffer),
        "buffer_mark": text("buffer_mark", buffer_mark),
    }


def text(option: str, value: str | None) -> str | None:
    """A text as an option takes it; what is none is refused by name."""
    if value is None or isinstance(value, str):
        return value
    raise usage(f"{option} is {value!r}, which is no text", f"pass {option} as a str")


def points(
    src: Any,
    path: Path,
    *,
    classes: Iterable[int] | None = None,
    returns: str | int | None = None,
    bounds: Sequence[float] | None = None,
    z_range: Sequence[float] | None = None,
    where: str | None = None,
    every: int | None = None,
    salvage: bool = False,
    point_format: int | None = None,
    las_version: str | float | None = None,
    dedupe: bool = False,
    thin: str | float | None = None,
    heights: str | None = None,
    classify: str | Sequence[str] = (),
    ground: str | None = None,
    tile: float | None = None,
    split: str | None = None,
    buffer: float | None = None,
    buffer_mark: str = "withheld",
    to_crs: str | None = None,
    shift_grid: Path | None = None,
    geoid: Path | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
) -> dict[str, Any]:
    r"""Writes the points of clouds with all that is known of them, into LAS, LAZ, COPC or text by the ending of `path`
    (`.las`, `.laz`, `.copc.laz`, `.csv`), or into a folder of a LAZ file for each square (`tile`) or each value of an
    attribute (`split`). What is written appears whole or not at all. Returns what `terrane points --json` tells.

    Parameters
    ----------
    src, classes, returns, bounds, z_range, where, every, salvage, threads, memory, progress
        As for `grid`, of files.
    point_format
        The format of the points, 0 to 10; the first that holds all fields of all files unless said.
    las_version
        The version of LAS, "1.2" to "1.5"; the first that has points of the format unless said.
    dedupe
        Of points of one place and time only the first.
    thin
        One point of each square of a size: 2, "2:lowest", "0.5:highest", "1:random=7".
    heights
        How high points are above the ground: "dimension" (HeightAboveGround of their extra bytes), or as their "z".
    classify, ground
        What gives classes ("noise", "noise:statistical:k=12", "ground", "ground:reclassify=9,17", "height:3=0.5,4=2,5=5"), and which points are
        ground ("class", "csf", "auto" ...).
    tile, buffer, buffer_mark
        The side of squares; points around each up to so far away, too, marked as "withheld" or "synthetic".
    split
        The attribute whose values divide points into files: "classification", "point_source_id" (flight lines) ...
    to_crs, shift_grid, geoid
        The reference system that they are to be in, and files for it.
    overwrite
        Replace what exists.

    >>> import os, tempfile, terrane
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     cloud, path = (os.path.join(folder, name) for name in ("cloud.xyz", "thin.laz"))
    ...     with open(cloud, "w") as file:
    ...         _ = file.write("x y z class\n0.5 0.5 3 2\n0.9 0.1 2 2\n1.5 0.5 4 6\n")
    ...     made = terrane.points("cloud:" + cloud, path, thin="1:lowest")
    ...     made["points"], terrane.grid(path, cell=1.0, stat="count").data.max()
    (2, np.float64(1.0))
    """
    name = os.fspath(path)
    refuse_existing(name, overwrite)
    cloud = opened(src, classes, returns, bounds, z_range, where, every, salvage)
    asked = points_of(
        point_format=point_format,
        las_version=las_version,
        dedupe=dedupe,
        thin=thin,
        heights=heights,
        classify=classify,
        ground=ground,
        tile=tile,
        split=split,
        buffer=buffer,
        buffer_mark=buffer_mark,
    )
    to = system(to_crs, shift_grid, geoid)
    return cloud.points(name, asked, to, overwrite, settings(threads, memory, progress))


def plan_points(
    src: Any,
    folder: Path,
    tile: float,
    *,
    cut: int | None = None,
    classes: Iterable[int] | None = None,
    returns: str | int | None = None,
    bounds: Sequence[float] | None = None,
    z_range: Sequence[float] | None = None,
    where: str | None = None,
    every: int | None = None,
    salvage: bool = False,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
    **options: Any,
) -> Plan:
    r"""Writes down in a folder what squares of points are to be made: those of `points` with the same options, byte for byte.
    `cut` is how many squares a task has along its side.

    >>> import os, tempfile, terrane
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     cloud, work, tiles = (os.path.join(folder, name) for name in ("cloud.xyz", "work", "tiles"))
    ...     with open(cloud, "w") as file:
    ...         file.writelines(f"{i % 30} {i // 30} 1\n" for i in range(900))
    ...     plan = terrane.plan_points("cloud:" + cloud, work, 10.0, cut=2, buffer=2.0)
    ...     done = plan.run(output=tiles)
    ...     len(os.listdir(tiles)), plan.status()["to_do"]
    (9, [])
    """
    cloud = opened(src, classes, returns, bounds, z_range, where, every, salvage)
    asked = points_of(tile=needed("side", tile, "tile"), **options)
    run, parts = settings(threads, memory, progress), number("cut", cut)
    return Plan(cloud.plan_points(os.fspath(folder), asked, parts, run))


def opened(
    src: Any,
    classes: Iterable[int] | None,
    returns: str | int | None,
    bounds: Sequence[float] | None,
    z_range: Sequence[float] | None,
    where: str | None,
    every: int | None,
    salvage: bool,
) -> _terrane.Cloud:
    """The cloud in files, and what is wanted of it."""
    if names_of(src) is None:
        raise usage("points are copied from files", "pass paths")
    return cloud_of(
        src,
        classes=classes,
        returns=returns,
        bounds=bounds,
        z_range=z_range,
        where=where,
        every=every,
        salvage=salvage,
    )
