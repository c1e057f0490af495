"""Plans: resumable jobs for many processes."""

from __future__ import annotations

import os
from typing import Any

from terrane import _terrane
from terrane._errors import refuse_existing, usage
from terrane._numbers import number
from terrane._settings import Path, settings


class Plan:
    """A plan in a folder: output, input and tasks. Any number of processes and machines with access to the folder may
    run it, or its tasks, concurrently and repeatedly."""

    def __init__(self, plan: _terrane.Plan) -> None:
        self._plan = plan

    @property
    def folder(self) -> str:
        """The folder."""
        return str(self._plan.folder)

    def status(self) -> dict[str, Any]:
        """Status of the plan: `to_do` has the open tasks with their dependencies, `written` the path of the result."""
        return self._plan.status()

    def run(
        self,
        client: Any = None,
        *,
        output: Path | None = None,
        task: str | None = None,
        split: int | None = None,
        overwrite: bool = False,
        threads: int | None = None,
        memory: int | str | None = None,
        progress: Any = None,
        **options: Any,
    ) -> dict[str, Any]:
        """Runs the open tasks, here or on a cluster: `client` is a `dask.distributed` client, and further options are
        those of `terrane.dask.run`. `split` writes a mesh of a grid as a folder with one mesh per `split` by `split`
        tiles. Returns the report."""
        name = None if output is None else os.fspath(output)
        if name is not None:
            refuse_existing(name, overwrite)
        if client is None:
            if options:
                raise TypeError(f"run() got an unexpected keyword argument {min(options)!r}")
            if not isinstance(task, str | None):
                first = next((task for task, _ in self.status()["to_do"]), "finish")
                raise usage(f"task is {task!r}, expected a name", f"pass one such as {first!r}")
            parts = number("split", split)
            return self._plan.run(task, name, parts, overwrite, settings(threads, memory, progress))
        if task is not None or progress is not None or split is not None:
            raise usage(
                "task, split and progress are not supported with client",
                "leave them out, or leave out client",
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
    """Opens the plan in a folder."""
    return Plan(_terrane.Plan.open(os.fspath(folder)))
