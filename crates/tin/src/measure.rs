//! Maximum error and sum of squared errors of a finished triangle, every sample counted once.
//!
//! Errors are measured only for a report: the extra pass takes a third of the time of the kernel.

use super::facet::PlaneFacet;
use super::heights::{ExactSamples, HeightField};
use super::lattice_position::TilePosition;
use terrane_base::geom::predicates::orient;

/// Samples summed in parallel; part of the arithmetic, so that sums do not depend on the machine.
const LANES: usize = 8;

/// Columns.
const WIDTH: i32 = 32;

/// A triangle to measure.
pub(super) struct MeasuredTriangle<'a> {
    pub(super) field: &'a HeightField,
    pub(super) p: [TilePosition; 3],
    pub(super) owned: [bool; 3],
    pub(super) tolerance: f64,
}

impl MeasuredTriangle<'_> {
    /// Maximum error and sum of squared errors; bit for bit the same on all instruction sets.
    #[inline(always)]
    pub(super) fn measured(&self) -> (f32, f32) {
        match self.field.samples() {
            ExactSamples::Exact(samples) => self.over(samples),
            ExactSamples::Single(samples) => self.over(samples),
        }
    }

    #[inline(always)]
    fn over<H: Copy + Into<f64>>(&self, samples: &[H]) -> (f32, f32) {
        let &Self { field, p, owned, tolerance } = self;
        let facet = PlaneFacet::new(p, field.vertices(p));
        let level = field.full();
        let mut total = TriangleTotals::default();
        let [left, right] = facet.column_range(&level);
        if right - left < WIDTH {
            for first in (left..=right).step_by(LANES) {
                total.add_strip(samples, level.pitch, &facet, owned, first);
            }
            return total.finish(tolerance, |largest| doubt(&facet, p, field.vertices(p), largest));
        }
        let others = owned.map(|owned| !owned);
        let edges = facet.edges();
        let [first, last] = facet.row_range(&level);
        for row in first..=last {
            let [low, high] = edges.columns(&level, row);
            if low > high {
                continue;
            }
            let start = facet.base + facet.gy * f64::from(row);
            let samples = &samples[row as usize * level.pitch..];
            if has_level_edge(p, row) {
                for col in low..=high {
                    let height: f64 = samples[col as usize].into();
                    let counts = is_owned(p, owned, TilePosition::new(col as u32, row as u32));
                    total.add(start + facet.gx * f64::from(col) - height, counts);
                }
                continue;
            }
            // Between the two ends of a row no sample lies on an edge.
            let [first, last] =
                [low, high].map(|col| i32::from(edges.any_through(&others, col, row)));
            let counted = [low + first, high - last];
            total.add_row(samples, [low, high], counted, start, facet.gx);
        }
        total.finish(tolerance, |largest| doubt(&facet, p, field.vertices(p), largest))
    }
}

/// True if a row holds two corners, and may therefore run along an edge.
fn has_level_edge(p: [TilePosition; 3], row: i32) -> bool {
    p.iter().filter(|corner| corner.row() as i32 == row).count() > 1
}

/// False if the sample lies on an edge that the triangle does not own.
fn is_owned(p: [TilePosition; 3], owned: [bool; 3], at: TilePosition) -> bool {
    let q = at.lattice();
    (0..3).all(|edge| {
        let [from, to] = [edge, (edge + 1) % 3].map(|i| p[i].lattice());
        owned[edge] || orient(from, to, q) != 0
    })
}

/// Running totals of one triangle.
#[derive(Default)]
struct TriangleTotals {
    largest: f64,
    sum: f64,
    lanes: [f64; LANES],
    most: [f64; LANES],
}

impl TriangleTotals {
    fn add(&mut self, error: f64, is_counted: bool) {
        self.largest = self.largest.max(error.abs());
        if is_counted {
            self.sum += error * error;
        }
    }

    /// Adds the samples of a row from `low` to `high`; samples from `from` to `to` count in the sum. `LANES` more
    /// values must be readable.
    #[inline(always)]
    fn add_row<H: Copy + Into<f64>>(
        &mut self,
        samples: &[H],
        [low, high]: [i32; 2],
        [from, to]: [i32; 2],
        start: f64,
        gx: f64,
    ) {
        let [last, from, to] = [high, from, to].map(f64::from);
        let (mut sums, mut most) = (self.lanes, self.most);
        for col in (low..=high).step_by(LANES) {
            let heights = &samples[col as usize..][..LANES];
            for lane in 0..LANES {
                let at = f64::from(col + lane as i32);
                let error = start + gx * at - heights[lane].into();
                let counted = if at >= from && at <= to { error * error } else { 0.0 };
                let off = if at <= last { error.abs() } else { 0.0 };
                sums[lane] += counted;
                most[lane] = if off > most[lane] { off } else { most[lane] };
            }
        }
        (self.lanes, self.most) = (sums, most);
    }

