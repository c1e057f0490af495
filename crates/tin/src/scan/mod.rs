//! The hot loop: the sample of a triangle that is furthest from its plane.
//!
//! Every kernel does the same arithmetic in the same order (see [`scalar`]), so all of them give
//! the same bits; which one runs is chosen once, at run time.
//!
//! Which samples of a row lie in a narrow triangle is told by the signs of three integer edge functions,
//! in a wide one by the exact span of each row.
//!
//! Measured: edge functions in narrow triangles, 31.4 to 26.2 ns a sample at 5 % kept with AVX-512, 50 to
//! 34.6 with AVX2; two rows to a vector with exact row ends was slower (35.7).

mod scalar;
#[cfg(target_arch = "x86_64")]
mod x86;

use super::Local;
use super::field::Level;
use super::measure::Triangle;
use terrane_base::geom::predicates::{Lattice, orient};

/// Samples handled together. Part of the arithmetic: plane heights are rounded to `f32` once per
/// run of lanes.
pub(super) const LANES: usize = 16;

/// Slack of the row ends: more than their rounding error, less than the distance of any lattice
/// point from an edge it is not on (2^-18 for coordinates below 2^13 at stride 32).
const SLACK: f64 = 1.0 / (1 << 20) as f64;

/// The worst sample of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Worst {
    /// |sample - plane| in `f32`; 0 when no sample is off the plane.
    pub(super) error: f32,
    /// Where; the lowest (row, column) among equals. Meaningless when the error is 0.
    pub(super) at: Local,
}

/// A scan kernel. The triangle is inside the field whose level is scanned.
pub(super) type Scan = fn(&Level<'_>, &Facet) -> Worst;

/// The fastest kernel this processor runs.
pub(super) fn fastest() -> Scan {
    available().last().map_or(scalar::scan, |&(_, scan)| scan)
}

/// All kernels this processor runs, slowest first.
pub(super) fn available() -> Vec<(&'static str, Scan)> {
    #[cfg(target_arch = "x86_64")]
    let more = x86::available();
    #[cfg(not(target_arch = "x86_64"))]
    let more = None;
    let scalar: (&'static str, Scan) = ("scalar", scalar::scan);
    std::iter::once(scalar).chain(more).collect()
}

/// What a triangle measures, by the widest registers of this processor; none where they are those of all.
#[cfg(target_arch = "x86_64")]
pub(super) fn measured(triangle: &Triangle<'_>) -> Option<(f32, f32)> {
    x86::measured(triangle)
}

#[cfg(not(target_arch = "x86_64"))]
pub(super) fn measured(_: &Triangle<'_>) -> Option<(f32, f32)> {
    None
}

/// A triangle with heights: its plane and its box, in lattice units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    /// Plane: height = `base` + `gx` * column + `gy` * row.
    pub(super) base: f64,
    pub(super) gx: f64,
    pub(super) gy: f64,
    /// Corners as [column, row].
    pub(super) corners: [Lattice; 3],
    /// First and last column.
    pub(super) cols: [i32; 2],
    /// First and last row.
    pub(super) rows: [i32; 2],
}

/// The edges of a triangle as bounds of its rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edges {
    /// Edges as columns: `offset` + `slope` * row.
    slopes: [f64; 3],
    offsets: [f64; 3],
    /// Which side of a row an edge bounds.
    sides: [Side; 3],
}

/// On which side of its interior an edge lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Left,
    Right,
    Level,
}

impl Facet {
    /// The facet with corners `p` (counter-clockwise in (column, row) axes) at heights `z`.
    #[inline(always)]
    pub(super) fn new(p: [Local; 3], z: [f64; 3]) -> Self {
        let q = p.map(Local::lattice);
        let [ax, ay] = q[0].map(f64::from);
        let [bx, by] = [q[1][0] - q[0][0], q[1][1] - q[0][1]].map(f64::from);
        let [cx, cy] = [q[2][0] - q[0][0], q[2][1] - q[0][1]].map(f64::from);
        let (zb, zc) = (z[1] - z[0], z[2] - z[0]);
        let scale = 1.0 / (bx * cy - by * cx);
        let gx = (zb * cy - zc * by) * scale;
        let gy = (bx * zc - cx * zb) * scale;
        let span =
            |i: usize| [q[0][i].min(q[1][i]).min(q[2][i]), q[0][i].max(q[1][i]).max(q[2][i])];
        let base = z[0] - gx * ax - gy * ay;
        Self { base, gx, gy, corners: q, cols: span(0), rows: span(1) }
    }

    /// First and last decimated row to scan.
    #[inline(always)]
    pub(super) fn row_range(&self, level: &Level<'_>) -> [i32; 2] {
        decimated(self.rows, level.shift, [level.bounds[2], level.bounds[3]])
    }

    /// First and last decimated column to scan in any row. Runs of lanes begin at the first.
    #[inline(always)]
    pub(super) fn column_range(&self, level: &Level<'_>) -> [i32; 2] {
        decimated(self.cols, level.shift, [level.bounds[0], level.bounds[1]])
    }

