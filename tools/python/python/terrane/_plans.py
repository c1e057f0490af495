"""Work for many processes, which may be killed."""

from __future__ import annotations

import os
from typing import Any

from terrane import _beside, _terrane
from terrane._clouds import cloud_of
from terrane._errors import refuse_existing, usage
from terrane._numbers import needed, number
from terrane._settings import Path, settings
from terrane._source import opened
from terrane._tin import asked, kept


class Plan:
    """A plan in a folder: what is to be made, of what, by which tasks. Any number of processes and machines that see the
    folder may run it, or its tasks, at the same time and as often as they like."""

    def __init__(self, plan: _terrane.Plan) -> None:
        self._plan = plan

    @property
    def folder(self) -> str:
        """The folder."""
        return str(self._plan.folder)

    def status(self) -> dict[str, Any]:
        """How far the work has come: `to_do` has the tasks that are not done, each with those it comes after; `written`
        where the result is."""
        return self._plan.status()

    def run(
        self,
        client: Any = None,
        *,
        output: Path | None = None,
        task: str | None = None,
        overwrite: bool = False,
        threads: int | None = None,
        memory: int | str | None = None,
        progress: Any = None,
        **options: Any,
    ) -> dict[str, Any]:
        """Does what is not done, here or on a cluster: `client` is one of `dask.distributed`, and further options are those
        of `terrane.dask.run`. Returns what was done."""
        name = None if output is None else os.fspath(output)
        if name is not None:
            refuse_existing(name, overwrite)
        if client is None:
            if options:
                raise TypeError(f"run() got an unexpected keyword argument {min(options)!r}")
            return self._plan.run(task, name, overwrite, settings(threads, memory, progress))
        if task is not None or progress is not None:
            raise usage(
                "a cluster does all tasks that are not done, and tells of it itself",
                "leave out task and progress, or client",
            )
        from dataclasses import asdict

        from terrane import dask

        known: dict[str, Any] = {} if memory is None else {"memory": str(memory)}
        known |= {} if threads is None else {"threads": threads}
        report = dask.run(self.folder, client, output=name, overwrite=overwrite, **known, **options)
        return asdict(report)

    def __repr__(self) -> str:
        return f"<terrane.Plan: {self.folder}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return open_plan, (self.folder,)


def open_plan(folder: Path) -> Plan:
    """The plan in a folder."""
    return Plan(_terrane.Plan.open(os.fspath(folder)))


def plan(
    src: Any,
    folder: Path,
    max_error: float | None = None,
    *,
    bound: str = "samples",
    band: int | None = None,
    nodata: float | None = None,
    clip: Path | None = None,
    water: Path | None = None,
    keep_points: Path | None = None,
    breaklines: Path | None = None,
    fit: bool = False,
    data_dependent: bool = False,
    min_angle: float | None = None,
    tile: int = 512,
    task_size: int | None = None,
    format: str | None = None,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
) -> Plan:
    """Writes down in a folder how the mesh of grids in files is made: that of `tin`, byte for byte. `task_size` is how many
    rows of tiles a task has.

    >>> import os, tempfile, terrane
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     work, mesh = (os.path.join(folder, name) for name in ("work", "mesh.ply"))
    ...     plan = terrane.plan("synth:rough,size=300", work, max_error=5.0, tile=64, task_size=2)
    ...     done = plan.run(output=mesh)
    ...     terrane.verify(mesh, "synth:rough,size=300").ok, plan.status()["to_do"]
    (True, [])
    """
    run, parts = settings(threads, memory, progress), number("task_size", task_size)
    mesh = asked(
        max_error=number("max_error", max_error),
        max_vertices=None,
        max_triangles=None,
        bound=bound,
        strict=False,
        drop=True,
        fit=fit,
        data_dependent=data_dependent,
        min_angle=min_angle,
        tile=tile,
    )
    beside = _beside.paths(
        "a plan is run later",
        clip=clip,
        water=water,
        keep_points=keep_points,
        breaklines=breaklines,
    )
    with opened(src, band=band, nodata=nodata, **beside) as (source, files):
        mesh |= kept(files)
        return Plan(source.plan_tin(os.fspath(folder), mesh, format, parts, run))


def plan_cloud_tin(
    points: Any,
    folder: Path,
    max_error: float,
    *,
    task_size: int | None = None,
    format: str | None = None,
    threads: int | None = None,
    memory: int | str | None = None,
    progress: Any = None,
    **reading: Any,
) -> Plan:
    """Writes down in a folder how the mesh of points in files is made, which is, byte for byte, that of `write_cloud_tin`
    with the same options. `task_size` is the most points of a task, but for the few that are worked on together.

    >>> import os, tempfile, terrane
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     work, mesh = (os.path.join(folder, name) for name in ("work", "mesh.ply"))
    ...     plan = terrane.plan_cloud_tin("synth:cloud,size=60,density=2", work, 0.5)
    ...     done = plan.run(output=mesh)
    ...     terrane.verify_cloud(mesh, "synth:cloud,size=60,density=2").ok, plan.status()["to_do"]
    (True, [])
    """
    run = settings(threads, memory, progress)
    error, parts = needed("max_error", max_error), number("task_size", task_size)
    _beside.settle(reading)
    reading |= _beside.paths("a plan is run later", clip=reading.pop("clip", None))
    cloud = cloud_of(points, reading)
    return Plan(cloud.plan_tin(os.fspath(folder), error, format, parts, run))