    /// Adds the samples of a triangle of at most `LANES` columns: those with three non-negative edge functions, exact
    /// in `i32`. Samples on an edge that is not owned count in the maximum error only.
    #[inline(always)]
    fn add_strip<H: Copy + Into<f64>>(
        &mut self,
        samples: &[H],
        pitch: usize,
        facet: &PlaneFacet,
        owned: [bool; 3],
        left: i32,
    ) {
        let [first, last] = facet.rows;
        let columns: [i32; LANES] = std::array::from_fn(|lane| left + lane as i32);
        let (mut sides, mut steps) = ([[0; LANES]; 3], [0; 3]);
        for i in 0..3 {
            let ([ax, ay], [bx, by]) = (facet.corners[i], facet.corners[(i + 1) % 3]);
            sides[i] = columns.map(|col| (bx - ax) * (first - ay) - (by - ay) * (col - ax));
            steps[i] = bx - ax;
        }
        let others = owned.map(|owned| i32::from(!owned));
        let along = columns.map(|col| facet.gx * f64::from(col));
        let (mut sums, mut most) = (self.lanes, self.most);
        for row in first..=last {
            let start = facet.base + facet.gy * f64::from(row);
            let heights = &samples[row as usize * pitch + left as usize..][..LANES];
            for lane in 0..LANES {
                let [a, b, c] = [sides[0][lane], sides[1][lane], sides[2][lane]];
                let error = start + along[lane] - heights[lane].into();
                let off = if a | b | c >= 0 { error.abs() } else { 0.0 };
                let inner = (a - others[0]) | (b - others[1]) | (c - others[2]);
                sums[lane] += if inner >= 0 { error * error } else { 0.0 };
                most[lane] = if off > most[lane] { off } else { most[lane] };
            }
            for i in 0..3 {
                sides[i].iter_mut().for_each(|side| *side += steps[i]);
            }
        }
        (self.lanes, self.most) = (sums, most);
    }

    fn finish(self, tolerance: f64, doubt: impl Fn(f64) -> f64) -> (f32, f32) {
        let largest = self.most.iter().fold(self.largest, |most, &lane| most.max(lane));
        let sum = self.sum + self.lanes.iter().sum::<f64>();
        (upwards((largest + doubt(largest)).min(tolerance)), sum as f32)
    }
}

/// Bound on the rounding of an error up to `largest`: about ten operations on terms no larger than these. A level facet
/// has only one rounded operation, the difference itself.
fn doubt(facet: &PlaneFacet, p: [TilePosition; 3], z: [f64; 3], largest: f64) -> f64 {
    let [q, r, s] = p.map(|corner| corner.lattice().map(f64::from));
    let [[bx, by], [cx, cy]] = [r, s].map(|to| [to[0] - q[0], to[1] - q[1]]);
    let (zb, zc) = ((z[1] - z[0]).abs(), (z[2] - z[0]).abs());
    let mut size = largest;
    if zb + zc > 0.0 {
        let area = (bx * cy - by * cx).abs();
        let [far_col, far_row] = [0, 1].map(|axis| q[axis].max(r[axis]).max(s[axis]));
        size += z.iter().fold(0.0, |max: f64, z| max.max(z.abs()));
        size += 2.0 * (facet.gx.abs() * far_col + facet.gy.abs() * far_row);
        size += (zb * cy.abs() + zc * by.abs()) / area * (bx.abs() + cx.abs());
        size += (zc * bx.abs() + zb * cx.abs()) / area * (by.abs() + cy.abs());
    }
    16.0 * f64::EPSILON * size
}

/// The nearest `f32` not below `value` (non-negative).
fn upwards(value: f64) -> f32 {
    let rounded = value as f32;
    if f64::from(rounded) < value { rounded.next_up() } else { rounded }
}