    #[inline(always)]
    pub(super) fn edges(&self) -> Edges {
        let (mut slopes, mut offsets, mut sides) = ([0.0; 3], [0.0; 3], [Side::Level; 3]);
        for i in 0..3 {
            let (from, to) = (self.corners[i], self.corners[(i + 1) % 3]);
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]].map(f64::from);
            let slope = if dy == 0.0 { 0.0 } else { dx / dy };
            slopes[i] = slope;
            offsets[i] = f64::from(from[0]) - f64::from(from[1]) * slope;
            sides[i] = match dy {
                _ if dy > 0.0 => Side::Right,
                _ if dy < 0.0 => Side::Left,
                _ => Side::Level,
            };
        }
        Edges { slopes, offsets, sides }
    }
}

/// The decimated positions in a range of lattice positions and inside the bounds.
#[inline(always)]
fn decimated([first, last]: [i32; 2], shift: u32, bounds: [i32; 2]) -> [i32; 2] {
    let stride_less_one = (1 << shift) - 1;
    [((first + stride_less_one) >> shift).max(bounds[0]), (last >> shift).min(bounds[1])]
}

impl Edges {
    /// True when one of the edges that are asked for, and do not run along a row, goes through a sample.
    #[inline(always)]
    pub(super) fn any_through(&self, asked: &[bool; 3], col: i32, row: i32) -> bool {
        let through = |i: usize| {
            let off = self.offsets[i] + self.slopes[i] * f64::from(row) - f64::from(col);
            asked[i] & (self.sides[i] != Side::Level) & (off.abs() <= SLACK)
        };
        through(0) | through(1) | through(2)
    }

    /// First and last decimated column of a decimated row; first > last when there is none.
    #[inline(always)]
    pub(super) fn columns(&self, level: &Level<'_>, row: i32) -> [i32; 2] {
        let shrink = 1.0 / f64::from(1_u32 << level.shift);
        let mut low = f64::from(level.bounds[0]);
        let mut high = f64::from(level.bounds[1]);
        for edge in 0..3 {
            let at = self.offsets[edge] * shrink + self.slopes[edge] * f64::from(row);
            match self.sides[edge] {
                Side::Left => low = low.max(at - SLACK),
                Side::Right => high = high.min(at + SLACK),
                Side::Level => {}
            }
        }
        [low.ceil() as i32, high.floor() as i32]
    }
}

/// The beginning of the run of lanes that holds column `low`, where the first begins at `left`.
#[inline(always)]
fn run_of(low: i32, left: i32) -> i32 {
    left + (low - left) / LANES as i32 * LANES as i32
}

/// Twice the area of a triangle in cells.
#[inline(always)]
pub(super) fn double_area(corners: [Local; 3]) -> i64 {
    let [a, b, c] = corners.map(Local::lattice);
    orient(a, b, c)
}

