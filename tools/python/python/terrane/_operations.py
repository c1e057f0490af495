"""Operations that write a file: one function each, generated from the option tables shared with the command line and
Rust. Signatures for editors and type checkers are in `_operations.pyi`, written by `stub`."""

from __future__ import annotations

import inspect
import keyword
import os
import tempfile
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np

from terrane import _beside, _terrane
from terrane._clouds import OPENING, GridResult, cloud_of
from terrane._errors import in_memory, refuse_existing, usage
from terrane._lines import Lines, sorted_lines
from terrane._mesh import Mesh
from terrane._numbers import number
from terrane._plans import Plan
from terrane._report import Report
from terrane._settings import Path, settings
from terrane._source import crs_text, names_of, opened

# Options with features, which may be in memory.
BESIDE = ("clip", "water", "keep_points", "breaklines")
# Input options of grids, with Python's own; all others are options of the operation.
SOURCE = ("band", "nodata", "transform", "crs", "clip", "water")
# Operations that accept meshes instead of grids.
OF_SURFACES = ("picture", "page")
OF_SOURCE = {
    "transform": "Affine transform of an array, in rasterio's order",
    "crs": "CRS of an array: text, an EPSG code, or a CRS of pyproj or rasterio",
    "progress": "Progress callback (stage, done, total), or tqdm",
}
# Python types used instead of text.
TYPES = {"crs": "Any", "band": "int | None", "clip": "Features | None", "water": "Features | None", "keep_points": "Features | None", "breaklines": "Features | None", "to_crs": "Any", "output": "Path | None"}


@cache
def tables() -> dict[str, Any]:
    """All operations by name, with their option tables."""
    told: dict[str, Any] = _terrane.operations()
    return told


def run(name: str, src: Any, path: Any, options: dict[str, Any]) -> dict[str, Any]:
    """Runs an operation with keywords, which are validated before any file is opened."""
    output = os.fsdecode(path)
    with ready(name, src, options, output) as (source, progress):
        return _terrane.run_operation(name, source, output, options, progress)


@contextmanager
def ready(
    name: str, src: Any, options: dict[str, Any], output: str | None, is_plan: bool = False
) -> Iterator[tuple[Any, Any]]:
    """Validates options and returns the input of an operation (a path for features and meshes), without the
    Python-only options. Plans require permanent files."""
    reads = "mesh" if is_mesh(name, src) else tables()[name]["reads"]
    # Iterators are used twice.
    options |= {key: list(value) for key, value in options.items() if isinstance(value, Iterator)}
    _beside.settle(options)
    reading = {key: options.pop(key) for key in SOURCE if reads == "grid" and key in options}
    progress = settings(None, None, options.pop("progress", None))
    keys = ("to_crs", "to-crs", "crs") if reads == "cloud" else ("to_crs", "to-crs")
    for key in keys:
        if options.get(key) is not None:
            options[key] = crs_text(options[key])
    is_kept = options.get("workdir") is not None
    if is_plan or is_kept:
        why = "work in a folder requires a file" if is_kept else "a plan requires a file"
        for of in (reading, options):
            of |= _beside.paths(why, **{key: of[key] for key in BESIDE if key in of})
    if not is_plan:
        known = {own["name"] for own in tables()[name]["options"]}
        # Samples of an array may have any value.
        given = {key: value for key, value in reading.items() if key in known and key != "nodata"}
        given |= options
        held = {key: "held" for key in BESIDE if not _beside.is_path(given.get(key))}
        if output is not None:
            refuse_existing(output, is_true(options.get("overwrite")))
        _terrane.check_operation(name, {**given, **held}, output)
    features = {key: options.pop(key) for key in BESIDE if key in options}
    if reads == "features":
        yield os.fspath(src), progress
    elif reads == "mesh":
        with mesh_file(src) as path, _beside.files(lambda: None, **features) as files:
            options |= files
            yield path, progress
    elif reads == "grid" and (names := disagreeing(name, src, reading | features, options)):
        options |= reading
        yield names, progress
    elif reads == "grid":
        with opened(src, **reading, **features) as (grid, files):
            options |= {key: files[key] for key in features}
            yield grid, progress
    else:
        cloud = cloud_of(src, {key: options.pop(key) for key in OPENING if key in options})
        with _beside.files(lambda: cloud.info["crs"], **features) as files:
            options |= files
            yield cloud, progress


