//! Vertical distance of a sample from a triangle: as a number that depends on the triangle only, and as an exact
//! decision.
//!
//! Versions of a method that find samples in different ways must agree on ties. So the corners are sorted by
//! position, and a sample on an edge is measured along that edge, in lowest terms: the triangles on both sides
//! get the same number, bit for bit.

use crate::exact::is_at_most;
use crate::grid::{HeightGrid, PackedSample};
use terrane_base::geom::predicates::{Lattice, orient};

/// Relative rounding of the plain evaluation, with a safety margin.
const DOUBT: f64 = 1e-14;

/// A triangle with the heights of its corners.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrianglePlane<'a> {
    grid: &'a HeightGrid<'a>,
    corners: [PackedSample; 3],
    heights: [f64; 3],
}

impl<'a> TrianglePlane<'a> {
    pub(crate) fn new(grid: &'a HeightGrid<'a>, mut corners: [PackedSample; 3]) -> Self {
        corners.sort_unstable();
        Self { grid, corners, heights: corners.map(|corner| grid.vertex(corner)) }
    }

    /// Offset of a sample of the closed triangle.
    pub(crate) fn offset(&self, at: PackedSample) -> PlaneOffset {
        self.offset_by(weights_in(self.corners, at), at)
    }

    /// The same from the sample's [`weights_in`] this triangle, which are the same for all channels.
    pub(crate) fn offset_by(&self, weights: [i64; 3], at: PackedSample) -> PlaneOffset {
        PlaneOffset { weights, heights: self.heights, height: self.grid.sample(at) }
    }

    /// The corners in the order of the weights.
    pub(crate) fn corners(&self) -> [PackedSample; 3] {
        self.corners
    }

    /// The samples of the closed triangle in (row, column) order, with their offsets.
    pub(crate) fn offsets(&self) -> impl Iterator<Item = (PackedSample, PlaneOffset)> {
        samples_of(self.corners).map(|at| (at, self.offset(at)))
    }
}

/// Barycentric weights of a sample of the closed triangle, in lowest terms on an edge.
pub(crate) fn weights_in(corners: [PackedSample; 3], at: PackedSample) -> [i64; 3] {
    let ([a, b, c], q) = (corners.map(PackedSample::lattice), at.lattice());
    lowest([orient(b, c, q), orient(c, a, q), orient(a, b, q)].map(i64::abs))
}

/// Weights of a sample on an edge without their common divisor, which differs between the sides of the edge.
fn lowest(weights: [i64; 3]) -> [i64; 3] {
    match weights {
        [0, a, b] | [a, 0, b] | [a, b, 0] if a != 0 && b != 0 => {
            let common = greatest_divisor(a, b);
            weights.map(|weight| weight / common)
        }
        _ => weights,
    }
}

fn greatest_divisor(mut a: i64, mut b: i64) -> i64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// A sample and the plane above or below it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneOffset {
    /// Barycentric weights, none negative.
    weights: [i64; 3],
    heights: [f64; 3],
    height: f64,
}

impl PlaneOffset {
    /// True at a corner, which is a vertex already.
    pub(crate) fn is_corner(&self) -> bool {
        self.weights.iter().filter(|weight| **weight == 0).count() > 1
    }

    /// |sample - plane|, rounded.
    pub(crate) fn error(&self) -> f64 {
        let terms = self.weights.into_iter().zip(self.heights);
        let sum: f64 = terms.map(|(weight, z)| weight as f64 * (z - self.height)).sum();
        (sum / self.total()).abs()
    }

    fn total(&self) -> f64 {
        self.weights.iter().sum::<i64>() as f64
    }

    /// True if |sample - plane| is at most `tolerance`, exactly.
    pub(crate) fn is_within(&self, tolerance: f64) -> bool {
        let size = self.heights.iter().fold(self.height.abs(), |size, z| size + z.abs());
        let excess = self.error() - tolerance;
        if excess.abs() > DOUBT * (size + tolerance) {
            return excess < 0.0;
        }
        let [a, b, c] = self.weights.map(|weight| weight as f64);
        let [x, y, z] = self.heights;
        is_at_most(&[(a, x), (b, y), (c, z), (-self.total(), self.height)], tolerance, self.total())
    }

    /// The smallest tolerance that [`is_within`](Self::is_within) accepts, by bisection of bits, which order
    /// non-negative doubles.
    pub(crate) fn min_bound(&self) -> f64 {
        if self.is_within(0.0) {
            return 0.0;
        }
        // 0 does not grow by doubling, and the error may have been rounded to it.
        let mut above = self.error().max(f64::MIN_POSITIVE);
        while !self.is_within(above) {
            above *= 2.0;
        }
        let (mut below, mut above) = (0, above.to_bits());
        while above - below > 1 {
            let middle = below + (above - below) / 2;
            match self.is_within(f64::from_bits(middle)) {
                true => above = middle,
                false => below = middle,
            }
        }
        f64::from_bits(above)
    }
}

