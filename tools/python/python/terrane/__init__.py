"""Terrain larger than memory, reduced to small meshes with a proven error bound.

    import numpy as np
    import terrane

    mesh = terrane.tin(heights, max_error=1.0)      # an array, a file, many files, a dataset
    mesh.vertices, mesh.triangles                   # (n, 3) float64, (m, 3) uint32
    terrane.verify(mesh, heights).ok                # verified by independent code

| function | what it makes |
|---|---|
| `tin` | a mesh of a grid of heights, in memory; `write_tin` of any size, in a file |
| `grid`, `dtm`, `dsm`, `chm` | grids of point clouds |
| `points` | point cloud files: merged, thinned, classified, tiled |
| `contour` | contour lines of a grid |
| `fill`, `difference` | filled voids, differences of grids with areas and volumes |
| `sample`, `zonal` | heights at points, statistics within polygons |
| `tiles` | terrain tiles for globe viewers, at all levels of detail |
| `simplify` | lines and polygons with fewer vertices |
| `verify` | verification of a mesh |
| `info`, `info_mesh`, `info_cloud`, `info_features` | properties of data |
| `qa` | report on the quality of a point cloud |
| `picture`, `page`, `cloud_page`, `line_page` | pictures, and pages for browsers |
| `plan` | resumable jobs for many processes |
| `Delatin` | meshes with the interface of pydelatin |

Functions that read grids take a path, a list of paths, a numpy array, a rasterio dataset or an xarray DataArray. Errors are `terrane.Error`. `python -m terrane` is the command line.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terrane._clouds import GridResult
    from terrane._errors import (
        Error,
        ExistsError,
        FileError,
        InputError,
        Interrupted,
        MissingFileError,
        OutputError,
        ResourceError,
    )
    from terrane._lines import Lines, simplify
    from terrane._mesh import Mesh
    from terrane._operations import (
        aspect,
        chm,
        cloud_page,
        cloud_tiles,
        color_relief,
        contour,
        convert,
        curvature,
        difference,
        dsm,
        dtm,
        fill,
        grid,
        hillshade,
        info,
        info_cloud,
        info_features,
        info_mesh,
        line_page,
        page,
        picture,
        plan,
        plan_cloud_tin,
        plan_grid,
        plan_points,
        plan_tiles,
        plan_tin,
        points,
        qa,
        roughness,
        sample,
        simplify_file,
        slope,
        tiles,
        tin,
        tpi,
        tri,
        verify,
        verify_cloud,
        verify_cloud_tiles,
        verify_tiles,
        write_cloud_tin,
        write_tin,
        zonal,
    )
    from terrane._plans import Plan, open_plan
    from terrane._terrane import __version__
    from terrane._report import Report
    from terrane.delatin import Delatin

# Modules of names; a module is imported at the first use of one of its names.
_WHERE = {
    "_clouds": "GridResult",
    "_errors": "Error ExistsError FileError InputError Interrupted MissingFileError OutputError ResourceError",
    "_lines": "Lines simplify",
    "_mesh": "Mesh",
    "_operations": "aspect chm cloud_page cloud_tiles color_relief contour convert curvature difference dsm dtm fill grid hillshade "
    "info info_cloud info_features info_mesh line_page page picture plan plan_cloud_tin plan_grid plan_points plan_tiles plan_tin points "
    "qa roughness sample simplify_file slope tiles tin tpi tri verify verify_cloud verify_cloud_tiles verify_tiles write_cloud_tin write_tin zonal",
    "_plans": "Plan open_plan",
    "_terrane": "__version__",
    "_report": "Report",
    "delatin": "Delatin",
}
_MODULES = {name: module for module, names in _WHERE.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"terrane.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


__all__ = [
    "Delatin",
    "Error",
    "ExistsError",
    "FileError",
    "GridResult",
    "InputError",
    "Interrupted",
    "Lines",
    "Mesh",
    "MissingFileError",
    "OutputError",
    "Plan",
    "Report",
    "ResourceError",
    "__version__",
    "aspect",
    "chm",
    "cloud_page",
    "cloud_tiles",
    "color_relief",
    "contour",
    "convert",
    "curvature",
    "difference",
    "dsm",
    "dtm",
    "fill",
    "grid",
    "hillshade",
    "info",
    "info_cloud",
    "info_features",
    "info_mesh",
    "line_page",
    "open_plan",
    "page",
    "picture",
    "plan",
    "plan_cloud_tin",
    "plan_grid",
    "plan_points",
    "plan_tiles",
    "plan_tin",
    "points",
    "qa",
    "roughness",
    "sample",
    "simplify",
    "simplify_file",
    "slope",
    "tiles",
    "tin",
    "tpi",
    "tri",
    "verify",
    "verify_cloud",
    "verify_cloud_tiles",
    "verify_tiles",
    "write_cloud_tin",
    "write_tin",
    "zonal",
]