def disagreeing(
    name: str, src: Any, reading: dict[str, Any], options: dict[str, Any]
) -> list[str] | None:
    """The files of a grid that may differ in lattice or CRS: they cannot be opened as one grid."""
    names = names_of(src)
    is_resampled = name == "convert" and options.get("resampling") is not None
    if names is None or not is_resampled or not reading.keys() <= {"band", "nodata"}:
        return None
    is_one = len(names) == 1 and os.path.isfile(names[0])
    return None if is_one and not names[0].endswith((".txt", ".csv")) else names


def is_mesh(name: str, src: Any) -> bool:
    """True if the input is a mesh, which some operations accept instead of a grid."""
    is_path = isinstance(src, str | os.PathLike)
    is_one = isinstance(src, Mesh) or (is_path and _terrane.is_mesh(os.fspath(src)))
    return name == "info-mesh" or (name in OF_SURFACES and is_one)


@contextmanager
def mesh_file(mesh: Any) -> Iterator[str]:
    """The file of a mesh; a temporary file for a mesh in memory."""
    if not isinstance(mesh, Mesh):
        yield os.fspath(mesh)
        return
    with tempfile.TemporaryDirectory(prefix="terrane-") as folder:
        path = os.path.join(folder, "mesh.ply")
        mesh.write(path)
        with in_memory(path):
            yield path


def is_true(value: Any) -> bool:
    """True for a set flag."""
    return isinstance(value, bool | np.bool_) and bool(value)


def written(name: str) -> Callable[..., dict[str, Any]]:
    """Makes the function of an operation that writes a file."""
    needed = ["src", *(own["name"] for own in tables()[name]["options"] if own["positional"]), "path"]
    names = [*needed, *FIRST.get(name, {})]

    def function(*values: Any, **options: Any) -> dict[str, Any]:
        twice = [key for key in names[: len(values)] if key in options]
        given = {**dict(zip(names, values, strict=False)), **options}
        if twice or len(values) > len(names) or not given.keys() >= set(needed):
            raise usage(f"{function.__name__} takes {', '.join(names)} and keywords")
        return run(name, given.pop("src"), given.pop("path"), given)

    called_so = WRITTEN.get(name, called(name))
    return documented(function, name, called_so, parameters(name, is_file=True))


def planned(name: str) -> Callable[..., Plan]:
    """Makes the function that plans an operation."""

    first = FIRST.get(name, {})

    def function(src: Any, folder: Path, *values: Any, **options: Any) -> Plan:
        named = dict(zip(first, values, strict=False))
        if len(values) > len(first) or named.keys() & options.keys():
            raise usage(f"{function.__name__} takes src, folder, {', '.join(first)} and keywords")
        options = with_cells({**first, **named, **options})
        task_size = number("task_size", options.pop("task_size", None))
        with ready(name, src, options, None, is_plan=True) as (source, progress):
            made = _terrane.plan_operation(
                name, source, os.fsdecode(folder), options, task_size, progress
            )
            return Plan(made)

    function.__name__ = function.__qualname__ = planned_name(name)
    function.__module__ = __name__
    function.__signature__ = inspect.Signature(planned_parameters(name))  # type: ignore[attr-defined]
    function.__doc__ = planned_documentation(name)
    return function


def planned_name(name: str) -> str:
    """The function that plans an operation."""
    return f"plan_{name.replace('-', '_')}"


def proved(name: str) -> Callable[..., Report]:
    """Makes the function of a verification."""
    names = [*PROVED[name], *FIRST.get(name, {})]

    def function(*values: Any, **options: Any) -> Report:
        given = {**dict(zip(names, values, strict=False)), **options}
        twice = [key for key in names[: len(values)] if key in options]
        if twice or len(values) > len(names) or not given.keys() >= set(PROVED[name]):
            raise usage(f"{called(name)} takes {', '.join(names)} and keywords")
        file, src = (given.pop(key) for key in PROVED[name])
        if isinstance(file, Mesh) and name == "verify":
            with mesh_file(file) as path:
                return Report({**prove(name, path, src, given).as_dict(), "mesh": "in memory"})
        if not isinstance(file, str | os.PathLike):
            of = PROVED[name][0]
            remedy = "pass a terrane.Mesh or a path" if name == "verify" else "pass a path"
            raise usage(f"a {type(file).__name__} is not a path of {'a mesh' if of == 'mesh' else of}", remedy)
        return prove(name, os.fspath(file), src, given)

    function.__name__ = function.__qualname__ = called(name)
    function.__module__ = __name__
    function.__signature__ = inspect.Signature(proved_parameters(name))  # type: ignore[attr-defined]
    function.__doc__ = documentation(name)
    return function


