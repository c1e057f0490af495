"""Numeric options: what is no number, or none that can be, is refused by name, whichever function has it."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import terrane
from lands import rough
from terrane import _numbers, _operations

HEIGHTS = rough(20, 20)
POINTS = np.random.default_rng(1).uniform(0, 50, size=(500, 3))
LINE = np.cumsum(np.random.default_rng(2).normal(size=(50, 2)), axis=0)
CLOUD = "synth:cloud,size=20,density=1"

# Each function as it is called, in a folder, with all but one of its numeric options.
CALLS: dict[str, Callable[..., Any]] = {
    "tin": lambda folder, **more: terrane.tin(HEIGHTS, **with_goal(more)),
    "write_tin": lambda folder, **more: terrane.write_tin(
        HEIGHTS, folder / "m.ply", **with_goal(more)
    ),
    "verify": lambda folder, **more: terrane.verify(MESH, HEIGHTS, **more),
    "contour": lambda folder, **more: terrane.contour(HEIGHTS, **with_levels(more)),
    "simplify": lambda folder, **more: terrane.simplify(LINE, **{"tolerance": 1.0, **more}),
    "tiles": lambda folder, **more: terrane.tiles("synth:rough,size=17", folder / "t", **more),
    "grid": lambda folder, **more: terrane.grid(POINTS, **more),
    "points": lambda folder, **more: terrane.points(
        cloud_in(folder),
        folder / ("out" if more.keys() & {"buffer", "tile"} else "out.laz"),
        **({"tile": 10.0} | more if "buffer" in more else more),
    ),
    "plan": lambda folder, **more: terrane.plan(
        "synth:rough,size=17", folder / "w", **{"max_error": 1.0, **more}
    ),
    "plan_cloud_tin": lambda folder, **more: terrane.plan_cloud_tin(
        CLOUD, folder / "w", **{"max_error": 1.0, **more}
    ),
    "plan_points": lambda folder, **more: terrane.plan_points(
        cloud_in(folder), folder / "w", **{"tile": 10.0, **more}
    ),
    "write_cloud_tin": lambda folder, **more: terrane.write_cloud_tin(
        POINTS, folder / "m.ply", **{"max_error": 1.0, **more}
    ),
    "verify_cloud": lambda folder, **more: terrane.verify_cloud(mesh_in(folder), POINTS, **more),
    "Delatin": lambda folder, **more: terrane.Delatin(HEIGHTS, **more),
}
MESH = terrane.tin(HEIGHTS, max_error=5.0)

# What no numeric option may be.
NUMBERS: list[Any] = [
    float("nan"),
    -1,
    -0.5,
    float("inf"),
    "5",
    True,
    np.float64("nan"),
    object(),
    [1.0],
]
# Options that have several numbers, that may be below 0 or infinite, or that are called otherwise.
SIGNED = {"levels", "border_height", "z_scale", "z_exag"}
SEVERAL = {"levels", "classes"}
OTHERWISE = {
    # The name of an attribute.
    ("points", "split"): "attribute",
    ("plan_points", "split"): "attribute",
}
# Numbers as signatures have them.
PLAIN = {"int", "float", "int | None", "float | None"}
# What may be text.
TEXTS = {"memory"}


def with_goal(more: dict[str, Any]) -> dict[str, Any]:
    """Options with something to reach."""
    has_goal = more.keys() & {"max_error", "max_vertices", "max_triangles"}
    return more if has_goal else {"max_error": 1.0, **more}


def with_levels(more: dict[str, Any]) -> dict[str, Any]:
    """Options with heights of lines."""
    return more if more.keys() & {"interval", "levels"} else {"interval": 5.0, **more}


def cloud_in(folder: Path) -> str:
    """A file of points."""
    path = folder / "cloud.xyz"
    np.savetxt(path, POINTS)
    return f"cloud:{path}"


def mesh_in(folder: Path) -> Path:
    """A mesh of points."""
    path = folder / "cloud.ply"
    if not path.exists():
        terrane.write_cloud_tin(POINTS, path, 1.0)
    return path


def options() -> list[tuple[str, str]]:
    """Each numeric option of each function."""
    found = []
    for name in CALLS:
        function = getattr(terrane, name)
        known = list(inspect.signature(function).parameters)
        told = [
            (name, option)
            for option in known
            if OTHERWISE.get((name, option), option) in _numbers.OPTIONS
        ]
        if name in ("grid", "points", "plan_points"):
            table = _operations.tables()[name.removeprefix("plan_")]["options"]
            own = [_operations.keyword_of(option) for option in table if option["type"] in PLAIN]
            told += [(name, option) for option in own if option in known and option != "nodata"]
            told = sorted(set(told))
        assert told, name
        found += told
    return found


@pytest.mark.parametrize(("name", "option"), options())
def test_what_is_no_number_of_its_range_is_refused_by_name(
    tmp_path: Path, name: str, option: str
) -> None:
    for value in NUMBERS:
        is_fine = (
            (option in SIGNED and isinstance(value, int | float) and value < 0)
            or (option in TEXTS and isinstance(value, str))
            or ((name, option) == ("contour", "tolerance") and isinstance(value, str))
        )
        if is_fine:
            continue
        given = [value] if option in SEVERAL else value
        if option in SEVERAL and isinstance(value, list):
            continue
        with pytest.raises(ValueError, match=option) as caught:
            CALLS[name](tmp_path, **{option: given})
            pytest.fail(f"{name}({option}={given!r}) is taken")
        assert isinstance(caught.value, terrane.InputError), (value, caught.value)
        assert caught.value.kind == "usage", (value, caught.value)


def test_every_number_that_is_asked_for_is_known() -> None:
    """Every option that is stated as a number in a signature is in the table of ranges."""
    for name in terrane.__all__:
        function = getattr(terrane, name)
        if not callable(function) or inspect.isclass(function) and name != "Delatin":
            continue
        # Those of operations are in their tables.
        if function.__module__ == "terrane._operations":
            continue
        for option, stated in inspect.signature(function).parameters.items():
            if stated.annotation in PLAIN and option != "nodata":
                known = OTHERWISE.get((name, option), option)
                assert known in _numbers.OPTIONS, (name, option)


GOOD = [2, 2.0, np.float32(2), np.int64(2), np.uint8(2), np.array(2)]


@pytest.mark.parametrize("value", GOOD, ids=repr)
def test_numbers_of_any_package_are_taken(value: Any) -> None:
    from decimal import Decimal
    from fractions import Fraction

    expected = terrane.tin(HEIGHTS, max_error=2.0, tile=16)
    for given in (value, Decimal(2), Fraction(4, 2)):
        made = terrane.tin(HEIGHTS, max_error=given, tile=8 * value)
        assert np.array_equal(made.vertices, expected.vertices)
    assert len(terrane.tin(HEIGHTS, max_vertices=1e2).vertices) <= 100  # type: ignore[arg-type]


@pytest.mark.parametrize("option", ["ground", "split", "buffer_flag"])
@pytest.mark.parametrize("value", [5, 0.5, True, b"class", ["class"]])
def test_what_is_no_text_is_refused_by_name(tmp_path: Path, option: str, value: Any) -> None:
    with pytest.raises(terrane.InputError, match=f"{option} is "):
        CALLS["points"](tmp_path, **{"tile": None, option: value})


def test_what_stands_for_voids_is_a_number() -> None:
    for value in ("5", True, [1], object()):
        with pytest.raises(terrane.InputError, match="nodata is"):
            terrane.tin(HEIGHTS, max_error=1.0, nodata=value)  # type: ignore[arg-type]
    for value in (float("nan"), float("inf"), -9999):
        terrane.tin(HEIGHTS, max_error=1.0, nodata=value)


def test_a_range_of_heights_may_have_one_end(tmp_path: Path) -> None:
    ends = (25.0, float("inf"))
    plan = terrane.plan_points(cloud_in(tmp_path), tmp_path / "work", tile=50.0, z_range=ends)
    plan.run(output=tmp_path / "squares")
    count = int((POINTS[:, 2] >= 25).sum())
    assert terrane.grid(POINTS, cell=50.0, stat="count", z_range=ends).data.sum() == count
    squares = str(tmp_path / "squares")
    assert terrane.grid(squares, cell=50.0, stat="count").data.sum() == count
