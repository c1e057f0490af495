"""Numbers that functions are given: which option may be what."""

from __future__ import annotations

import math
import operator
from typing import Any, NamedTuple

from terrane._errors import usage


class Range(NamedTuple):
    """What an option may be: from `least` on, or above `over`; whole or not; infinite or not."""

    least: float | None = None
    over: float | None = None
    most: float | None = None
    whole: bool = False
    infinite: bool = False

    def words(self) -> str:
        """What to pass, in words."""
        kind = "a whole number" if self.whole else "a number"
        ends = [
            (self.least, f"from {self.least} on"),
            (self.over, f"above {self.over}"),
            (self.most, f"up to {self.most}"),
        ]
        return " ".join([kind, *(text for end, text in ends if end is not None)])

    def holds(self, value: float) -> bool:
        """True where `value` is in the range, which NaN never is."""
        return (
            not math.isnan(value)
            and (self.least is None or value >= self.least)
            and (self.over is None or value > self.over)
            and (self.most is None or value <= self.most)
            and (self.infinite or math.isfinite(value))
        )


COUNT = Range(least=1, whole=True)
LENGTH = Range(over=0)
TOLERANCE = Range(least=0)
ANY = Range()

# All numeric options, by their names, which mean the same in all functions.
OPTIONS = {
    "max_error": TOLERANCE,
    "max_vertices": COUNT,
    "max_triangles": COUNT,
    "max_points": COUNT,
    "min_angle": LENGTH,
    "tolerance": TOLERANCE,
    "interval": LENGTH,
    "levels": ANY,
    "band": Range(least=1, most=2**32 - 1, whole=True),
    "tile": COUNT,
    "threads": Range(least=1, most=1024, whole=True),
    "memory": Range(least=1, most=2**63 - 1, whole=True),
    "split": COUNT,
    "task_size": Range(least=1, most=2**32 - 1, whole=True),
    "max_level": Range(least=0, most=20, whole=True),
    "base_height": TOLERANCE,
    "border_height": ANY,
    "border_size": Range(least=0, whole=True),
    "blur": Range(least=0, whole=True),
    "gamma": TOLERANCE,
    "z_scale": ANY,
    "z_exag": ANY,
    "height": COUNT,
    "width": COUNT,
}


def number(name: str, value: Any, called: str | None = None) -> Any:
    """The number that `value` is, as option `name` may have it: an int where it is whole, else a float; None stays None.
    `called` is what the function calls the option where others mean something else by that.

    >>> number("max_error", 2), number("tile", 64.0)
    (2.0, 64)
    """
    if value is None:
        return None
    of = OPTIONS[name]
    given = real(value)
    if given is None or not of.holds(given) or (of.whole and given != int(given)):
        raise usage(f"{called or name} is {value!r}", f"pass {of.words()}")
    return int(given) if of.whole else float(given)


def needed(name: str, value: Any, called: str | None = None) -> Any:
    """The number that `value` is, which must be one."""
    if value is None:
        raise usage(f"{called or name} is None", f"pass {OPTIONS[name].words()}")
    return number(name, value, called)


def checked(**options: Any) -> dict[str, Any]:
    """The numbers that options are, by their names."""
    return {name: number(name, value) for name, value in options.items()}


def real(value: Any) -> float | int | None:
    """The number that `value` is, of Python, numpy or any other package; None for text, truth and all else."""
    if isinstance(value, bool | str | bytes | bytearray) or type(value).__name__ in (
        "bool",
        "bool_",
    ):
        return None
    try:
        return operator.index(value)
    except TypeError:
        pass
    if not hasattr(value, "__float__"):
        return None
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return None