/// Which of the two triangles beside an edge owns its samples: depends on the direction alone, so that both sides
/// agree.
pub(super) fn owns_by_direction(from: TilePosition, to: TilePosition) -> bool {
    to.row() < from.row() || (to.row() == from.row() && to.col() > from.col())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heights::HeightWindow;
    use crate::scan::measure;
    use proptest::prelude::*;

    /// Triangles are narrower and wider than [`WIDTH`].
    const SIDE: u32 = 70;

    fn field(heights: &[f64], is_exact: bool) -> HeightField {
        let rounded: Vec<f32> = heights.iter().map(|&z| z as f32).collect();
        let exact = is_exact.then_some(heights);
        let heights = HeightWindow { width: SIDE, height: SIDE, f32: &rounded, f64: exact };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
        field
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        /// Heights are whole numbers of 2^-20, so that fractions tell every error.
        #[test]
        fn samples_are_measured_once_and_none_is_further_than_told(
            seed: u32, owned: [bool; 3], far in prop_oneof![Just(0), Just(1 << 34)],
            p in prop::array::uniform3((0..SIDE, 0..SIDE)),
        ) {
            let p = p.map(|(col, row)| TilePosition::new(col, row));
            let [a, b, c] = p.map(TilePosition::lattice);
            prop_assume!(orient(a, b, c) > 0);
            let noise = |i: u32| i64::from((i ^ seed).wrapping_mul(0x9e37_79b9) >> 8) + far;
            let unit = f64::from(1 << 20);
            let heights: Vec<f64> = (0..SIDE * SIDE).map(|i| noise(i) as f64 / unit).collect();
            let is_single = far == 0;
            let [field, single] = [true, !is_single].map(|is_exact| field(&heights, is_exact));
            let z = p.map(|at| noise(at.row() * SIDE + at.col()));
            let (mut most, mut sum) = (0.0_f64, 0.0);
            for i in 0..SIDE * SIDE {
                let q = TilePosition::new(i % SIDE, i / SIDE).lattice();
                // Edge 0 is from the first corner to the second, and so on.
                let sides = [orient(a, b, q), orient(b, c, q), orient(c, a, q)];
                if sides.iter().any(|&side| side < 0) {
                    continue;
                }
                let weights = [sides[1], sides[2], sides[0]].map(i128::from);
                let off: i128 = (0..3).map(|k| weights[k] * i128::from(z[k] - noise(i))).sum();
                let error = off.abs() as f64 / orient(a, b, c) as f64 / unit;
                most = most.max(error);
                if (0..3).all(|k| owned[k] || sides[k] != 0) {
                    sum += error * error;
                }
            }
            let (found, squares) = measure(&field, p, owned, f64::INFINITY);
            prop_assert!(f64::from(found) >= most, "{found} {most}");
            prop_assert!(f64::from(found) <= most * (1.0 + 1e-6) + 1e-6, "{found} {most}");
            prop_assert!((f64::from(squares) - sum).abs() <= 1e-5 * sum + 1e-9, "{squares} {sum}");
            // Heights of 24 bits are the same in single precision.
            prop_assert_eq!(measure(&single, p, owned, f64::INFINITY), (found, squares));
            let told = measure(&field, p, owned, 3.0).0;
            prop_assert!(told <= 3.0 && (told - found.min(3.0)).abs() < 1e-6);
        }

        /// The rounding of a height above the plane is that of the largest numbers on the way to it.
        #[test]
        fn doubt_is_sixteen_roundings_of_what_is_added_up(
            p in prop::array::uniform3((0..SIDE, 0..SIDE)), z in prop::array::uniform3(-1e4..1e4_f64),
            largest in 0.0..10.0_f64
        ) {
            let p = p.map(|(col, row)| TilePosition::new(col, row));
            let [a, b, c] = p.map(TilePosition::lattice);
            prop_assume!(orient(a, b, c) > 0);
            let facet = PlaneFacet::new(p, z);
            let found = doubt(&facet, p, z, largest) / (16.0 * f64::EPSILON);
            let height = z.iter().map(|z| z.abs()).fold(0.0, f64::max);
            let (col, row) = ([a, b, c].map(|q| q[0]), [a, b, c].map(|q| q[1]));
            let far = |all: [i32; 3]| f64::from(all.into_iter().max().unwrap());
            let along = (facet.gx * far(col)).abs() + (facet.gy * far(row)).abs();
            // A slope is a difference of two products, each as large as the rises over the area.
            let rise = |to: usize| (z[to] - z[0]).abs();
            let side = |to: [i32; 2], axis: usize| f64::from((to[axis] - a[axis]).abs());
            let products = |axis: usize| rise(1) * side(c, 1 - axis) + rise(2) * side(b, 1 - axis);
            let slopes: f64 = (0..2)
                .map(|axis| products(axis) * (side(b, axis) + side(c, axis)))
                .sum::<f64>() / orient(a, b, c) as f64;
            let expected = largest + height + 2.0 * along + slopes;
            prop_assert!((found - expected).abs() <= 1e-9 * expected, "{found} {expected}");
            let level = doubt(&PlaneFacet::new(p, [z[0]; 3]), p, [z[0]; 3], largest);
            prop_assert!((level - 16.0 * f64::EPSILON * largest).abs() <= 1e-20);
        }
    }

    #[test]
    fn single_precision_is_rounded_up() {
        for value in [0.0, 1.0, 0.1, 1.0 / 3.0, 7.7, 1e-3] {
            let up = upwards(value);
            assert!(f64::from(up) >= value && (up == 0.0 || f64::from(up.next_down()) < value));
        }
    }

    #[test]
    fn of_two_sides_of_an_edge_one_owns_it() {
        let p = |i: u32| TilePosition::new(i % 5, i / 5);
        for (a, b) in (0..25).flat_map(|a| (0..a).map(move |b| (p(a), p(b)))) {
            assert_ne!(owns_by_direction(a, b), owns_by_direction(b, a));
        }
        assert!(owns_by_direction(p(0), p(1)) && owns_by_direction(p(9), p(0)));
    }
}
