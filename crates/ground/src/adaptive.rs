//! The ground without parameters: a cloth and a triangulation that check each other, and one more
//! triangulation of what both of them hold for ground.
//!
//! A cloth (Zhang and others 2016) follows ground of all forms but lies down on roofs that are larger
//! than it can span, and cuts off ridges; a triangulation made denser from the lowest points of large
//! squares on (Axelsson 2000) knows roofs by their walls but lets plants in where its limits are wide.
//! So a cell's lowest point is a seed when it touches the cloth and the triangulation does not lie far
//! below it, and from these seeds on a triangulation with narrow limits is made denser: it climbs the
//! ridges, along slopes of any steepness, since distances count from the planes of triangles. Points
//! near its surface are ground, the further off the steeper it is.

use crate::csf::{Cloth, settled};
use crate::densify::{Cells, Limits, WIDEST, densified};
use crate::lows::Lows;
use crate::method::{Asked, GroundFinder, Lattice, Method};
use crate::surface::Ground;

pub(crate) const METHOD: Method = Method {
    name: "adaptive",
    source: "ours, after Zhang and others 2016 and Axelsson 2000",
    about: "a cloth and a triangulation that check each other; what auto takes",
    parameters: &[],
    finder: GroundFinder { lattice: |_, spacing| Lattice::fixed(spacing.clamp(1.0, WIDEST)), find },
};

/// Side of the squares whose lowest points the first triangulation begins with, in metres.
const SQUARE: f64 = 50.0;
/// And of those whose lowest points it goes on with.
const BLOCK: f64 = 3.0;
/// How near the cloth a seed lies, and how far at most above the first triangulation, in metres.
const NEAR: f64 = 0.3;
const ABOVE: f64 = 2.0;
/// When points are taken into the first triangulation, and into the second: sines of 30 and 12 degrees.
const WIDE: Limits = Limits { sine: 0.5, distance: 2.0, spacing: 0.0 };
const NARROW: Limits = Limits { sine: 0.207_911_690_817_759_33, distance: 1.0, spacing: 0.25 };
/// How far from the surface ground may lie, in metres, and how much further for each metre that it rises
/// from a cell to the next.
const TOLERANCE: f64 = 0.3;
const SCALING: f64 = 0.3;
const CLOTH: Cloth = Cloth { rigidness: 1, time_step: 0.65, iterations: 500, mend: true };

fn find(_: &Asked, lows: &Lows<'_>) -> Ground {
    let (cells, step) = (Cells::of(lows), lows.step[2]);
    let seeds = checked(lows, &cells);
    let heights = densified(&cells, &seeds, &NARROW).into_iter().map(|z| z / step).collect();
    Ground::new(lows.width, heights, |rise| TOLERANCE / step + SCALING * rise)
}

/// The cells whose lowest points touch the cloth and lie not far above the first triangulation.
fn checked(lows: &Lows<'_>, cells: &Cells) -> Vec<usize> {
    let (width, cell) = (lows.width, lows.cell);
    let few = cells.thinned(((BLOCK / cell) as usize).max(1));
    let first = few.lowest((SQUARE / cell).ceil() as usize);
    let below = densified(&few, &first, &WIDE);
    let below = |at: usize| below[(at / width + 1) * (width + 2) + at % width + 1];
    let heights = lows.heights();
    let cloth = settled(&heights, width, &CLOTH);
    let is_seed =
        |at: &usize| (heights[*at] - cloth[*at]).abs() <= NEAR && heights[*at] - below(*at) < ABOVE;
    (0..heights.len()).filter(is_seed).collect()
}
