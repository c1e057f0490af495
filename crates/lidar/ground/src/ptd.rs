//! Progressive densification of a triangulation: starts from the lowest points of large squares, and adds
//! points near their triangles.
//!
//! After Axelsson, "DEM generation from laser scanner data using adaptive TIN models" (2000).

use crate::densify::{DensifyLimits, densified};
use crate::finder::{GroundFinder, GroundTiling, Method, Request};
use crate::lowest_in_cells::{LowestCells, WIDEST};
use crate::lowest_points::LowestPoints;
use crate::surface::GroundSurface;
use terrane_base::parameters::Parameter;

pub(crate) const METHOD: Method = Method {
    name: "ptd",
    source: "Axelsson 2000",
    about: "progressive TIN densification, from the lowest points of large cells",
    parameters: &[
        Parameter::new(
            "seed",
            50.0,
            [2.0, 100.0],
            "size of the seed cells, larger than any building, metres",
        ),
        Parameter::new(
            "angle",
            15.0,
            [0.1, 89.0],
            "maximum angle from a triangle corner to a point above it, degrees",
        ),
        Parameter::new(
            "distance",
            1.4,
            [0.01, 100.0],
            "maximum distance of an added point from its triangle, metres",
        ),
        Parameter::new(
            "spacing",
            0.25,
            [0.0, 100.0],
            "triangles with all edges up to this length are not refined, metres",
        ),
        Parameter::new(
            "tolerance",
            0.3,
            [0.0, 100.0],
            "maximum distance of ground from the final triangles, metres",
        ),
    ],
    finder: GroundFinder {
        tiling: |_, spacing| GroundTiling::fixed(spacing.clamp(1.0, WIDEST)),
        bytes_per_cell: 160,
        find,
    },
};

fn find(request: &Request, lows: &LowestPoints<'_>) -> GroundSurface {
    let (cells, step) = (LowestCells::of(lows), lows.step[2]);
    let [distance, spacing] = ["distance", "spacing"].map(|key| request.value(key));
    let limits =
        DensifyLimits { sine: request.value("angle").to_radians().sin(), distance, spacing };
    let seeds = cells.lowest((request.value("seed") / cells.cell).ceil() as usize);
    let heights = densified(&cells, &seeds, &limits).into_iter().map(|z| z / step).collect();
    GroundSurface::new(lows.width, heights, |_| request.value("tolerance") / step)
}
