"""Settings of all jobs: threads, memory, temporary folder and progress."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypedDict

Progress = Callable[[str, int, int], object]
Path = str | os.PathLike[str]
# Path of a vector file, or geometries: one or several of shapely, a GeoSeries or a GeoDataFrame.
Features = Any


class Settings(TypedDict):
    """Settings for the library."""

    threads: int | None
    memory: int | str | None
    progress: Progress | None


def settings(
    threads: int | None,
    memory: int | str | None,
    progress: Any = None,
) -> Settings:
    """Settings from function arguments. `progress` is a function of stage, done and total, the tqdm class, or True
    for tqdm."""
    from terrane._numbers import number

    return {
        "threads": number("threads", threads),
        "memory": memory if isinstance(memory, str) else number("memory", memory),
        "progress": told_by(progress),
    }


def told_by(progress: Any) -> Progress | None:
    """Progress callback."""
    if progress is None or progress is False:
        return None
    if progress is True:
        from tqdm.auto import tqdm

        progress = tqdm
    if isinstance(progress, type):
        return Bars(progress)
    if not callable(progress):
        from terrane._errors import usage

        raise usage(
            f"progress is a {type(progress).__name__}, which is not callable",
            "pass a function of stage, done and total, or tqdm",
        )
    told: Progress = progress
    return told


class Bars:
    """Progress bars, one per stage, of a class such as tqdm."""

    def __init__(self, cls: type[Any]) -> None:
        self.cls = cls
        self.stage = ""
        self.bar: Any = None

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Updates the bar of a stage."""
        if stage != self.stage or self.bar is None:
            if self.bar is not None:
                self.bar.close()
            self.stage, self.bar = stage, self.cls(total=total, desc=stage, unit_scale=True)
        self.bar.update(done - self.bar.n)
        if done >= total:
            self.bar.refresh()
            self.bar.close()
            self.bar = None
            self.stage = ""
