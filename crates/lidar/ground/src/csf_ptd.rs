//! Ground classification without parameters: a cloth and a triangulation that check each other, region growing
//! from the points that both accept, and a final triangulation.
//!
//! A cloth (Zhang and others 2016) follows ground of all forms but settles on large roofs and cuts off ridges;
//! progressive densification from the lowest points of large squares (Axelsson 2000) detects roofs by their
//! walls but accepts plants where its limits are wide. So a cell's lowest point is a seed when it touches the
//! cloth and the triangulation does not lie far below it. From these seeds ground is grown from cell to cell
//! along planes of any steepness ([`grown`]), up ridges and to the edges of cliffs, and a triangulation with
//! narrow limits is densified in between. Points near its surface are ground; on level ground the tolerance
//! only covers ranging noise, as low plants are hardly further away.

use crate::csf::{ClothParameters, settled};
use crate::densify::{DensifyLimits, densified};
use crate::finder::{GroundFinder, GroundTiling, Method, Request};
use crate::grow::{grown, scatter};
use crate::lowest_in_cells::{LowestCells, WIDEST};
use crate::lowest_points::LowestPoints;
use crate::surface::GroundSurface;

pub(crate) const METHOD: Method = Method {
    name: "csf-ptd",
    source: "terrane, after Zhang and others 2016 and Axelsson 2000",
    about: "cloth simulation and TIN densification combined; the method of auto",
    parameters: &[],
    finder: GroundFinder {
        tiling: |_, spacing| GroundTiling::fixed(spacing.clamp(1.0, WIDEST)),
        bytes_per_cell: 168,
        find,
    },
};

/// Side of the squares whose lowest points seed the first triangulation, in metres.
const SQUARE: f64 = 50.0;
/// Side of the squares whose lowest points densify it, in metres.
const BLOCK: f64 = 3.0;
/// Largest distance of a seed from the cloth, in metres.
const NEAR: f64 = 0.3;
/// Largest height of a seed above the first triangulation, in metres.
const ABOVE: f64 = 2.0;
/// Limits of the first triangulation: 45 degrees.
const WIDE: DensifyLimits =
    DensifyLimits { sine: std::f64::consts::FRAC_1_SQRT_2, distance: 2.0, spacing: 0.0 };
/// Limits of the second triangulation: 15 degrees.
const NARROW: DensifyLimits =
    DensifyLimits { sine: 0.258_819_045_102_520_74, distance: 1.0, spacing: 0.25 };
/// Least and largest tolerance on level ground, in metres. It grows with the cube of the slope, as interpolated heights
/// miss walls and edges, but hardly slopes.
const TOLERANCE: [f64; 2] = [0.12, 0.2];
/// Tolerance by scatter. The surface goes through the lowest points, so noise lies above it, by two times three standard
/// deviations; the lower quartile of the lowest points deviates from planes by slightly more than half of one.
const OF_SCATTER: f64 = 5.5;
/// Largest tolerance, in metres.
const MAX_TOLERANCE: f64 = 10.0;
const CLOTH: ClothParameters =
    ClothParameters { rigidness: 1, time_step: 0.65, iterations: 500, mend: true };

fn find(_: &Request, lows: &LowestPoints<'_>) -> GroundSurface {
    let (cells, step) = (LowestCells::of(lows), lows.step[2]);
    let checked = checked(lows, &cells);
    let level = OF_SCATTER * scatter(lows, &checked).unwrap_or_default();
    let level = level.clamp(TOLERANCE[0], TOLERANCE[1]);
    let seeds = grown(lows, &checked);
    let heights = densified(&cells, &seeds, &NARROW).into_iter().map(|z| z / step).collect();
    GroundSurface::new(lows.width, heights, |rise| {
        let slope = rise * step / lows.cell;
        (level + lows.cell * slope.powi(3)).min(MAX_TOLERANCE) / step
    })
}

/// The cells whose lowest points touch the cloth and lie not far above the first triangulation.
fn checked(lows: &LowestPoints<'_>, cells: &LowestCells) -> Vec<usize> {
    let (width, cell) = (lows.width, lows.cell);
    // The limits of this triangulation are wide, and would let in plants among all points.
    let few = cells.thinned(((BLOCK / cell) as usize).max(1));
    let first = few.lowest((SQUARE / cell).ceil() as usize);
    let below = densified(&few, &first, &WIDE);
    let heights = lows.heights();
    let cloth = settled(&heights, width, &CLOTH);
    let seeds = (0..heights.len()).filter(|&at| {
        let below = below[(at / width + 1) * (width + 2) + at % width + 1];
        (heights[at] - cloth[at]).abs() <= NEAR && heights[at] - below < ABOVE
    });
    seeds.collect()
}
