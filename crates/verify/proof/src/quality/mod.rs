//! The quality of a mesh as a triangulation: angles, degrees, lengths, and how much of it is Delaunay.
//! It is measured, not judged, and of the mesh alone.
//!
//! The lattice is that of a [`QualityLattice`], and domains divide it as they divide a grid: a vertex, an edge (by
//! its lower end) and a triangle (by its first corner) is measured in the domain that owns it, so a part
//! needs the triangles with a corner in its domain, and no others.

mod circle;
mod plan;
mod shape;
#[cfg(test)]
mod tests;
mod totals;

pub use circle::DelaunayVerdict;
pub use plan::QualityLattice;
pub use shape::TriangleShape;
pub use totals::{AcuteAngles, DelaunayCounts, Quality};

use std::mem::size_of;

use crate::edges::{BYTES_PER_TRIANGLE, EdgeMeeting, PartCorners};
use crate::{GridDomain, ProofTriangle};

/// One rectangle of the lattice to measure.
#[derive(Debug)]
pub struct QualityPart<'a> {
    /// The positions it owns.
    pub domain: GridDomain,
    /// Every triangle with a corner in the domain, in any order; others do no harm.
    pub triangles: &'a [ProofTriangle],
    /// The lattice.
    pub plan: &'a QualityLattice,
    /// Whether heights have the unit of x and y, so that there are angles in space.
    pub has_space: bool,
}

/// Bytes [`measure`] needs for `triangles` triangles, these included.
pub fn bytes_needed(triangles: u64) -> u64 {
    let degrees = 3 * size_of::<u32>();
    triangles.saturating_mul((size_of::<ProofTriangle>() + BYTES_PER_TRIANGLE + degrees) as u64)
}

/// Measures one part and adds what it owns to `quality`. O(triangles log triangles).
pub fn measure(part: &QualityPart<'_>, quality: &mut Quality) {
    let owned = part.triangles.iter().filter(|t| part.domain.owns(t.corners[0].at));
    owned.for_each(|triangle| measure_triangle(triangle, part, quality));
    let corners = PartCorners::new(part.triangles, |_, _| {});
    let mut degrees = vec![0u32; corners.positions.len()];
    corners.each_edge(|ends, meeting, sides| {
        sides[0].numbers().into_iter().for_each(|number| degrees[number as usize] += 1);
        if !part.domain.owns(ends[0]) {
            return;
        }
        let [x, y] = ends[1].minus(ends[0]);
        quality.edge(x.hypot(y));
        match meeting {
            EdgeMeeting::Open(_) => quality.border += 1,
            EdgeMeeting::Tangled => quality.tangled += 1,
            EdgeMeeting::Inner(apexes) => {
                quality.pair(DelaunayVerdict::of(ends, apexes, part.plan.rounding()))
            }
        }
    });
    let vertices = corners.positions.iter().zip(degrees);
    let owned = vertices.filter(|(at, _)| part.domain.owns(**at));
    owned.for_each(|(_, degree)| quality.vertex(degree));
}

fn measure_triangle(triangle: &ProofTriangle, part: &QualityPart<'_>, quality: &mut Quality) {
    quality.shape(TriangleShape::in_plan(triangle), triangle.double_area() < 0);
    if part.has_space {
        quality.shape_in_space(TriangleShape::in_space(triangle, part.plan.cell()));
    }
}
