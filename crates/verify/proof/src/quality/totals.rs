//! Findings on the shape of a mesh: counts, exact sums and extremes that add up the same in any order.

use super::circle::DelaunayVerdict;
use super::shape::TriangleShape;
use crate::sum::ExactSum;

/// Angles this close to a limit, in degrees, are at it: floats of an angle of 30 degrees may be below.
const HAIR: f64 = 1e-9;
/// Resolution of percentiles: steps of a degree.
const STEPS: f64 = 100.0;
/// Bins for angles up to 60 degrees.
const BINS: usize = 6001;

/// Angles up to 60 degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct AcuteAngles {
    /// The least.
    pub min: Option<f64>,
    /// How many are below each of [`AcuteAngles::LIMITS`].
    pub below: [u64; AcuteAngles::LIMITS.len()],
    /// In steps of 5 degrees from 0 to 60.
    pub histogram: [u64; 12],
    count: u64,
    /// By hundredths of a degree, to the nearest.
    bins: Vec<u64>,
}

impl Default for AcuteAngles {
    fn default() -> Self {
        let (below, histogram, bins) = Default::default();
        Self { min: None, below, histogram, count: 0, bins }
    }
}

impl AcuteAngles {
    /// In degrees.
    pub const LIMITS: [f64; 5] = [1.0, 5.0, 10.0, 20.0, 30.0];

    fn add(&mut self, angle: f64) {
        self.min = Some(self.min.map_or(angle, |min| min.min(angle)));
        self.count += 1;
        let raised = angle + HAIR;
        for (count, limit) in self.below.iter_mut().zip(Self::LIMITS) {
            *count += u64::from(raised < limit);
        }
        self.histogram[((raised / 5.0) as usize).min(11)] += 1;
        self.bins.resize(BINS, 0);
        self.bins[((angle * STEPS).round() as usize).min(BINS - 1)] += 1;
    }

    fn merge(&mut self, other: &Self) {
        self.min = [self.min, other.min].into_iter().flatten().reduce(f64::min);
        self.count += other.count;
        add(&mut self.below, &other.below);
        add(&mut self.histogram, &other.histogram);
        if !other.bins.is_empty() {
            self.bins.resize(BINS, 0);
            add(&mut self.bins, &other.bins);
        }
    }

    /// How many there are.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The angle that `percent` of them do not exceed (nearest rank), to a hundredth of a degree.
    pub fn percentile(&self, percent: u64) -> Option<f64> {
        let rank = (u128::from(self.count) * u128::from(percent)).div_ceil(100).max(1);
        let mut seen = 0;
        let bin = self.bins.iter().position(|&count| {
            seen += u128::from(count);
            seen >= rank
        });
        bin.map(|bin| bin as f64 / STEPS)
    }
}

/// Findings of the parts measured so far. Lengths are in cells of the lattice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quality {
    /// Different positions of corners.
    pub vertices: u64,
    /// Triangles, all of them.
    pub triangles: u64,
    /// Triangles without area in plan; they have no other shape figures.
    pub empty: u64,
    /// Triangles clockwise seen from above.
    pub inverted: u64,
    /// Smallest angles in plan.
    pub plan: AcuteAngles,
    /// Smallest angles in space.
    pub space: AcuteAngles,
    /// The largest angle in plan.
    pub largest_angle: Option<f64>,
    /// Sum of aspect ratios in plan.
    pub aspects: ExactSum,
    /// Largest aspect ratio in plan.
    pub worst_aspect: Option<f64>,
    /// Aspect ratios by class, bounded by [`Quality::ASPECTS`]; the last class is unbounded.
    pub aspect_histogram: [u64; Quality::ASPECTS.len() + 1],
    /// Pairs of positions that a triangle joins.
    pub edges: u64,
    /// Edges of one triangle.
    pub border: u64,
    /// Edges of more than two triangles, or of two that pass them in the same direction.
    pub tangled: u64,
    /// Edges of two triangles, by the Delaunay test.
    pub pairs: DelaunayCounts,
    /// Sum of edge lengths in plan.
    pub lengths: ExactSum,
    /// Shortest edge in plan.
    pub shortest: Option<f64>,
    /// Longest edge in plan.
    pub longest: Option<f64>,
    /// Vertices by the number of their edges; the last entry counts [`Quality::MAX_DEGREE`] or more.
    pub degrees: [u64; Quality::MAX_DEGREE + 1],
    /// The fewest and the most edges of a vertex.
    pub degree_range: Option<[u64; 2]>,
}

/// Edges of two triangles; see [`DelaunayVerdict`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct DelaunayCounts {
    pub delaunay: u64,
    pub cocircular: u64,
    pub not_delaunay: u64,
    pub folded: u64,
}

impl Quality {
    /// Limits of aspect ratios.
    pub const ASPECTS: [f64; 8] = [1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0];
    /// Degrees from here up are counted together.
    pub const MAX_DEGREE: usize = 20;