/// The samples of a closed triangle, of either orientation, in (row, column) order.
pub(crate) fn samples_of(corners: [PackedSample; 3]) -> impl Iterator<Item = PackedSample> {
    rows_of(corners).flat_map(|(row, columns)| {
        columns.map(move |col| PackedSample::new(col as u32, row as u32))
    })
}

/// The rows of a closed triangle, of either orientation, and the columns of its samples in each.
pub(crate) fn rows_of(
    corners: [PackedSample; 3],
) -> impl Iterator<Item = (i32, std::ops::RangeInclusive<i64>)> {
    let [a, b, c] = corners.map(PackedSample::lattice);
    let turned = if orient(a, b, c) < 0 { [a, c, b] } else { [a, b, c] };
    let rows = a[1].min(b[1]).min(c[1])..=a[1].max(b[1]).max(c[1]);
    rows.map(move |row| {
        let [low, high] = columns(turned, row);
        (row, low..=high)
    })
}

/// First and last column of a row within the closed counter-clockwise triangle.
fn columns([a, b, c]: [Lattice; 3], row: i32) -> [i64; 2] {
    let cols = [a[0], b[0], c[0]].map(i64::from);
    let mut low = cols.into_iter().fold(i64::MAX, i64::min);
    let mut high = cols.into_iter().fold(i64::MIN, i64::max);
    for [from, to] in [[a, b], [b, c], [c, a]] {
        let (dx, dy) = (i64::from(to[0] - from[0]), i64::from(to[1] - from[1]));
        let (start, reach) = (i64::from(from[0]), dx * i64::from(row - from[1]));
        match dy {
            0 => {}
            1.. => high = high.min(start + reach.div_euclid(dy)),
            // Rounds up.
            _ => low = low.max(start - reach.div_euclid(-dy)),
        }
    }
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn all_samples_of_a_triangle_are_visited_once(
            at in prop::collection::vec((0_u32..12, 0_u32..12), 3)
        ) {
            let corners = [0, 1, 2].map(|i| PackedSample::new(at[i].0, at[i].1));
            let [a, b, c] = corners.map(PackedSample::lattice);
            prop_assume!(orient(a, b, c) != 0);
            let holds = |q: &PackedSample| {
                let q = q.lattice();
                let sides = [orient(a, b, q), orient(b, c, q), orient(c, a, q)];
                sides.iter().all(|&side| side >= 0) || sides.iter().all(|&side| side <= 0)
            };
            let all = (0..12).flat_map(|row| (0..12).map(move |col| PackedSample::new(col, row)));
            let found: Vec<_> = samples_of(corners).collect();
            prop_assert_eq!(found, all.filter(holds).collect::<Vec<_>>());
        }

        #[test]
        fn both_sides_of_an_edge_find_the_same_error(
            heights in prop::collection::vec(-50.0_f64..50.0, 13 * 13), to in (0_u32..13, 0_u32..13),
            sides in prop::collection::vec((0_u32..13, 0_u32..13), 2)
        ) {
            let grid = HeightGrid::new(13, 13, &heights, None).unwrap();
            let [from, to] = [PackedSample::new(6, 6), PackedSample::new(to.0, to.1)];
            let planes = [sides[0], sides[1]].map(|(col, row)| PackedSample::new(col, row));
            let is_flat = |third: &PackedSample| {
                orient(from.lattice(), to.lattice(), third.lattice()) == 0
            };
            prop_assume!(!planes.iter().any(is_flat));
            let [left, right] = [
                TrianglePlane::new(&grid, [from, to, planes[0]]), TrianglePlane::new(&grid, [planes[1], to, from])
            ];
            for at in samples_of([from, to, planes[0]]) {
                if orient(from.lattice(), to.lattice(), at.lattice()) == 0 {
                    assert_eq!(left.offset(at).error(), right.offset(at).error());
                }
            }
        }

        #[test]
        fn the_least_bound_is_where_the_decision_turns(
            heights in prop::collection::vec(-50.0_f64..50.0, 25)
        ) {
            let grid = HeightGrid::new(5, 5, &heights, None).unwrap();
            let plane = TrianglePlane::new(&grid, [[0, 0], [4, 1], [2, 4]].map(|[c, r]| PackedSample::new(c, r)));
            for (_, offset) in plane.offsets() {
                let least = offset.min_bound();
                assert!(offset.is_within(least));
                assert!(least == 0.0 || !offset.is_within(least.next_down()));
            }
        }
    }
}