/// The level at which a triangle of this area holds about `samples` samples.
#[inline(always)]
pub(super) fn level_for(corners: [Local; 3], samples: i64, levels: usize) -> u8 {
    let ratio = (double_area(corners) / (2 * samples)).max(1) as u64;
    let level = (u64::BITS - 1 - ratio.leading_zeros()).div_ceil(2);
    level.min(levels as u32 - 1) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{Field, LEVELS};
    use crate::{Heights, Local};
    use proptest::prelude::*;

    const SIDE: u32 = 70;

    fn field(seed: u32, margin: u32) -> Field {
        let height = |i: u32| match (i ^ seed).wrapping_mul(0x9e37_79b9) >> 20 {
            0..40 => f32::NAN,
            height => (height % 97) as f32 * 0.37 - 11.0,
        };
        let heights: Vec<f32> = (0..SIDE * SIDE).map(height).collect();
        let heights = Heights { width: SIDE, height: SIDE, f32: &heights, f64: None };
        let mut field = Field::default();
        field.load(&heights, [0, 0, SIDE, SIDE], [margin; 4], None);
        field
    }

    /// Every sample of the field, tested against the triangle's edges by exact orientation.
    fn members(p: [Local; 3], level: &Level<'_>) -> Vec<Local> {
        let [a, b, c] = p.map(Local::lattice);
        let stride = 1 << level.shift;
        let [first, last, top, bottom] = level.bounds;
        let all = (top..=bottom).flat_map(|row| (first..=last).map(move |col| (col, row)));
        let inside = |q: &Local| {
            let q = q.lattice();
            orient(a, b, q) >= 0 && orient(b, c, q) >= 0 && orient(c, a, q) >= 0
        };
        let local =
            |(col, row): (i32, i32)| Local::new((col * stride) as u32, (row * stride) as u32);
        all.map(local).filter(inside).collect()
    }

    fn corner() -> impl Strategy<Value = Local> {
        (0..SIDE, 0..SIDE).prop_map(|(col, row)| Local::new(col, row))
    }

    fn last_corner() -> impl Strategy<Value = Local> {
        (SIDE - 7..SIDE, 0..SIDE).prop_map(|(col, row)| Local::new(col, row))
    }

    fn kernels_agree(field: &Field, facet: &Facet, level: u8) -> Result<(), TestCaseError> {
        let expected = scalar::scan(&field.level(level), facet);
        for (name, scan) in available() {
            let found = scan(&field.level(level), facet);
            prop_assert_eq!(found, expected, "kernel {}", name);
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        #[test]
        fn kernels_agree_bit_for_bit(
            p in [corner(), corner(), corner()], z in [-20.0..20.0, -20.0..20.0, -20.0..20.0],
            level in 0..LEVELS as u8, margin in 0_u32..2, seed in 0_u32..9
        ) {
            let [a, b, c] = p.map(Local::lattice);
            prop_assume!(orient(a, b, c) > 0);
            kernels_agree(&field(seed, margin), &Facet::new(p, z), level)?;
        }

        /// Triangles of few columns that end at the last one, which scans leave out.
        #[test]
        fn kernels_agree_in_the_last_columns(
            p in [last_corner(), last_corner(), last_corner()],
            z in [-20.0..20.0, -20.0..20.0, -20.0..20.0], level in 0..2_u8, seed in 0_u32..9
        ) {
            let [a, b, c] = p.map(Local::lattice);
            prop_assume!(orient(a, b, c) > 0);
            kernels_agree(&field(seed, 1), &Facet::new(p, z), level)?;
        }

        #[test]
        fn scans_see_every_sample_of_the_closed_triangle(
            p in [corner(), corner(), corner()], level in 0..LEVELS as u8, margin in 0_u32..2,
            pick in any::<prop::sample::Index>()
        ) {
            let [a, b, c] = p.map(Local::lattice);
            prop_assume!(orient(a, b, c) > 0);
            let members = members(p, &field(0, margin).level(level));
            prop_assume!(!members.is_empty());
            let target = members[pick.index(members.len())];
            let mut heights = vec![0.0; (SIDE * SIDE) as usize];
            heights[(target.row() * SIDE + target.col()) as usize] = 1.0;
            let heights = Heights { width: SIDE, height: SIDE, f32: &heights, f64: None };
            let mut one = Field::default();
            one.load(&heights, [0, 0, SIDE, SIDE], [margin; 4], None);
            let found = scalar::scan(&one.level(level), &Facet::new(p, [0.0; 3]));
            prop_assert_eq!(found, Worst { error: 1.0, at: target });
        }
    }

    proptest! {
        /// Heights of few steps, so that many samples are as far from a level triangle.
        #[test]
        fn of_samples_as_far_off_the_first_is_told(
            p in [corner(), corner(), corner()], level in 0..LEVELS as u8, one_in in 1_u32..60, seed: u32
        ) {
            let [a, b, c] = p.map(Local::lattice);
            prop_assume!(orient(a, b, c) > 0);
            let is_off = |i: u32| ((i ^ seed).wrapping_mul(0x9e37_79b9) >> 16).is_multiple_of(one_in);
            let heights: Vec<f32> = (0..SIDE * SIDE).map(|i| if is_off(i) { 2.0 } else { 0.0 }).collect();
            let heights = Heights { width: SIDE, height: SIDE, f32: &heights, f64: None };
            let mut field = Field::default();
            field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
            let far = members(p, &field.level(level)).into_iter().find(|&at| field.sample(at) > 0.0);
            let expected = far.map_or(Worst { error: 0.0, at: Local::new(0, 0) }, |at| Worst { error: 2.0, at });
            for (name, scan) in available() {
                prop_assert_eq!(scan(&field.level(level), &Facet::new(p, [0.0; 3])), expected, "{}", name);
            }
        }
    }

    /// Triangles as wide as a run of lanes, one more and one less, that begin anywhere.
    #[test]
    fn kernels_see_the_ends_of_rows_of_any_length() {
        for (width, left) in (1..36).flat_map(|width| (0..18).map(move |left| (width, left))) {
            let flat = [(left, 3), (left + width, 3), (left + width, 4)];
            let p = flat.map(|(col, row)| Local::new(col, row));
            for col in left..=left + width {
                let mut heights = vec![0.0; (SIDE * SIDE) as usize];
                heights[(3 * SIDE + col) as usize] = 1.0;
                let heights = Heights { width: SIDE, height: SIDE, f32: &heights, f64: None };
                let mut field = Field::default();
                field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
                let expected = Worst { error: 1.0, at: Local::new(col, 3) };
                for (name, scan) in available() {
                    let found = scan(&field.level(0), &Facet::new(p, [0.0; 3]));
                    assert_eq!(found, expected, "{name} {width} {left}");
                }
            }
        }
    }

    #[test]
    fn levels_grow_with_the_area() {
        let triangle = |side| [(0, 0), (side, 0), (0, side)].map(|(c, r)| Local::new(c, r));
        let levels = [2, 8, 9, 16, 40, 512].map(|side| level_for(triangle(side), 32, LEVELS));
        assert_eq!(levels, [0, 0, 0, 1, 2, 5]);
    }
}
