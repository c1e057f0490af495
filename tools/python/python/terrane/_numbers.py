"""Validation of numeric arguments."""

from __future__ import annotations

import math
import operator
from typing import Any, NamedTuple

from terrane._errors import usage


class Range(NamedTuple):
    """Range of an option: at least `least`, or above `over`; integer or not; finite or not."""

    least: float | None = None
    over: float | None = None
    most: float | None = None
    whole: bool = False
    infinite: bool = False

    def words(self) -> str:
        """Description of valid values."""
        kind = "a whole number" if self.whole else "a number"
        ends = [
            (self.least, f"from {self.least} on"),
            (self.over, f"above {self.over}"),
            (self.most, f"up to {self.most}"),
        ]
        return " ".join([kind, *(text for end, text in ends if end is not None)])

    def holds(self, value: float) -> bool:
        """True if `value` is in the range; false for NaN."""
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

# All numeric options by name, with the same meaning in all functions.
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
    """Validates `value` for option `name`: returns an int for integer options, otherwise a float; None stays None.
    `called` is the argument's name in the function if it differs.

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
    """As `number`, but None is an error."""
    if value is None:
        raise usage(f"{called or name} is None", f"pass {OPTIONS[name].words()}")
    return number(name, value, called)


def checked(**options: Any) -> dict[str, Any]:
    """Validated numeric options by name."""
    return {name: number(name, value) for name, value in options.items()}


def real(value: Any) -> float | int | None:
    """The number `value` of Python, numpy or another package; None for strings, booleans and others."""
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