def prove(name: str, file: str, src: Any, options: dict[str, Any]) -> Report:
    """Verifies a file or folder."""
    with ready(name, src, options, None) as (source, progress):
        return Report(_terrane.report_on(name, source, file, options, progress))


def inspected(name: str) -> Callable[..., dict[str, Any]]:
    """Makes an `info` function."""

    def function(src: Any, **options: Any) -> dict[str, Any]:
        with ready(name, src, options, None) as (source, progress):
            return _terrane.report_on(name, source, None, options, progress)

    return documented(function, name, signature=inspected_parameters(name))


# Inspections, which write nothing.
INSPECTED = ("info", "info-mesh", "info-cloud", "info-features")


def inspected_parameters(name: str) -> list[inspect.Parameter]:
    """Parameters of an `info` function."""
    return [own for own in parameters(name) if own.name != "path"]


# Subjects and originals of verifications.
PROVED = {
    "verify": ("mesh", "src"),
    "verify-cloud": ("mesh", "src"),
    "verify-tiles": ("tiles", "src"),
    "verify-cloud-tiles": ("tiles", "src"),
}


def proved_parameters(name: str) -> list[inspect.Parameter]:
    """Parameters of a verification function."""
    kinds = inspect.Parameter
    file, _ = PROVED[name]
    annotation = "Mesh | Path" if name == "verify" else "Path"
    first = kinds(file, kinds.POSITIONAL_OR_KEYWORD, annotation=annotation)
    return [first, *(own for own in parameters(name) if own.name != "path")]


def planned_parameters(name: str) -> list[inspect.Parameter]:
    """Parameters of a planning function: those of the operation that affect the result."""
    kinds = inspect.Parameter
    of_runs = [option["name"] for option in tables()[name]["options"] if option["of_runs"]]
    kept = [own for own in parameters(name) if own.kind == own.KEYWORD_ONLY and own.name not in of_runs]
    names = [kinds("src", kinds.POSITIONAL_OR_KEYWORD, annotation="Any")]
    names.append(kinds("folder", kinds.POSITIONAL_OR_KEYWORD, annotation="Path"))
    size = kinds("task_size", kinds.KEYWORD_ONLY, default=None, annotation="int | None")
    first = FIRST.get(name, {})
    names += [own for own in parameters(name) if own.name in first]
    return [*names, size, *(own for own in kept if own.name not in ("output", *first))]


def planned_documentation(name: str) -> str:
    """Documentation of a planning function."""
    size = tables()[name]["task_size"]
    return textwrap.dedent(f"""\
        Plans the result of `{called(name)}` as tasks in a folder, with the same options; the result is the same, byte for
        byte. `task_size` is the size of a task. {size}

        {PLANS.get(name, "")}
        """)


# Options of files, not of lines in memory.
OF_FILES = ("index", "polygons", "with_z", "3d", "format", "overwrite")


def contour(
    src: Any, interval: float | None = None, *, output: Any = None, **options: Any
) -> Lines | dict[str, Any]:
    """Contour lines in memory, or in a file with `output`."""
    options["interval"] = interval
    if output is not None:
        return run("contour", src, output, options)
    for key in OF_FILES:
        if options.get(key):
            raise usage(f"{key} is for files only", "pass output")
    with tempfile.TemporaryDirectory(prefix="terrane-") as folder:
        path = os.path.join(folder, "lines.fgb")
        with in_memory(path):
            run("contour", src, path, options)
        found = _terrane.read_lines(path, options.get("attribute") or "elev")
    coordinates, offsets, values, crs = found
    order = np.lexsort((np.arange(len(values)), values))
    if not np.array_equal(order, np.arange(len(order))):
        coordinates, offsets, values = sorted_lines(coordinates, offsets, values, order)
    return Lines(coordinates, offsets, values, crs)


