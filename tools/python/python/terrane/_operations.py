"""Operations on grids that write a file: a function for each, made from the table of its options, which the command line and
Rust read, too. What editors and type checkers see is in `_operations.pyi`, which `stub` writes."""

from __future__ import annotations

import inspect
import os
import tempfile
import textwrap
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from terrane import _terrane
from terrane._errors import refuse_existing, usage
from terrane._lines import Lines, sorted_lines
from terrane._settings import settings
from terrane._source import crs_text, opened

# What says how the grid is read, with what only Python has; all else is an option of the operation.
SOURCE = ("band", "nodata", "transform", "crs", "clip", "water")
OF_SOURCE = {
    "transform": "Where an array lies, in rasterio's order",
    "crs": "The reference system of an array: text, a code, or one of pyproj or rasterio",
    "progress": "A function of the stage, what is done and the total, or tqdm",
}
# What Python has in place of texts.
TYPES = {"band": "int | None", "clip": "Features | None", "water": "Features | None", "to_crs": "Any", "output": "Path | None"}


@cache
def tables() -> dict[str, Any]:
    """All operations by name, with what is said of their options."""
    told: dict[str, Any] = _terrane.operations()
    return told


def run(name: str, src: Any, path: Any, options: dict[str, Any]) -> dict[str, Any]:
    """Runs an operation with all keywords that were given; what can be wrong with these is told before anything is opened."""
    of_grids = tables()[name]["of_grids"]
    reading = {key: options.pop(key) for key in SOURCE if of_grids and key in options}
    progress = settings(None, None, options.pop("progress", None))
    for key in ("to_crs", "to-crs"):
        if options.get(key) is not None:
            options[key] = crs_text(options[key])
    output = os.fspath(path)
    _terrane.check_operation(name, options, output)
    refuse_existing(output, bool(options.get("overwrite")))
    if not of_grids:
        return _terrane.run_on_features(name, os.fspath(src), output, options, progress)
    with opened(src, **reading) as (grid, _):
        return grid.run(name, output, options, progress)


def written(name: str) -> Callable[..., dict[str, Any]]:
    """The function of an operation that writes a file."""
    names = ["src", *(own["name"] for own in tables()[name]["options"] if own["positional"]), "path"]

    def function(*values: Any, **options: Any) -> dict[str, Any]:
        twice = [key for key in names[: len(values)] if key in options]
        given = {**dict(zip(names, values, strict=False)), **options}
        if twice or len(values) > len(names) or not given.keys() >= set(names):
            raise usage(f"{called(name)} takes {', '.join(names)} and keywords")
        return run(name, given.pop("src"), given.pop("path"), given)

    return documented(function, name)


# What lines in memory do not have.
OF_FILES = ("index", "with_z", "3d", "format", "overwrite")


def contour(
    src: Any, interval: float | None = None, *, output: Any = None, **options: Any
) -> Lines | dict[str, Any]:
    """Lines in memory, unless there is an output."""
    options["interval"] = interval
    if output is not None:
        return run("contour", src, output, options)
    for key in OF_FILES:
        if options.get(key):
            raise usage(f"{key} is for files, and the lines stay in memory", "pass output, too")
    with tempfile.TemporaryDirectory(prefix="terrane-") as folder:
        path = os.path.join(folder, "lines.fgb")
        run("contour", src, path, options)
        found = _terrane.read_lines(path, options.get("attribute") or "elev")
    coordinates, offsets, values, crs = found
    order = np.lexsort((np.arange(len(values)), values))
    if not np.array_equal(order, np.arange(len(order))):
        coordinates, offsets, values = sorted_lines(coordinates, offsets, values, order)
    return Lines(coordinates, offsets, values, crs)


def called(name: str) -> str:
    """The function of an operation. That which takes geometries is called `simplify`."""
    return {"simplify": "simplify_file"}.get(name, name.replace("-", "_"))


