//! Very Important Points: samples that differ most from their eight neighbours are vertices of a Delaunay
//! triangulation.
//!
//! Source: Chen & Guevara, "Systematic selection of very important points (VIP) from digital terrain model
//! for constructing triangular irregular networks" (1987). The significance of a sample is the mean of its
//! distances from the four lines between opposite neighbours. Distances are vertical here, so that the unit of
//! the heights does not matter; lines with a void or beyond the grid are left out.
//!
//! That is a high-pass filter: it detects pits, peaks and breaks of slope, but no large gentle forms. So it does
//! not bound the error, which is measured. For a maximum error, the most significant samples are inserted; their
//! number is found by bisection: it meets the error, one less does not (the error is not monotonic, so a smaller
//! number may exist).
//!
//! Time O(n log n), and again for each of the log n meshes of a bisection. Memory: sixteen bytes per sample.

use std::cmp::Reverse;

use crate::grid::{HeightGrid, PackedSample};
use crate::mesh::BaselineMesh;
use crate::method::{BaselineMethod, MethodPromise};
use crate::result::BaselineTin;
use crate::settings::{BaselineGoal, BaselineTask, SurfaceSize};
use crate::star::is_free;
use terrane_base::error::Result;

pub(crate) const VIP: BaselineMethod = BaselineMethod {
    name: "vip",
    about: "very important points: samples that differ most from their neighbours",
    source: "Chen & Guevara 1987",
    time: "O(n log n) for a number of vertices, O(n log^2 n) for an error",
    memory: "the grid, the mesh, and the order of its samples",
    promise: MethodPromise::Measured,
    takes_triangulation: false,
    is_delaunay: true,
    takes_budget: true,
    sample_bytes: 260,
    run,
};

fn run(task: &BaselineTask<'_>) -> Result<BaselineTin> {
    let outline = BaselineMesh::of_outline(&task.grid)?;
    let size = SurfaceSize::of(&outline, task.goal)?;
    let order = by_significance(&task.grid);
    let count = match task.goal {
        BaselineGoal::MaxError(tolerance) => return enough(task, &outline, &order, tolerance),
        BaselineGoal::MaxVertices(max) => (max - size.vertices) as usize,
        BaselineGoal::MaxTriangles(max) => with_triangles(&task.grid, &order, max - size.triangles),
    };
    mesh(task, &outline, &order[..count.min(order.len())])
}

/// Number of first samples that make at most the given number of triangles: two each, or one on a side of the grid.
fn with_triangles(grid: &HeightGrid<'_>, order: &[PackedSample], max: u64) -> usize {
    let sums = order.iter().scan(0, |sum, at| {
        *sum += if grid.is_on_side(*at) { 1 } else { 2 };
        Some(*sum)
    });
    sums.take_while(|sum| *sum <= max).count()
}

/// Samples within the surface, the most significant first; for equal significance the lowest (row, column).
fn by_significance(grid: &HeightGrid<'_>) -> Vec<PackedSample> {
    let samples = grid.samples().filter(|at| is_free(grid, *at));
    let mut all: Vec<(Significance, PackedSample)> =
        samples.map(|at| (significance(grid, at), at)).collect();
    all.sort_unstable_by_key(|&(significance, at)| (Reverse(significance), at));
    all.into_iter().map(|(_, at)| at).collect()
}

/// A non-negative distance as bits, which have its order.
type Significance = u64;

fn significance(grid: &HeightGrid<'_>, at: PackedSample) -> Significance {
    let [col, row] = at.lattice();
    let lines = [[1, 0], [0, 1], [1, 1], [1, -1]];
    let distances = lines.into_iter().filter_map(|[dx, dy]| {
        let before = height_at(grid, [col - dx, row - dy])?;
        let after = height_at(grid, [col + dx, row + dy])?;
        Some((grid.sample(at) - f64::midpoint(before, after)).abs())
    });
    let distances: Vec<f64> = distances.collect();
    // Beside voids there may be no line: 0, not NaN, whose bits are above those of all numbers.
    (distances.iter().sum::<f64>() / distances.len().max(1) as f64).to_bits()
}