class Usual(float):
    """A default number."""


# Cell options, unless another option defines the cells.
CELL = Usual(1.0)


def with_cells(options: dict[str, Any]) -> dict[str, Any]:
    """Options of a grid; without cell defaults if another option defines the cells."""
    if isinstance(options.get("cell"), Usual):
        options["cell"] = None if options.get("like") is not None else 1.0
    return options


def is_asked(value: Any) -> bool:
    """True for an option value that has an effect."""
    return value is not None and value is not False


def tin(
    src: Any, max_error: float | None = None, *, output: Any = None, **options: Any
) -> Mesh | dict[str, Any]:
    """A mesh in memory, or in a file with `output`."""
    options["max_error"] = max_error
    if output is not None:
        return run("tin", src, output, options)
    with ready("tin", src, options, None) as (grid, progress):
        return Mesh(grid.tin(options, progress))


# Options of files, not of grids in memory.
OF_GRIDS = ("format", "overwrite", "co")


def grid(
    src: Any,
    cell: float | Sequence[float] | None = CELL,
    stat: str | Sequence[str] | None = None,
    *,
    output: Any = None,
    **options: Any,
) -> GridResult | dict[str, Any]:
    """A grid in memory, or in a file with `output`."""
    options = with_cells({**options, "cell": cell, "stat": stat})
    if output is not None:
        return run("grid", src, output, options)
    for key in OF_GRIDS:
        if is_asked(options.get(key)):
            raise usage(f"{key} is for files only", "pass output")
    folder = tempfile.TemporaryDirectory(prefix="terrane-")
    path = os.path.join(folder.name, "grid.tif")
    with in_memory(path):
        report = run("grid", src, path, options)
    return GridResult(folder, report)


def dtm(src: Any, cell: float | Sequence[float] | None = CELL, **options: Any) -> Any:
    """Terrain model with one band, triangulated from points of class 2 or from points classified by a method. Options are
    those of `grid`; `water` is a file or geometries of water to flatten, as for `tin`. With `cell=None` the cell size is
    about the point spacing.

    >>> import terrane
    >>> ground = terrane.dtm("synth:cloud,size=60,density=2,seed=5", cell=2.0)
    >>> ground.data.shape[0], ground.crs
    (1, 'EPSG:32631')
    """
    return grid(src, cell, dtm=True, **options)


def dsm(src: Any, cell: float | Sequence[float] | None = CELL, **options: Any) -> Any:
    """Surface model with one band. Options are those of `grid`; `canopy` is the method of pit removal: "pit-free" (default)
    or "spike-free", with parameters after a colon.

    >>> import terrane
    >>> terrane.dsm("synth:cloud,size=60,density=2,seed=5", cell=2.0).names
    ['dsm']
    >>> top = terrane.dsm("synth:cloud,size=60,density=2,seed=5", cell=2.0, canopy="spike-free:freeze=2")
    >>> top.data.shape[0]
    1
    """
    return grid(src, cell, dsm=True, **options)


def chm(src: Any, cell: float | Sequence[float] | None = CELL, **options: Any) -> Any:
    """Canopy height model with one band: surface model minus terrain model. Options are those of `dsm`.

    >>> import numpy as np, terrane
    >>> canopy = terrane.chm("synth:cloud,size=60,density=2,seed=5", cell=2.0)
    >>> bool(np.nanmin(canopy.data) >= 0)
    True
    """
    return grid(src, cell, chm=True, **options)


def called(name: str) -> str:
    """Name of an operation's function; `simplify` is the one for geometries."""
    own = {"simplify": "simplify_file", "cloud-tin": "write_cloud_tin"}
    return own.get(name, name.replace("-", "_"))


# Functions that write results that others keep in memory.
WRITTEN = {"tin": "write_tin"}


def keyword_of(option: dict[str, Any]) -> str:
    """Keyword of an option; an alias if its name is a Python keyword."""
    names = [option["name"], *option["aliases"]]
    return next(name for name in names if not keyword.iskeyword(name))


