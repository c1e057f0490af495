//! Progressive densification of a triangulation: starts from the lowest points of large squares, and adds
//! points near their triangles.
//!
//! After Axelsson, "DEM generation from laser scanner data using adaptive TIN models" (2000).

use crate::cells::{LowestCells, WIDEST};
use crate::densify::{DensifyLimits, densified};
use crate::finder::{Asked, GroundFinder, GroundTiling, Method};
use crate::lows::LowestPoints;
use crate::surface::GroundSurface;
use terrane_base::parameters::Parameter;

pub(crate) const METHOD: Method = Method {
    name: "ptd",
    source: "Axelsson 2000",
    about: "a triangulation of the lowest points of large squares, made denser by points near it",
    parameters: &[
        Parameter::new(
            "seed",
            50.0,
            [2.0, 100.0],
            "side of the squares, larger than any building, metres",
        ),
        Parameter::new(
            "angle",
            15.0,
            [0.1, 89.0],
            "at which a corner may see a point above its triangle, degrees",
        ),
        Parameter::new(
            "distance",
            1.4,
            [0.01, 100.0],
            "furthest from its triangle that a point is taken in, metres",
        ),
        Parameter::new(
            "spacing",
            0.25,
            [0.0, 100.0],
            "triangles with no longer side are left as they are, metres",
        ),
        Parameter::new(
            "tolerance",
            0.3,
            [0.0, 100.0],
            "how far from the last triangles ground may lie, metres",
        ),
    ],
    finder: GroundFinder {
        lattice: |_, spacing| GroundTiling::fixed(spacing.clamp(1.0, WIDEST)),
        find,
    },
};

fn find(asked: &Asked, lows: &LowestPoints<'_>) -> GroundSurface {
    let (cells, step) = (LowestCells::of(lows), lows.step[2]);
    let [distance, spacing] = ["distance", "spacing"].map(|key| asked.value(key));
    let limits = DensifyLimits { sine: asked.value("angle").to_radians().sin(), distance, spacing };
    let seeds = cells.lowest((asked.value("seed") / cells.cell).ceil() as usize);
    let heights = densified(&cells, &seeds, &limits).into_iter().map(|z| z / step).collect();
    GroundSurface::new(lows.width, heights, |_| asked.value("tolerance") / step)
}
