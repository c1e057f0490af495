//! Findings: counts, exact sums and extremes that add up the same in any order.

use super::sum::ExactSum;
use super::triangle::{ProofPosition, ProofTriangle};

/// Number of occurrences of a fault, and the first position in row order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCount {
    /// Number of occurrences.
    pub count: u64,
    /// The first position.
    pub first: Option<ProofPosition>,
}

impl FaultCount {
    pub(crate) fn add(&mut self, at: ProofPosition) {
        self.merge(&Self { count: 1, first: Some(at) });
    }

    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.first = match (self.first, other.first) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
    }
}

/// A place of the grid and its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorSpot {
    /// Vertical distance to the mesh.
    pub error: f64,
    /// Where it is, rounded down.
    pub at: ProofPosition,
}

impl ErrorSpot {
    /// The larger error; of equal ones the first in row order.
    pub(crate) fn worse(self, other: Self) -> Self {
        let later = other.at > self.at;
        if other.error < self.error || other.error == self.error && later { self } else { other }
    }
}

/// Findings of the parts checked so far. For a point cloud, samples are points: surface samples are the lowest
/// at their position, and off the samples means off the points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProofTally {
    /// Samples with a height.
    pub valid: u64,
    /// Samples that belong to a surface cell.
    pub surface_samples: u64,
    /// Cells with four valid samples.
    pub surface_cells: u64,
    /// Surface samples on the mesh.
    pub covered: u64,
    /// Surface samples not on the mesh.
    pub uncovered: FaultCount,
    /// Surface cells no triangle overlaps.
    pub uncovered_cells: FaultCount,
    /// Cells without surface that a triangle overlaps.
    pub void_cells: FaultCount,
    /// Samples further from the mesh than the tolerance.
    pub over: FaultCount,
    /// The largest error.
    pub worst: Option<ErrorSpot>,
    /// Breaks of the mesh on lines between neighbouring samples of the surface.
    pub breaks: u64,
    /// Breaks further from their line than the tolerance.
    pub over_between: FaultCount,
    /// The largest error of a break.
    pub worst_between: Option<ErrorSpot>,
    /// Sum of errors.
    pub errors: ExactSum,
    /// Sum of squared errors.
    pub squares: ExactSum,
    /// Samples by error / tolerance in twentieths; the last entry counts those over.
    pub histogram: [u64; ProofTally::BINS + 1],
    /// Triangles clockwise seen from above.
    pub inverted: FaultCount,
    /// Triangles without area.
    pub empty: FaultCount,
    /// Triangles that reach beyond the grid, or vertices beyond the hull of a cloud.
    pub outside: FaultCount,
    /// Samples strictly inside more than one triangle.
    pub overlaps: FaultCount,
    /// Sum of twice the signed areas, in 2^-60 cell, of correctly oriented triangles positive.
    pub double_area: i128,
    /// The smallest angle of a triangle with area, in degrees.
    pub smallest_angle: Option<f64>,
    /// Triangles by smallest angle, in steps of 5 degrees from 0 to 60.
    pub angles: [u64; ProofTally::ANGLES],
    /// Edges of one triangle only.
    pub open_edges: u64,
    /// Edges of two triangles that pass them in opposite directions.
    pub interior_edges: u64,
    /// Edges of one triangle only that are not on the outline of the surface (for a cloud, its
    /// hull).
    pub cracks: FaultCount,
    /// Vertices strictly inside an edge of one triangle.
    pub t_junctions: FaultCount,
    /// Edges of more than two triangles, or of two that pass it in the same direction.
    pub non_manifold: FaultCount,
    /// Interior edges between triangles on either side with the opposite corner of one strictly
    /// inside the circle through the other.
    pub non_delaunay: FaultCount,
    /// Positions at which triangles meet with different heights.
    pub split_heights: FaultCount,
    /// Stored vertices beyond the first at the same position.
    pub duplicates: FaultCount,
    /// Stored vertices at no triangle's corner.
    pub unused: FaultCount,
    /// Triangles with a smaller angle than they may have.
    pub thin: FaultCount,
    /// Samples of the surface that have to be vertices.
    pub kept: u64,
    /// Required samples that are not vertices, or not at their height.
    pub not_kept: FaultCount,
    /// Vertices on breaklines.
    pub on_lines: u64,
    /// Samples where the mesh does not follow a breakline.
    pub not_followed: FaultCount,
    /// Positions of corners that are not a sample, or not at its height.
    pub off_samples: FaultCount,
}