# First parameters of functions with results in memory, and their defaults.
FIRST: dict[str, dict[str, Any]] = {
    "cloud-tin": {"max_error": None},
    "contour": {"interval": None},
    "grid": {"cell": CELL, "stat": None},
    "tin": {"max_error": None},
    "verify": {"max_error": None},
    "verify-cloud": {"max_error": None},
}
# Results in memory of functions without `output`.
RESULTS = {"contour": "Lines", "grid": "GridResult", "tin": "Mesh"}


def parameters(name: str, is_file: bool = False) -> list[inspect.Parameter]:
    """Parameters of an operation's function, or of its variant that always writes a file: source, names and keywords."""
    kinds = inspect.Parameter
    options = {keyword_of(option): option for option in tables()[name]["options"]}

    def parameter(name: str, kind: Any, default: Any = None) -> inspect.Parameter:
        option = options.pop(name, {"type": "Any"})
        annotation = TYPES.get(name, option["type"])
        # No band differs from the first band.
        default = None if name == "band" else option.get("default", default)
        return kinds(name, kind, default=default, annotation=annotation)

    names = [name for name, option in options.items() if option["positional"]]
    found = [kinds(name, kinds.POSITIONAL_OR_KEYWORD, annotation="Any") for name in ["src", *names]]
    for key in names:
        del options[key]
    is_held = name in RESULTS and not is_file
    if not is_held:
        found.append(kinds("path", kinds.POSITIONAL_OR_KEYWORD, annotation="Path"))
    for key, default in FIRST.get(name, {}).items():
        found.append(parameter(key, kinds.POSITIONAL_OR_KEYWORD).replace(default=default))
    if is_held:
        found.append(parameter("output", kinds.KEYWORD_ONLY))
    found += [parameter(key, kinds.KEYWORD_ONLY) for key in list(options)]
    more = OF_SOURCE if tables()[name]["reads"] == "grid" and name != "info-mesh" else ["progress"]
    return found + [parameter(key, kinds.KEYWORD_ONLY) for key in more]


def documented(
    function: Any,
    name: str,
    called_so: str | None = None,
    signature: list[inspect.Parameter] | None = None,
) -> Any:
    """Sets name, signature and documentation of a function."""
    function.__name__ = function.__qualname__ = called_so or called(name)
    function.__module__ = __name__
    function.__signature__ = inspect.Signature(signature or parameters(name))
    function.__doc__ = documentation(name)
    return function


def documentation(name: str) -> str:
    """Documentation of an operation: summary, options and an example."""
    table = tables()[name]
    lines = [table["about"], "", "Parameters", "----------"]
    source = SOURCES["mesh" if name == "info-mesh" else table["reads"]]
    rows = [("src", source + SOURCES["or mesh"] * (name in OF_SURFACES), None)]
    rows += [(keyword_of(option), about_of(option), option["default_text"]) for option in table["options"]]
    own = {parameter.name for parameter in parameters(name)} - {row[0] for row in rows}
    rows += [(key, about, None) for key, about in {**OF_SOURCE, **PLACES}.items() if key in own]
    for key, about, default in rows:
        text = about if default is None else f"{about} (default: {default})"
        lines += [key, textwrap.indent(textwrap.fill(text, 110), "    ")]
    return "\n".join([*lines, "", textwrap.dedent(EXAMPLES.get(name, "")), ""])


def stub() -> str:
    """The text of `_operations.pyi`."""
    lines = [
        '"""Operations that write a file. Made by `terrane._operations.stub`, not by hand."""',
        "",
        "from collections.abc import Iterable, Sequence",
        "from typing import Any, Literal, overload",
        "",
        "from terrane._clouds import GridResult",
        "from terrane._lines import Lines",
        "from terrane._mesh import Mesh",
        "from terrane._plans import Plan",
        "from terrane._report import Report",
        "from terrane._settings import Features, Path",
        "",
        "def stub() -> str: ...",
    ]
    for name, table in tables().items():
        if name in INSPECTED:
            lines += signature(called(name), inspected_parameters(name), "dict[str, Any]")
            continue
        if name in PROVED:
            lines += signature(called(name), proved_parameters(name), "Report")
            continue
        lines += signatures(called(name), parameters(name), RESULTS.get(name))
        if name in WRITTEN:
            lines += signature(WRITTEN[name], parameters(name, is_file=True), "dict[str, Any]")
        if table["task_size"] is not None:
            lines += signature(planned_name(name), planned_parameters(name), "Plan")
    lines += signature("plan", planned_parameters("tin"), "Plan")
    for name in ("dtm", "dsm", "chm"):
        own = [own for own in parameters("grid") if own.name not in ("dtm", "dsm", "chm", "stat")]
        lines += signatures(name, own, "GridResult")
    return "\n".join(lines) + "\n"


