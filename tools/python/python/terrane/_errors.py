"""Errors: one class, with subclasses that match Python's own."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

class Error(Exception):
    """An error of terrane: its `kind`, `file`, `place` and `remedy`; the last three may be None. The text is that of
    the command line.

    >>> import terrane
    >>> try:
    ...     terrane.tin("missing.tif", max_error=1.0)
    ... except terrane.Error as error:
    ...     error.kind, error.file
    ('bad_input', 'missing.tif')
    """

    kind: str
    file: str | None
    place: str | None
    remedy: str | None

    def __init__(
        self,
        message: str,
        kind: str = "usage",
        file: str | None = None,
        place: str | None = None,
        remedy: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.kind, self.file, self.place, self.remedy = kind, file, place, remedy

    def __str__(self) -> str:
        return self.message

    def about(self, path: str, name: str) -> Error:
        """The same error with `name` instead of the path of a temporary file."""
        texts = [self.message, self.file, self.place, self.remedy]
        message, file, place, remedy = (text and text.replace(path, name) for text in texts)
        return type(self)(message or "", self.kind, file, place, remedy)

    def __reduce__(self) -> tuple[type[Error], tuple[str | None, ...]]:
        return type(self), (self.message, self.kind, self.file, self.place, self.remedy)


class InputError(Error, ValueError):
    """An invalid option or input: also a ValueError."""


class FileError(Error, OSError):
    """Reading or writing failed: also an OSError."""


class MissingFileError(InputError, FileNotFoundError):
    """A missing file: also a FileNotFoundError."""


class OutputError(FileError):
    """An output that exists, cannot be created, or cannot hold the result."""


class ExistsError(OutputError, FileExistsError):
    """An existing output: also a FileExistsError."""


class ResourceError(Error, MemoryError):
    """Too little memory, or another resource: also a MemoryError."""


class Interrupted(Error):
    """The job was stopped by its caller."""


CLASSES: dict[str, type[Error]] = {
    "usage": InputError,
    "bad_input": InputError,
    "unsupported": InputError,
    "limit": InputError,
    "cannot_write": OutputError,
    "io": FileError,
    "resource": ResourceError,
    "interrupted": Interrupted,
}


def make(
    kind: str,
    message: str,
    file: str | None,
    place: str | None,
    remedy: str | None,
    is_missing: bool,
) -> Error:
    """The exception for an error of the library."""
    cls = MissingFileError if is_missing else CLASSES.get(kind, Error)
    return cls(message, kind, file, place, remedy)


def refuse_existing(path: str, overwrite: bool) -> None:
    """Raises an error for an existing output without `overwrite`."""
    if not overwrite and os.path.lexists(path):
        remedy = "choose another name, or pass overwrite=True"
        told = f"{path}: output already exists; {remedy}"
        raise ExistsError(told, "cannot_write", path, remedy=remedy)


@contextmanager
def in_memory(path: str) -> Iterator[None]:
    """Replaces the path of a temporary file in errors.

    >>> with in_memory("/tmp/mesh.ply"):
    ...     raise usage("/tmp/mesh.ply: no mesh")
    Traceback (most recent call last):
    ...
    terrane._errors.InputError: in memory: no mesh
    """
    try:
        yield
    except Error as error:
        raise error.about(path, "in memory") from None


def usage(message: str, remedy: str | None = None) -> Error:
    """An error for an invalid option or argument."""
    told = message if remedy is None else f"{message}; {remedy}"
    return InputError(told, "usage", remedy=remedy)


def warn(text: str) -> None:
    """Issues a warning at the caller of this package."""
    names, frame = [], sys._getframe()
    while frame.f_back is not None:
        names.append(frame.f_code.co_filename)
        frame = frame.f_back
    # Frames of other modules may be between those of this package.
    ours = [level for level, name in enumerate(names) if name.startswith(FOLDER)]
    warnings.warn(text, stacklevel=ours[-1] + 2)


FOLDER = os.path.dirname(__file__) + os.sep