    /// Adds the findings of other parts.
    pub fn merge(&mut self, other: &Self) {
        add(&mut self.degrees, &other.degrees);
        add(&mut self.aspect_histogram, &other.aspect_histogram);
        self.plan.merge(&other.plan);
        self.space.merge(&other.space);
        self.aspects.merge(&other.aspects);
        self.lengths.merge(&other.lengths);
        other.largest_angle.into_iter().for_each(|angle| raise(&mut self.largest_angle, angle));
        other.worst_aspect.into_iter().for_each(|aspect| raise(&mut self.worst_aspect, aspect));
        other.longest.into_iter().for_each(|length| raise(&mut self.longest, length));
        other.shortest.into_iter().for_each(|length| lower(&mut self.shortest, length));
        other.degree_range.into_iter().for_each(|range| self.widen(range));
        for (mine, more) in self.counts().into_iter().zip(other.clone().counts()) {
            *mine += *more;
        }
    }

    fn counts(&mut self) -> [&mut u64; 11] {
        [
            &mut self.vertices,
            &mut self.triangles,
            &mut self.empty,
            &mut self.inverted,
            &mut self.edges,
            &mut self.border,
            &mut self.tangled,
            &mut self.pairs.delaunay,
            &mut self.pairs.cocircular,
            &mut self.pairs.not_delaunay,
            &mut self.pairs.folded,
        ]
    }

    /// Takes note of a triangle's shape in plan, and whether it is clockwise.
    pub(super) fn shape(&mut self, shape: Option<TriangleShape>, is_inverted: bool) {
        self.triangles += 1;
        let Some(shape) = shape else {
            self.empty += 1;
            return;
        };
        self.inverted += u64::from(is_inverted);
        self.plan.add(shape.smallest_angle);
        raise(&mut self.largest_angle, shape.largest_angle);
        self.aspects.add(shape.aspect_ratio);
        raise(&mut self.worst_aspect, shape.aspect_ratio);
        let bin = Self::ASPECTS.iter().position(|limit| shape.aspect_ratio < *limit);
        self.aspect_histogram[bin.unwrap_or(Self::ASPECTS.len())] += 1;
    }

    /// Takes note of a triangle's shape in space.
    pub(super) fn shape_in_space(&mut self, shape: Option<TriangleShape>) {
        shape.into_iter().for_each(|shape| self.space.add(shape.smallest_angle));
    }

    /// Takes note of an edge.
    pub(super) fn edge(&mut self, length: f64) {
        self.edges += 1;
        self.lengths.add(length);
        raise(&mut self.longest, length);
        lower(&mut self.shortest, length);
    }

    /// Takes note of how the two triangles of an edge lie.
    pub(super) fn pair(&mut self, pair: DelaunayVerdict) {
        let DelaunayCounts { delaunay, cocircular, not_delaunay, folded } = &mut self.pairs;
        *match pair {
            DelaunayVerdict::Delaunay => delaunay,
            DelaunayVerdict::Cocircular => cocircular,
            DelaunayVerdict::NotDelaunay => not_delaunay,
            DelaunayVerdict::Folded => folded,
        } += 1;
    }

    /// Takes note of a vertex of `degree` edges.
    pub(super) fn vertex(&mut self, degree: u32) {
        self.vertices += 1;
        self.degrees[(degree as usize).min(Self::MAX_DEGREE)] += 1;
        self.widen([degree.into(); 2]);
    }

    fn widen(&mut self, [low, high]: [u64; 2]) {
        let [min, max] = self.degree_range.unwrap_or([low, high]);
        self.degree_range = Some([min.min(low), max.max(high)]);
    }
}

fn raise(max: &mut Option<f64>, value: f64) {
    *max = Some(max.map_or(value, |max| max.max(value)));
}

fn lower(min: &mut Option<f64>, value: f64) {
    *min = Some(min.map_or(value, |min| min.min(value)));
}

fn add(mine: &mut [u64], more: &[u64]) {
    mine.iter_mut().zip(more).for_each(|(a, b)| *a += b);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn angles(all: &[f64]) -> AcuteAngles {
        let mut angles = AcuteAngles::default();
        all.iter().for_each(|&angle| angles.add(angle));
        angles
    }

    #[test]
    fn of_no_angle_nothing_is_told() {
        let none = angles(&[]);
        assert_eq!((none.min, none.percentile(50), none.count()), (None, None, 0));
    }

    #[test]
    fn a_limit_is_not_below_itself_however_it_was_computed() {
        let found = angles(&[30f64.next_down(), 30.0, 29.99, 0.0, 60f64.next_up()]);
        assert_eq!(found.below, [1, 1, 1, 1, 2]);
        assert_eq!((found.histogram[5], found.histogram[6], found.histogram[11]), (1, 2, 1));
    }

    proptest! {
        /// Beside a sorted list.
        #[test]
        fn percentiles_are_those_of_the_sorted_angles(
            all in prop::collection::vec(0.0..60.0f64, 1..80), cut in 0usize..80, percent in 1u64..=100
        ) {
            let cut = cut.min(all.len());
            let mut found = angles(&all[cut..]);
            found.merge(&angles(&all[..cut]));
            prop_assert_eq!(&found, &angles(&all));
            let mut sorted = all.clone();
            sorted.sort_by(f64::total_cmp);
            let rank = (sorted.len() * percent as usize).div_ceil(100);
            let expected = (sorted[rank - 1] * 100.0).round() / 100.0;
            prop_assert_eq!(found.percentile(percent), Some(expected));
            prop_assert_eq!(found.min, Some(sorted[0]));
            prop_assert_eq!(found.below[2], sorted.iter().filter(|a| **a < 10.0).count() as u64);
            prop_assert_eq!(found.histogram.iter().sum::<u64>(), all.len() as u64);
        }
    }
}