def signatures(name: str, found: list[inspect.Parameter], held: str | None) -> list[str]:
    """Stub of a function, with an overload for results in memory."""
    if held is None:
        return signature(name, found, "dict[str, Any]")
    places = {True: "None", False: "Path"}
    lines = []
    for is_held, place in places.items():
        own = [one.replace(annotation=place) if one.name == "output" else one for one in found]
        if not is_held:
            own = [one.replace(default=one.empty) if one.name == "output" else one for one in own]
        result = held if is_held else "dict[str, Any]"
        lines += ["@overload", *signature(name, own, result)]
    return lines


def signature(name: str, found: list[inspect.Parameter], result: str) -> list[str]:
    """Stub of a function."""
    lines = [f"def {name}("]
    first = [own.kind for own in found].index(inspect.Parameter.KEYWORD_ONLY)
    for place, own in enumerate(found):
        default = "" if own.default is own.empty else f" = {own.default!r}"
        lines += ["    *,"] * (place == first)
        lines.append(f"    {own.name}: {own.annotation}{default}".replace("'", '"') + ",")
    return [*lines, f") -> {result}: ..."]


def about_of(option: dict[str, Any]) -> str:
    """Description of an option with its choices."""
    choices = [f"{name} ({about})" for name, about in option["choices"]]
    return "; ".join([option["about"], *choices])


PLACES = {
    "path": "Output file or folder",
    "output": "Output file; without it the result stays in memory, and file options are errors",
    "mesh": "The mesh file",
    "tiles": "The folder of tiles",
}
SOURCES = {
    "grid": "A path, a list of paths (one mosaic), the name of a synthetic terrain (\"synth:rough,size=513\"), an array of two "
    "dimensions (rows, columns) of any type of number, masked or not, a dataset of rasterio, or a DataArray or Dataset of "
    "xarray. NaN, infinities, masked samples and nodata are voids",
    "cloud": "A path, a list of paths (one cloud), the name of a synthetic cloud (\"synth:cloud,size=60\"), an array of points "
    "(x, y, z in its columns, or named fields), or points of laspy or PDAL",
    "features": "The path of a feature file",
    "mesh": "The path of a mesh, or a `terrane.Mesh`",
    "or mesh": "; or the path of a mesh, or a `terrane.Mesh`",
}