/// Height at a column and row; `None` for a void or beyond the grid.
fn height_at(grid: &HeightGrid<'_>, [col, row]: [i32; 2]) -> Option<f64> {
    let (col, row) = (u32::try_from(col).ok()?, u32::try_from(row).ok()?);
    let is_inside = col < grid.width() && row < grid.height();
    is_inside.then(|| grid.sample(PackedSample::new(col, row))).filter(|z| !z.is_nan())
}

/// Samples inserted between pulses.
const STRETCH: usize = 1 << 12;

/// The mesh of some samples, inserted near each other.
fn mesh(
    task: &BaselineTask<'_>,
    outline: &BaselineMesh,
    chosen: &[PackedSample],
) -> Result<BaselineTin> {
    let (mut mesh, mut chosen) = (outline.clone(), chosen.to_vec());
    chosen.sort_unstable_by_key(|at| interleaved(at.col()) | interleaved(at.row()) << 1);
    for stretch in chosen.chunks(STRETCH) {
        (task.pulse)()?;
        mesh.insert_all(&task.grid, stretch.iter().copied());
    }
    Ok(BaselineTin::of_mesh(&task.grid, &mesh))
}

/// The bits of a number with zeros between them, for a position on a Z-order curve (Morton 1966).
fn interleaved(number: u32) -> u64 {
    (0..14).map(|bit| u64::from(number >> bit & 1) << (2 * bit)).sum()
}

/// The mesh of a number of first samples that meets the error, while one less does not.
fn enough(
    task: &BaselineTask<'_>,
    outline: &BaselineMesh,
    order: &[PackedSample],
    tolerance: f64,
) -> Result<BaselineTin> {
    let coarsest = mesh(task, outline, &[])?;
    if coarsest.max_error <= tolerance {
        return Ok(coarsest);
    }
    let mut best = mesh(task, outline, order)?;
    let (mut fails, mut holds) = (0, order.len());
    while holds - fails > 1 {
        let middle = fails + (holds - fails) / 2;
        let tin = mesh(task, outline, &order[..middle])?;
        match tin.max_error <= tolerance {
            true => (holds, best) = (middle, tin),
            false => fails = middle,
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_comes_before_its_neighbours_and_they_before_the_plain() {
        let mut heights = vec![0.0; 49];
        heights[3 * 7 + 3] = 9.0;
        let grid = HeightGrid::new(7, 7, &heights, None).unwrap();
        let order = by_significance(&grid);
        assert_eq!(order.len(), 45);
        assert_eq!(order[0], PackedSample::new(3, 3));
        let near = |at: &PackedSample| at.col().abs_diff(3).max(at.row().abs_diff(3));
        // Each neighbour has one line to the peak.
        assert!(order[1..9].iter().all(|at| near(at) == 1));
        assert_eq!(order[9], PackedSample::new(1, 0));
        assert_eq!(f64::from_bits(significance(&grid, PackedSample::new(3, 3))), 9.0);
        assert_eq!(f64::from_bits(significance(&grid, PackedSample::new(2, 3))), 4.5 / 4.0);
    }

    #[test]
    fn one_vertex_fewer_breaks_the_error() {
        let heights: Vec<f64> = (0..144).map(|i| f64::from(i * i % 31)).collect();
        let grid = HeightGrid::new(12, 12, &heights, None).unwrap();
        let tin = run(&BaselineTask::new(grid, BaselineGoal::MaxError(6.0))).unwrap();
        let fewer = BaselineGoal::MaxVertices(tin.vertices.len() as u64 - 1);
        assert!(
            tin.max_error <= 6.0 && run(&BaselineTask::new(grid, fewer)).unwrap().max_error > 6.0
        );
    }
}