def parameters(name: str) -> list[inspect.Parameter]:
    """The parameters of the function of an operation: the source, names, and keywords."""
    kinds = inspect.Parameter
    options = {option["name"]: option for option in tables()[name]["options"]}

    def parameter(name: str, kind: Any, default: Any = kinds.empty) -> inspect.Parameter:
        option = options.pop(name, {"type": "Any"})
        annotation = TYPES.get(name, option["type"])
        # That no band is named is another thing than that the first one is.
        default = None if name == "band" else option.get("default", default)
        return kinds(name, kind, default=default, annotation=annotation)

    names = [name for name, option in options.items() if option["positional"]]
    found = [kinds(name, kinds.POSITIONAL_OR_KEYWORD, annotation="Any") for name in ["src", *names]]
    for key in names:
        del options[key]
    if name == "contour":
        found.append(parameter("interval", kinds.POSITIONAL_OR_KEYWORD))
        found.append(parameter("output", kinds.KEYWORD_ONLY, None))
    else:
        found.append(kinds("path", kinds.POSITIONAL_OR_KEYWORD, annotation="Path"))
    found += [parameter(key, kinds.KEYWORD_ONLY) for key in list(options)]
    more = OF_SOURCE if tables()[name]["of_grids"] else ["progress"]
    return found + [parameter(key, kinds.KEYWORD_ONLY, None) for key in more]


def documented(function: Any, name: str) -> Any:
    """The function with its name, signature and documentation."""
    function.__name__ = function.__qualname__ = called(name)
    function.__module__ = __name__
    function.__signature__ = inspect.Signature(parameters(name))
    function.__doc__ = documentation(name)
    return function


def documentation(name: str) -> str:
    """What an operation is for, what its options are, and an example."""
    table = tables()[name]
    lines = [table["about"], "", "Parameters", "----------"]
    rows = [(option["name"], option["about"], option["default_text"]) for option in table["options"]]
    own = {parameter.name for parameter in parameters(name)}
    rows += [(key, about, None) for key, about in OF_SOURCE.items() if key in own]
    for key, about, default in rows:
        text = about if default is None else f"{about} (default: {default})"
        lines += [key, textwrap.indent(textwrap.fill(text, 110), "    ")]
    return "\n".join([*lines, "", textwrap.dedent(EXAMPLES.get(name, "")), ""])


def stub() -> str:
    """The text of `_operations.pyi`."""
    lines = [
        '"""Operations on grids that write a file. Made by `terrane._operations.stub`, not by hand."""',
        "",
        "from collections.abc import Sequence",
        "from typing import Any, Literal",
        "",
        "from terrane._lines import Lines",
        "from terrane._settings import Features, Path",
        "",
        "def stub() -> str: ...",
    ]
    for name in tables():
        lines.append(f"def {called(name)}(")
        found = parameters(name)
        first = [own.kind for own in found].index(inspect.Parameter.KEYWORD_ONLY)
        for place, own in enumerate(found):
            default = "" if own.default is own.empty else f" = {own.default!r}"
            lines += ["    *,"] * (place == first)
            lines.append(f"    {own.name}: {own.annotation}{default}".replace("'", '"') + ",")
        result = "Lines | dict[str, Any]" if name == "contour" else "dict[str, Any]"
        lines.append(f") -> {result}: ...")
    return "\n".join(lines) + "\n"


EXAMPLES = {
    "contour": """
        >>> import numpy as np, terrane
        >>> cone = np.hypot(*np.mgrid[-20:21, -20:21])
        >>> lines = terrane.contour(cone, levels=[5.0, 10.0])
        >>> len(lines), lines.levels.tolist(), lines[0].shape[1]
        (2, [5.0, 10.0], 2)
    """,
    "tiles": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     made = terrane.tiles("synth:rough,size=129", os.path.join(folder, "tiles"), max_level=11)
        ...     all(level["error"] <= level["tolerance"] for level in made["levels"])
        True
    """,
    "slope": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "slope.tif")
        ...     report = terrane.slope("synth:rough,size=129", path, percent=True)
        >>> report["width"], report["lowest"] >= 0
        (129, True)
    """,
}

documented(contour, "contour")
convert = written("convert")
simplify_file = written("simplify")
slope = written("slope")
aspect = written("aspect")
hillshade = written("hillshade")
color_relief = written("color-relief")
curvature = written("curvature")
roughness = written("roughness")
tiles = written("tiles")
tpi = written("tpi")
tri = written("tri")