EXAMPLES = {
    "verify": """
        >>> import numpy as np, terrane
        >>> heights = np.random.default_rng(1).normal(size=(40, 60)).astype("f4")
        >>> report = terrane.verify(terrane.tin(heights, max_error=0.5), heights)
        >>> report.ok, report.max_error <= 0.5, report.surface_error >= report.max_error
        (True, True, True)
        >>> terrane.verify(terrane.tin(heights, max_error=0.5), heights + 1, max_error=0.5).ok
        False
    """,
    "verify-tiles": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "tiles")
        ...     made = terrane.tiles("synth:rough,size=129", path, max_level=11)
        ...     terrane.verify_tiles(path, "synth:rough,size=129").ok
        True
    """,
    "verify-cloud-tiles": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "tiles")
        ...     made = terrane.cloud_tiles("synth:cloud,size=60", path, cell=2.0, max_level=12)
        ...     terrane.verify_cloud_tiles(path, "synth:cloud,size=60", cell=2.0).ok
        True
    """,
    "tin": """
        >>> import numpy as np, os, tempfile, terrane
        >>> row, col = np.mgrid[0:100, 0:200]
        >>> mesh = terrane.tin(np.sin(row / 20) * col / 10, max_error=0.1)
        >>> len(mesh.vertices) < 800 and mesh.error <= 0.1
        True
        >>> terrane.tin("synth:rough,size=257", max_vertices=500).crs
        'EPSG:32631'
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "mesh.ply")
        ...     report = terrane.write_tin("synth:rough,size=257", path, max_error=5.0)
        ...     report["vertices"] < 257 * 257, terrane.verify(path, "synth:rough,size=257").ok
        (True, True)
    """,
    "cloud-tin": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "mesh.ply")
        ...     told = terrane.write_cloud_tin("synth:cloud,size=60,density=2", path, 0.5, classes=[2])
        ...     terrane.verify_cloud(path, "synth:cloud,size=60,density=2", classes=[2]).ok
        True
    """,
    "cloud-tiles": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     made = terrane.cloud_tiles("synth:cloud,size=60", os.path.join(folder, "tiles"), cell=2.0, max_level=12)
        ...     all(level["error"] <= level["tolerance"] for level in made["levels"])
        True
    """,
    "grid": """
        >>> import numpy as np, terrane
        >>> points = np.random.default_rng(1).uniform(0, 100, size=(5000, 3))
        >>> grid = terrane.grid(points, cell=10.0, stat=["mean", "count"])
        >>> grid.data.shape, grid["count"].sum()
        ((2, 10, 10), np.float64(5000.0))
    """,
    "points": r"""
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     cloud, path = (os.path.join(folder, name) for name in ("cloud.xyz", "thin.laz"))
        ...     with open(cloud, "w") as file:
        ...         _ = file.write("x y z class\n0.5 0.5 3 2\n0.9 0.1 2 2\n1.5 0.5 4 6\n")
        ...     made = terrane.points("cloud:" + cloud, path, thin="1:lowest", attribute="intensity=7")
        ...     made["points"], terrane.grid(path, cell=1.0, stat="count").data.max()
        (2, np.float64(1.0))
    """,
    "contour": """
        >>> import numpy as np, terrane
        >>> cone = np.hypot(*np.mgrid[-20:21, -20:21])
        >>> lines = terrane.contour(cone, levels=[5.0, 10.0])
        >>> len(lines), lines.levels.tolist(), lines[0].shape[1]
        (2, [5.0, 10.0], 2)
    """,
    "fill": """
        >>> import os, tempfile, numpy as np, terrane
        >>> heights = np.array([[1.0, np.nan, np.nan, 4.0]])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     report = terrane.fill(heights, os.path.join(folder, "filled.tif"), max_distance=10)
        >>> report["filled"], report["left"]
        (2, 0)
    """,
    "difference": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "difference.tif")
        ...     report = terrane.difference("synth:rough,size=65,seed=3", "synth:rough,size=65,seed=4", path)
        >>> report["compared"], report["volume_above"] > 0
        (4225, True)
    """,
    "sample": """
        >>> import json, os, tempfile, numpy as np, terrane
        >>> slope = np.arange(12.0).reshape(3, 4)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     points, path = (os.path.join(folder, name) for name in ("points.csv", "heights.geojson"))
        ...     with open(points, "w") as file:
        ...         _ = file.write("x,y\\n1.5,-0.5\\n2.0,-1.5\\n")
        ...     made = terrane.sample(slope, points, path, transform=(1, 0, 0, 0, -1, 0))
        ...     [feature["properties"]["height"] for feature in json.load(open(path))["features"]]
        [1.0, 5.5]
    """,
    "zonal": """
        >>> import json, os, tempfile, numpy as np, terrane
        >>> slope = np.arange(12.0).reshape(3, 4)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     zones, path = (os.path.join(folder, name) for name in ("zones.wkt", "means.geojson"))
        ...     with open(zones, "w") as file:
        ...         _ = file.write("POLYGON ((0 0, 1.5 0, 1.5 -1, 0 -1, 0 0))")
        ...     made = terrane.zonal(slope, zones, path, stat="count,mean", transform=(1, 0, 0, 0, -1, 0))
        ...     [feature["properties"] for feature in json.load(open(path))["features"]]
        [{'count': 1.5, 'mean': 0.3333333333333333}]
    """,
    "tiles": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     made = terrane.tiles("synth:rough,size=129", os.path.join(folder, "tiles"), max_level=11)
        ...     all(level["error"] <= level["tolerance"] for level in made["levels"])
        True
    """,
    "picture": """
        >>> import numpy as np, os, tempfile, terrane
        >>> heights = np.random.default_rng(1).normal(size=(40, 60)).astype("f4")
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "a.png")
        ...     terrane.picture(heights, path, width=120)["height"]
        ...     mesh = terrane.tin(heights, max_error=0.5)
        ...     terrane.picture(mesh, path, width=60, edges=True, overwrite=True)["width"]
        80
        60
    """,
    "page": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "a.html")
        ...     terrane.page("synth:rough,size=65", path)["triangles"]
        8192
    """,
    "info": """
        >>> import numpy as np, terrane
        >>> known = terrane.info(np.arange(12.0).reshape(3, 4), stats=True)
        >>> known["width"], known["stats"]["mean"]
        (4, 5.5)
    """,
    "info-mesh": """
        >>> import terrane
        >>> mesh = terrane.tin("synth:rough,size=65", max_error=5.0)
        >>> terrane.info_mesh(mesh, quality=True)["quality"]["delaunay_share"] > 0.99
        True
    """,
    "info-cloud": r"""
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "cloud.xyz")
        ...     with open(path, "w") as file:
        ...         _ = file.write("0 0 1\n0 4 2\n5 1 3\n")
        ...     terrane.info_cloud("cloud:" + path, stats=True)["stats"]["read"]
        3
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

