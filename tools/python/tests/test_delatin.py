"""The interface of pydelatin, beside pydelatin itself."""

from __future__ import annotations

import numpy as np
import pydelatin
import pydelatin.util
import pytest
import terrane.delatin
from numpy.typing import NDArray
from terrane.delatin import Delatin, util


@pytest.mark.parametrize("error", [2.0, 5.0, 30.0])
def test_meshes_are_like_those_of_pydelatin(heights: NDArray[np.float32], error: float) -> None:
    ours, theirs = Delatin(heights, max_error=error), pydelatin.Delatin(heights, max_error=error)
    assert ours.error <= error
    assert ours.vertices.dtype == theirs.vertices.dtype
    assert ours.triangles.dtype == theirs.triangles.dtype
    assert len(ours.vertices) <= len(theirs.vertices)
    for reduce in (np.min, np.max):
        np.testing.assert_array_equal(
            reduce(ours.vertices[:, :2], axis=0), reduce(theirs.vertices[:, :2], axis=0)
        )
    # Vertices are samples: the same place has the same height.
    known = {tuple(place): height for *place, height in theirs.vertices}
    both = [(known[x, y], z) for x, y, z in ours.vertices if (x, y) in known]
    assert len(both) > len(ours.vertices) / 10
    assert all(one == other for one, other in both)


def test_both_turn_the_same_way(heights: NDArray[np.float32]) -> None:
    for mesh in (Delatin(heights, max_error=5), pydelatin.Delatin(heights, max_error=5)):
        a, b, c = mesh.vertices[mesh.triangles].astype("f8").transpose(1, 0, 2)
        (ux, uy), (vx, vy) = (b - a).T[:2], (c - a).T[:2]
        assert (ux * vy - uy * vx > 0).all()


def test_flat_arrays(heights: NDArray[np.float32]) -> None:
    rows, cols = heights.shape
    flat = Delatin(heights.ravel(), height=rows, width=cols, max_error=5)
    assert np.array_equal(flat.vertices, Delatin(heights, max_error=5).vertices)
    with pytest.raises(ValueError, match="Height and width must be passed"):
        Delatin(heights.ravel(), max_error=5)


def test_numbers(heights: NDArray[np.float32]) -> None:
    assert len(Delatin(heights, max_error=0, max_triangles=1000).triangles) <= 1000
    assert len(Delatin(heights, max_error=0, max_points=300).vertices) <= 300
    few = Delatin(heights, max_error=50, max_points=10_000)
    assert len(few.vertices) < 1000
    assert len(Delatin(heights, max_error=5).triangles) > len(Delatin(heights, max_error=30).triangles)


@pytest.mark.parametrize(
    "options",
    [
        {"z_scale": 2, "z_exag": 1.5},
        {"level": True},
        {"level": True, "invert": True},
        {"level": True, "gamma": 2.0},
        {"border_size": 4, "border_height": 50},
        {"base_height": 10},
    ],
    ids=str,
)
def test_options(heights: NDArray[np.float32], options: dict[str, float]) -> None:
    # With no error at all every hill is there.
    options = {"max_error": 0.0, **options}
    ours = Delatin(heights, **options)  # type: ignore[arg-type]
    theirs = pydelatin.Delatin(heights, **options)
    np.testing.assert_allclose(ours.vertices.min(axis=0), theirs.vertices.min(axis=0), rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(ours.vertices.max(axis=0), theirs.vertices.max(axis=0), rtol=1e-5)


def test_blur_smooths(heights: NDArray[np.float32]) -> None:
    ours, theirs = (cls(heights, max_error=0, blur=3) for cls in (Delatin, pydelatin.Delatin))
    assert abs(ours.vertices[:, 2].std() / theirs.vertices[:, 2].std() - 1) < 0.05


def test_solids_are_closed(heights: NDArray[np.float32]) -> None:
    tin = Delatin(heights, max_error=10, base_height=50)
    edges = tin.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    forth = {tuple(edge) for edge in edges.tolist()}
    assert len(forth) == len(edges)
    assert all((end, start) in forth for start, end in forth)


@pytest.mark.parametrize("encoding", ["mapbox", "terrarium"])
@pytest.mark.parametrize("band_first", [False, True])
def test_pictures(encoding: str, band_first: bool) -> None:
    png = np.random.default_rng(1).integers(0, 256, (16, 16, 4), dtype="u1")
    png = png.T if band_first else png
    np.testing.assert_allclose(
        util.decode_ele(png, encoding), pydelatin.util.decode_ele(png, encoding)
    )
    with pytest.raises(ValueError, match="encoding must be one of"):
        util.decode_ele(png, "other")


@pytest.mark.parametrize("flip_y", [False, True])
def test_positions_are_stretched(heights: NDArray[np.float32], flip_y: bool) -> None:
    vertices = Delatin(heights, max_error=5).vertices
    bounds = (10.0, 20.0, 30.0, 60.0)
    np.testing.assert_allclose(
        util.rescale_positions(vertices, bounds, flip_y),
        pydelatin.util.rescale_positions(vertices, bounds, flip_y),
        rtol=1e-6,
    )
    assert util.latitude_adjustment(60) == pydelatin.util.latitude_adjustment(60)
    assert terrane.delatin.Delatin is terrane.Delatin