impl ProofTally {
    /// Bins of [`ProofTally::histogram`] up to the tolerance.
    pub const BINS: usize = 20;
    /// Bins of [`ProofTally::angles`].
    pub const ANGLES: usize = 12;

    /// Adds the findings of another tally.
    pub fn merge(&mut self, other: &Self) {
        self.valid += other.valid;
        self.surface_samples += other.surface_samples;
        self.surface_cells += other.surface_cells;
        self.covered += other.covered;
        self.kept += other.kept;
        self.on_lines += other.on_lines;
        self.breaks += other.breaks;
        self.open_edges += other.open_edges;
        self.interior_edges += other.interior_edges;
        self.double_area = self.double_area.saturating_add(other.double_area);
        self.errors.merge(&other.errors);
        self.squares.merge(&other.squares);
        other.worst.into_iter().for_each(|spot| self.spot(spot));
        other.worst_between.into_iter().for_each(|spot| self.spot_between(spot));
        other.smallest_angle.into_iter().for_each(|angle| self.angle_at_least(angle));
        add(&mut self.histogram, &other.histogram);
        add(&mut self.angles, &other.angles);
        for (mine, more) in self.faults_mut().into_iter().zip(other.clone().faults_mut()) {
            mine.merge(more);
        }
    }

    fn faults_mut(&mut self) -> [&mut FaultCount; 20] {
        [
            &mut self.uncovered,
            &mut self.uncovered_cells,
            &mut self.void_cells,
            &mut self.over,
            &mut self.over_between,
            &mut self.inverted,
            &mut self.empty,
            &mut self.outside,
            &mut self.overlaps,
            &mut self.cracks,
            &mut self.t_junctions,
            &mut self.non_manifold,
            &mut self.non_delaunay,
            &mut self.split_heights,
            &mut self.duplicates,
            &mut self.unused,
            &mut self.thin,
            &mut self.not_kept,
            &mut self.not_followed,
            &mut self.off_samples,
        ]
    }

    /// Takes note of the error of a sample.
    pub(crate) fn spot(&mut self, spot: ErrorSpot) {
        self.worst = Some(self.worst.map_or(spot, |worst| worst.worse(spot)));
    }

    /// Takes note of the error of a break.
    pub(crate) fn spot_between(&mut self, spot: ErrorSpot) {
        self.worst_between = Some(self.worst_between.map_or(spot, |worst| worst.worse(spot)));
    }

    /// The largest error of samples and breaks: that of the surface.
    pub fn worst_of_surface(&self) -> Option<ErrorSpot> {
        self.worst.into_iter().chain(self.worst_between).reduce(ErrorSpot::worse)
    }

    fn angle_at_least(&mut self, angle: f64) {
        self.smallest_angle = Some(self.smallest_angle.map_or(angle, |least| least.min(angle)));
    }

    /// Judges the area and the angles of a triangle; for `orientation` see [`GridProofPart`](crate::GridProofPart).
    pub(crate) fn shape(&mut self, triangle: &ProofTriangle, orientation: i128) {
        let at = triangle.corners[0].at;
        let area = triangle.double_area() * orientation;
        // Beyond the range of the sum areas match nothing, whatever the rest is.
        self.double_area = self.double_area.saturating_add(area);
        if area == 0 {
            self.empty.add(at);
            return;
        }
        if area < 0 {
            self.inverted.add(at);
        }
        let angle = triangle.smallest_angle();
        self.angle_at_least(angle);
        self.angles[((angle / 5.0) as usize).min(Self::ANGLES - 1)] += 1;
    }
}

fn add<const N: usize>(mine: &mut [u64; N], more: &[u64; N]) {
    mine.iter_mut().zip(more).for_each(|(a, b)| *a += b);
}