# Examples of plans.
PLANS = {
    "tin": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     work, mesh = (os.path.join(folder, name) for name in ("work", "mesh.ply"))
        ...     plan = terrane.plan_tin("synth:rough,size=300", work, max_error=5.0, tile=64, task_size=2)
        ...     done = plan.run(output=mesh)
        ...     terrane.verify(mesh, "synth:rough,size=300").ok, plan.status()["to_do"]
        (True, [])
    """,
    "cloud-tin": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     work, mesh = (os.path.join(folder, name) for name in ("work", "mesh.ply"))
        ...     plan = terrane.plan_cloud_tin("synth:cloud,size=60,density=2", work, 0.5)
        ...     done = plan.run(output=mesh)
        ...     terrane.verify_cloud(mesh, "synth:cloud,size=60,density=2").ok, plan.status()["to_do"]
        (True, [])
    """,
    "grid": """
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     plan = terrane.plan_grid("synth:cloud,size=60,density=2", os.path.join(folder, "work"), cell=2.0)
        ...     done = plan.run(output=os.path.join(folder, "mean.tif"))
        ...     plan.status()["to_do"]
        []
    """,
    "points": r"""
        >>> import os, tempfile, terrane
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     cloud, work, tiles = (os.path.join(folder, name) for name in ("cloud.xyz", "work", "tiles"))
        ...     with open(cloud, "w") as file:
        ...         file.writelines(f"{i % 30} {i // 30} 1\n" for i in range(900))
        ...     plan = terrane.plan_points("cloud:" + cloud, work, tile=10.0, task_size=2, buffer=2.0)
        ...     done = plan.run(output=tiles)
        ...     len(os.listdir(tiles)), plan.status()["to_do"]
        (9, [])
    """,
}

documented(contour, "contour")
documented(tin, "tin")
documented(grid, "grid")
convert = written("convert")
points = written("points")
cloud_page = written("cloud-page")
cloud_tiles = written("cloud-tiles")
info = inspected("info")
info_cloud = inspected("info-cloud")
info_features = inspected("info-features")
info_mesh = inspected("info-mesh")
line_page = written("line-page")
page = written("page")
picture = written("picture")
qa = written("qa")
plan_cloud_tin = planned("cloud-tin")
plan_grid = planned("grid")
plan_points = planned("points")
plan_tiles = planned("tiles")
plan = plan_tin = planned("tin")
simplify_file = written("simplify")
slope = written("slope")
aspect = written("aspect")
hillshade = written("hillshade")
color_relief = written("color-relief")
curvature = written("curvature")
roughness = written("roughness")
fill = written("fill")
difference = written("difference")
tiles = written("tiles")
tpi = written("tpi")
tri = written("tri")
sample = written("sample")
zonal = written("zonal")
write_cloud_tin = written("cloud-tin")
write_tin = written("tin")
verify = proved("verify")
verify_cloud = proved("verify-cloud")
verify_cloud_tiles = proved("verify-cloud-tiles")
verify_tiles = proved("verify-tiles")
