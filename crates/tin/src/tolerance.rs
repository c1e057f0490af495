//! Tests of samples, and of edges between them, against the tolerance.

use super::crossing::CrossingJudge;
use super::exact::{self, within};
use super::facet::{PlaneFacet, double_area};
use super::heights::HeightField;
use super::lattice_position::TilePosition;
use super::scan::{LANES, Scan};
use terrane_base::geom::predicates::orient;

/// Context of every insertion step.
#[derive(Clone, Copy)]
pub(super) struct InsertionCriteria<'a> {
    pub(super) field: &'a HeightField,
    pub(super) scan: Scan,
    pub(super) tolerance: f64,
    /// Set if the tolerance holds between samples as well.
    pub(super) crossings: Option<CrossingJudge<'a>>,
}

impl<'a> InsertionCriteria<'a> {
    /// Tests samples only.
    pub(super) fn of_samples(field: &'a HeightField, scan: Scan, tolerance: f64) -> Self {
        Self { field, scan, tolerance, crossings: None }
    }

    /// The same, with tests between samples.
    pub(super) fn and_between(&self, crossings: CrossingJudge<'a>) -> Self {
        Self { crossings: Some(crossings), ..*self }
    }

    /// True if an edge is within the tolerance between samples, or if that is not requested.
    pub(super) fn edge_keeps(&self, [from, to]: [TilePosition; 2]) -> bool {
        self.crossings.is_none_or(|crossings| crossings.worst(from, to).is_none())
    }

    /// The sample of triangle `p` to insert, or `None` when every sample of the decimated copy
    /// `level` is within the tolerance. At level 0 the answer is exact: scans in `f32` decide only
    /// where their rounding cannot matter.
    #[inline]
    pub(super) fn candidate(&self, p: [TilePosition; 3], level: u8) -> Option<InsertionCandidate> {
        if double_area(p) == 1 {
            return None; // Half a cell: its corners are its only samples (Pick's theorem).
        }
        let z = self.field.vertices(p);
        let facet = PlaneFacet::new(p, z);
        let worst = (self.scan)(&self.field.level(level), &facet);
        let error = f64::from(worst.error);
        let hair = self.hair(z, facet.gx);
        if error > self.tolerance + hair {
            Some(InsertionCandidate { error: worst.error, at: worst.at })
        // A coarse copy passes whatever is in doubt: the triangle comes back for level 0, which decides.
        } else if level > 0 || error < self.tolerance - hair {
            None
        } else {
            let worst = exact::scan(self.field, p, self.tolerance);
            let error = worst.error as f32;
            (!worst.within).then_some(InsertionCandidate { error, at: worst.at })
        }
    }

    /// Bound on the rounding error of an `f32` scan: about ten roundings of 2^-24 relative to the maximum height. A run
    /// of samples may begin beside its triangle, where the plane of a needle is far above or below: the bound covers
    /// the length of a run. Subnormal `f32` have an absolute rounding error.
    #[inline]
    pub(super) fn hair(&self, z: [f64; 3], slope: f64) -> f64 {
        const ROUNDING: f64 = 1.0 / (1 << 20) as f64;
        let largest = z.iter().fold(0.0_f64, |largest, z| largest.max(z.abs()));
        let size = largest + self.tolerance + LANES as f64 * slope.abs();
        size * ROUNDING + 16.0 * f64::from(f32::MIN_POSITIVE)
    }

    /// Tests whether a removed vertex stays within the tolerance of a triangle that contains it; `None` if not. It is
    /// the sample most likely to exceed the tolerance: testing it first saves scans.
    pub(super) fn stays_within(
        &self,
        corners: [TilePosition; 3],
        vertex: TilePosition,
    ) -> Option<bool> {
        let ([a, b, c], v) = (corners.map(TilePosition::lattice), vertex.lattice());
        let weights = [orient(b, c, v), orient(c, a, v), orient(a, b, v)];
        let holds = weights.iter().all(|&weight| weight >= 0);
        let heights = self.field.vertices(corners);
        holds.then(|| within(weights, heights, self.field.sample(vertex), self.tolerance))
    }
}

/// A sample to insert.
#[derive(Clone, Copy, Debug)]
pub(super) struct InsertionCandidate {
    pub(super) error: f32,
    pub(super) at: TilePosition,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heights::HeightWindow;
    use crate::scan::available;
    use proptest::prelude::*;

    const SIDE: u32 = 12;

