"""The library's front door, as the modules beside this one use it."""

from collections.abc import Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from terrane._settings import Settings

__all__ = [
    "Cloud",
    "Grid",
    "Mesh",
    "Plan",
    "__version__",
    "check_operation",
    "command_line",
    "is_mesh",
    "operations",
    "plan_operation",
    "read_lines",
    "report_on",
    "run_operation",
    "simplify_places",
    "write_geometries",
]

__version__: str

@final
class Grid:
    @staticmethod
    def open(names: Sequence[str], reading: dict[str, Any]) -> Grid: ...
    @staticmethod
    def array(
        array: NDArray[Any],
        place: Sequence[float] | None,
        crs: str | None,
        reading: dict[str, Any],
    ) -> Grid: ...
    @property
    def info(self) -> dict[str, Any]: ...
    @property
    def notes(self) -> list[tuple[str, str]]: ...
    def heights(self) -> NDArray[np.float64]: ...
    def tin(self, options: dict[str, Any], settings: Settings) -> Mesh: ...

@final
class Mesh:
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def triangles(self) -> NDArray[np.uint32]: ...
    @property
    def error(self) -> float: ...
    @property
    def rmse(self) -> float: ...
    @property
    def tolerance(self) -> float: ...
    @property
    def shortfall(self) -> str | None: ...
    @property
    def crs(self) -> str | None: ...
    def heights(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def tolerance_in(self, path: str) -> float: ...
    def write(self, path: str, overwrite: bool) -> int: ...
    def state(self) -> dict[str, Any]: ...
    @staticmethod
    def restore(
        vertices: NDArray[np.float64], triangles: NDArray[np.uint32], state: dict[str, Any]
    ) -> Mesh: ...

@final
class Cloud:
    @staticmethod
    def open(names: Sequence[str], reading: dict[str, Any]) -> Cloud: ...
    @staticmethod
    def array(
        points: NDArray[np.float64],
        classes: NDArray[np.uint8] | None,
        numbers: NDArray[np.uint8] | None,
        returns: NDArray[np.uint8] | None,
        flags: NDArray[np.uint8] | None,
        crs: str | None,
        reading: dict[str, Any],
    ) -> Cloud: ...
    @property
    def info(self) -> dict[str, Any]: ...

@final
class Plan:
    @staticmethod
    def open(folder: str) -> Plan: ...
    @property
    def folder(self) -> Any: ...
    def status(self) -> dict[str, Any]: ...
    def run(
        self,
        task: str | None,
        output: str | None,
        split: int | None,
        overwrite: bool,
        settings: Settings,
    ) -> dict[str, Any]: ...

def operations() -> dict[str, Any]: ...
def check_operation(operation: str, options: dict[str, Any], path: str | None) -> None: ...
def run_operation(
    operation: str,
    source: Grid | Cloud | str,
    path: str,
    options: dict[str, Any],
    settings: Settings,
) -> dict[str, Any]: ...
def plan_operation(
    operation: str,
    source: Grid | Cloud | str,
    folder: str,
    options: dict[str, Any],
    task_size: int | None,
    settings: Settings,
) -> Plan: ...
def report_on(
    name: str,
    source: Grid | Cloud | str,
    file: str | None,
    options: dict[str, Any],
    settings: Settings,
) -> dict[str, Any]: ...
def is_mesh(path: str) -> bool: ...
def command_line(args: Sequence[str]) -> int: ...
def read_lines(
    path: str, attribute: str
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], str | None]: ...
def simplify_places(
    positions: NDArray[np.float64],
    offsets: NDArray[np.int64],
    tolerance: float,
    method: str,
    rings: bool,
    settings: Settings,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]: ...
def write_geometries(
    path: str,
    groups: Sequence[tuple[str, NDArray[np.float64], Sequence[NDArray[np.int64]]]],
    crs: str | None,
) -> None: ...
