//! The finished mesh, in an order that depends on its triangles only, and its exact error.

use crate::grid::{HeightGrid, PackedSample};
use crate::mesh::BaselineMesh;
use crate::plane::TrianglePlane;
use crate::surface::SampleStatistics;
use terrane_base::bits::BitSet;

/// A mesh of samples of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct BaselineTin {
    /// Samples that are vertices, in (row, column) order.
    pub vertices: Vec<PackedSample>,
    /// Triangles, counter-clockwise in (column, row) axes, as indices into `vertices`.
    pub triangles: Vec<[u32; 3]>,
    /// The smallest double that is not below the vertical error of any sample of the surface.
    pub max_error: f64,
    /// Sum of the squared errors of the samples of the surface.
    pub square_sum: f64,
    /// Statistics of the grid's samples.
    pub census: SampleStatistics,
}

impl BaselineTin {
    /// The surface of a mesh.
    pub(crate) fn of_mesh(grid: &HeightGrid<'_>, mesh: &BaselineMesh) -> Self {
        Self::of_triangles(grid, mesh.surface().map(|id| mesh.tris[id as usize].corners).collect())
    }

    /// A mesh of counter-clockwise triangles. Time O(n log n), memory a bit per sample beside the mesh.
    pub(crate) fn of_triangles(grid: &HeightGrid<'_>, mut corners: Vec<[PackedSample; 3]>) -> Self {
        let (vertices, triangles) = connected(&mut corners);
        let (max_error, square_sum) = measure(grid, &corners);
        Self { vertices, triangles, max_error, square_sum, census: SampleStatistics::of(grid) }
    }
}

/// Vertices in order, and triangles as indices into them; sorts `corners`.
pub(crate) fn connected(corners: &mut [[PackedSample; 3]]) -> (Vec<PackedSample>, Vec<[u32; 3]>) {
    corners.iter_mut().for_each(lowest_first);
    corners.sort_unstable();
    let mut vertices: Vec<PackedSample> = corners.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let triangles = corners
        .iter()
        .map(|corners| corners.map(|at| vertices.partition_point(|vertex| *vertex < at) as u32));
    let triangles = triangles.collect();
    (vertices, triangles)
}

fn lowest_first(corners: &mut [PackedSample; 3]) {
    let lowest = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
    corners.rotate_left(lowest);
}

/// The largest error and the sum of squared errors. A sample on an edge counts once; vertices that the output
/// rounds count, too.
pub(crate) fn measure(grid: &HeightGrid<'_>, triangles: &[[PackedSample; 3]]) -> (f64, f64) {
    let mut seen = BitSet::new(grid.len());
    let (mut worst, mut sum) = (0.0, 0.0);
    for &corners in triangles {
        let plane = TrianglePlane::new(grid, corners);
        for (_, offset) in plane.offsets().filter(|(at, _)| seen.insert(grid.index(*at))) {
            sum += offset.error().powi(2);
            if !offset.is_within(worst) {
                worst = offset.min_bound();
            }
        }
    }
    (worst, sum)
}