    fn field(heights: &[f64], margin: u32) -> HeightField {
        let rounded: Vec<f32> = heights.iter().map(|&z| z as f32).collect();
        let heights = HeightWindow { width: SIDE, height: SIDE, f32: &rounded, f64: Some(heights) };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, SIDE, SIDE], [margin; 4], None);
        field
    }

    /// Offsets from the plane times twice the area, and that area, of all samples in a triangle; heights
    /// are whole numbers.
    fn offsets(field: &HeightField, p: [TilePosition; 3]) -> Vec<(TilePosition, i128, i128)> {
        let [a, b, c] = p.map(TilePosition::lattice);
        let z = field.vertices(p).map(|z| z as i128);
        let all = (0..SIDE * SIDE).map(|i| TilePosition::new(i % SIDE, i / SIDE));
        let offset = |at: TilePosition| {
            let q = at.lattice();
            let weights = [orient(b, c, q), orient(c, a, q), orient(a, b, q)].map(i128::from);
            let height = field.sample(at) as i128;
            let off: i128 = (0..3).map(|i| weights[i] * (z[i] - height)).sum();
            let inside = weights.iter().all(|&weight| weight >= 0);
            inside.then(|| (at, off.abs(), weights.iter().sum()))
        };
        all.filter_map(offset).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(600))]

        /// Tolerances that a sample keeps or misses by nothing or a hair, heights far from zero.
        #[test]
        fn a_triangle_at_full_resolution_has_a_candidate_when_a_sample_is_beyond(
            z in prop::collection::vec(0..40_i32, (SIDE * SIDE) as usize),
            p in prop::array::uniform3((0..SIDE, 0..SIDE)),
            far in prop_oneof![Just(0), Just(5_000), Just(40_000), Just(-3_000_000)],
            pick in any::<prop::sample::Index>(), off in -1..=1_i32
        ) {
            let p = p.map(|(col, row)| TilePosition::new(col, row));
            prop_assume!(double_area(p) > 0);
            let field = field(&z.iter().map(|z| f64::from(z + far)).collect::<Vec<_>>(), 0);
            let all = offsets(&field, p);
            let (_, error, area) = all[pick.index(all.len())];
            // A whole tolerance, so that what is exceeded is exact.
            let tolerance = (error / area) as i32 + off.max(0);
            let beyond = |&(_, error, area): &(TilePosition, i128, i128)| error > i128::from(tolerance) * area;
            let outside: Vec<_> = all.iter().filter(|sample| beyond(sample)).map(|s| s.0).collect();
            for (_, scan) in available() {
                let judge = InsertionCriteria::of_samples(&field, scan, tolerance.into());
                let found = judge.candidate(p, 0);
                prop_assert_eq!(found.is_some(), !outside.is_empty(), "{:?}", outside);
                prop_assert!(found.is_none_or(|found| outside.contains(&found.at)));
            }
        }

        /// Some ten roundings of what is added up, and not so much that all is decided exactly.
        #[test]
        fn a_hair_is_thin(z in prop::array::uniform3(-1e6..1e6_f64), tolerance in 0.0..1e6_f64) {
            let field = HeightField::default();
            let hair = InsertionCriteria::of_samples(&field, available()[0].1, tolerance).hair(z, 0.0);
            let size = z.iter().map(|z| z.abs()).fold(tolerance, f64::max);
            prop_assert!(hair >= 10.0 * size * f64::from(f32::EPSILON) / 2.0);
            prop_assert!(hair <= 40.0 * size * f64::from(f32::EPSILON));
        }
    }

    /// Two cells in all, 131 long: along a row its plane goes on by 50 times the heights of its corners.
    #[test]
    fn no_needle_is_so_steep_that_its_sample_is_missed() {
        let (width, height) = (95, 93);
        let mut z = vec![0.0; width * height];
        let corners = [(0, 0), (94, 92), (48, 47)];
        let heights = [3.296_435_6, 2.223_185_5, 9.637_884, 2.859_830_6];
        for ((col, row), height) in corners.into_iter().chain([(47, 46)]).zip(heights) {
            z[row * width + col] = height;
        }
        let heights =
            HeightWindow { width: width as u32, height: height as u32, f32: &z, f64: None };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, width as u32, height as u32], [0; 4], None);
        let p = corners.map(|(col, row)| TilePosition::new(col as u32, row as u32));
        for (_, scan) in available() {
            let found = InsertionCriteria::of_samples(&field, scan, 0.1).candidate(p, 0);
            assert_eq!(found.map(|found| found.at), Some(TilePosition::new(47, 46)));
            assert!(InsertionCriteria::of_samples(&field, scan, 0.101).candidate(p, 0).is_none());
        }
    }

    /// A sample that is off by the tolerance is no candidate of a coarse scan, whatever lies between.
    #[test]
    fn coarse_scans_leave_close_calls_to_finer_ones() {
        let mut z = vec![0.0; (SIDE * SIDE) as usize];
        z[(4 * SIDE + 4) as usize] = 3.0;
        z[(5 * SIDE + 3) as usize] = 8.0;
        let field = field(&z, 0);
        let p = [(0, 0), (11, 0), (0, 11)].map(|(col, row)| TilePosition::new(col, row));
        for (_, scan) in available() {
            let judge = |tolerance| InsertionCriteria::of_samples(&field, scan, tolerance);
            assert!(judge(3.0).candidate(p, 1).is_none());
            assert_eq!(judge(2.9).candidate(p, 1).unwrap().at, TilePosition::new(4, 4));
            assert_eq!(judge(3.0).candidate(p, 0).unwrap().at, TilePosition::new(3, 5));
        }
    }
}
