//! The unit of a proof: a rectangle of samples, with everything that touches it.

use super::breaklines::ProofBreakline;
use super::domain::GridDomain;
use super::lattice_position::HeightPrecision;
use super::sections::floor;
use super::surface::ProofSurface;
use super::totals::ProofTally;
use super::triangle::{ProofPosition, ProofTriangle};

/// One rectangle of samples to check, with all that touches it.
#[derive(Debug)]
pub struct GridProofPart<'a> {
    /// The samples it owns, in the grid they belong to.
    pub domain: GridDomain,
    /// Heights of [`GridDomain::apron`], row by row, NaN where void.
    pub heights: &'a [f64],
    /// Every triangle that touches the domain, in any order; others do no harm.
    pub triangles: &'a [ProofTriangle],
    /// Positions of all stored vertices of the domain, sorted; `None` when the vertices of the
    /// format have no identity.
    pub vertices: Option<&'a [ProofPosition]>,
    /// Required samples of the domain, sorted; only those of the surface have to be vertices.
    pub kept: &'a [ProofPosition],
    /// Breaklines that may pass through the domain; others do no harm.
    pub lines: &'a [ProofBreakline],
    /// Bound on the angles of triangles, if any.
    pub min_angle: Option<ProofAngleBound>,
    /// How the mesh stores heights.
    pub precision: HeightPrecision,
    /// Vertices inside the surface may have other heights than their samples.
    pub is_fitted: bool,
    /// Largest allowed vertical distance; `None` to measure only.
    pub tolerance: Option<f64>,
    /// +1 when a triangle that is counter-clockwise in the world is so in (column, row) axes too,
    /// -1 when it is clockwise there (a north-up grid).
    pub orientation: i128,
}

impl GridProofPart<'_> {
    /// True when a vertex at an owned position is a valid sample, with its height as the format holds it. Fitted
    /// heights may be others inside the surface, not on its outline.
    pub(crate) fn is_sample(&self, at: ProofPosition, z: f64, surface: &ProofSurface) -> bool {
        let Some(height) = self.sample(at) else { return false };
        match self.is_fitted && surface.is_inside(at) {
            true => !height.is_nan(),
            false => self.precision.is(z, height),
        }
    }

    /// The height of the sample at a position that is owned, if one is there; NaN where it is void.
    pub(crate) fn sample(&self, at: ProofPosition) -> Option<f64> {
        let apron = self.domain.apron();
        let [col, row] = [at.col, at.row].map(|fixed| u32::try_from(floor(fixed)).ok());
        let (col, row) = (col?, row?);
        if !at.is_sample() || !apron.contains(col, row) {
            return None;
        }
        let (col, row) = (col - apron.col, row - apron.row);
        self.heights.get(row as usize * apron.width as usize + col as usize).copied()
    }

    /// Judges a triangle by itself, when the part owns it (its first corner).
    pub(crate) fn triangle(&self, triangle: &ProofTriangle, tally: &mut ProofTally) {
        let at = triangle.corners[0].at;
        if !self.domain.owns(at) {
            return;
        }
        tally.shape(triangle, self.orientation);
        if self.min_angle.is_some_and(|bound| bound.is_broken_by(triangle)) {
            tally.thin.add(at);
        }
        if triangle.double_area() != 0 && is_outside(triangle, self.domain.grid) {
            tally.outside.add(at);
        }
    }
}

/// The smallest angle that triangles may have in plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProofAngleBound {
    /// In degrees.
    pub degrees: f64,
    /// By how much x and y change along a column's step (x first), and along a row's.
    pub steps: [[f64; 2]; 2],
}

impl ProofAngleBound {
    /// Tolerance for rounding, in degrees.
    const ROUNDING: f64 = 1e-7;

    /// True when a triangle has a smaller angle.
    pub fn is_broken_by(&self, triangle: &ProofTriangle) -> bool {
        triangle.smallest_angle_in(self.steps) < self.degrees - Self::ROUNDING
    }
}

fn is_outside(triangle: &ProofTriangle, grid: [u32; 2]) -> bool {
    let [low, high] = triangle.bounds();
    let last = ProofPosition::sample(i64::from(grid[0]) - 1, i64::from(grid[1]) - 1);
    low.col < 0 || low.row < 0 || high.col > last.col || high.row > last.row
}
