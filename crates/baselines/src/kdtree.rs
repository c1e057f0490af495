//! A tree of rectangles of two triangles each, halved across the longer side.
//!
//! Source: the tree is the k-d tree of Bentley, "Multidimensional binary search trees used for associative
//! searching" (1975), as used for surfaces in Samet, "The design and analysis of spatial data structures"
//! (1990). Corners may lie within a side of a neighbour; as in Von Herzen & Barr, "Accurate triangulations of
//! deformed, intersecting surfaces" (1987), such a corner becomes a vertex of the neighbour too, which is
//! triangulated by Delaunay. That changes its surface, so its samples are tested again, and it is cut if one is
//! beyond the tolerance: in rounds, until all are within. A single cell always is.
//!
//! Rectangles that are partly void are cut, too. Of equal sides the columns are halved. Cuts through the worst
//! sample instead of the middle leave a fifth more vertices, because they make narrow rectangles. Time O(n log n)
//! for each of few rounds, expected. Memory: the rectangles, and a number per sample.

use std::ops::Range;

use crate::grid::PackedSample;
use crate::mesh::{BaselineMesh, check_surface};
use crate::method::{BaselineMethod, MethodPromise};
use crate::plane::TrianglePlane;
use crate::result::BaselineTin;
use crate::settings::BaselineTask;
use crate::surface::{SurfaceCellSums, SurfaceCoverage};
use terrane_base::bits::BitSet;
use terrane_base::error::Result;

pub(crate) const KDTREE: BaselineMethod = BaselineMethod {
    name: "kdtree",
    about: "k-d tree: rectangles halved across the longer side where a sample exceeds the error, made conforming",
    source: "Bentley 1975; Von Herzen & Barr 1987",
    time: "O(n log n) for each of few rounds, expected",
    memory: "the grid, the mesh, and a number for each sample",
    promise: MethodPromise::Samples,
    takes_triangulation: false,
    is_delaunay: false,
    takes_budget: false,
    sample_bytes: 180,
    run,
};

fn run(task: &BaselineTask<'_>) -> Result<BaselineTin> {
    check_surface(&task.grid)?;
    let cells = SurfaceCellSums::new(&task.grid);
    let mut waiting = vec![SampleRectangle {
        low: [0, 0],
        high: [task.grid.width() - 1, task.grid.height() - 1],
    }];
    let mut leaves = Vec::new();
    loop {
        // A cut adds vertices on sides of neighbours, whose errors change: all leaves are tested again.
        divide(task, &cells, &mut waiting, &mut leaves)?;
        let triangles = conform(task, &mut leaves, &mut waiting)?;
        if waiting.is_empty() {
            return Ok(BaselineTin::of_triangles(&task.grid, triangles));
        }
    }
}

/// Cuts rectangles until all are on the surface and, as two triangles, within the tolerance.
fn divide(
    task: &BaselineTask<'_>,
    cells: &SurfaceCellSums,
    waiting: &mut Vec<SampleRectangle>,
    leaves: &mut Vec<SampleRectangle>,
) -> Result<()> {
    while let Some(rectangle) = waiting.pop() {
        (task.pulse)()?;
        match cells.extent(rectangle.low, rectangle.high) {
            SurfaceCoverage::Outside => {}
            SurfaceCoverage::Inside if is_sound(task, &rectangle.mesh()) => leaves.push(rectangle),
            SurfaceCoverage::Partly | SurfaceCoverage::Inside => waiting.extend(rectangle.halves()),
        }
    }
    Ok(())
}

/// The triangles of all leaves with the corners of neighbours as vertices; a leaf beyond the tolerance with them is
/// cut and moved to `waiting`.
fn conform(
    task: &BaselineTask<'_>,
    leaves: &mut Vec<SampleRectangle>,
    waiting: &mut Vec<SampleRectangle>,
) -> Result<Vec<[PackedSample; 3]>> {
    let mut corners = BitSet::new(task.grid.len());
    for corner in leaves.iter().flat_map(SampleRectangle::corners) {
        corners.insert(task.grid.index(corner));
    }
    let mut triangles = Vec::new();
    let mut sound = Vec::with_capacity(leaves.len());
    for leaf in leaves.drain(..) {
        (task.pulse)()?;
        let mut mesh = leaf.mesh();
        let others = leaf.sides().filter(|at| corners.contains(task.grid.index(*at)));
        mesh.insert_all(&task.grid, others);
        if !is_sound(task, &mesh) {
            waiting.extend(leaf.halves());
            continue;
        }
        triangles.extend(mesh.surface().map(|id| mesh.tris[id as usize].corners));
        sound.push(leaf);
    }
    *leaves = sound;
    Ok(triangles)
}

/// True if all samples are within the tolerance.
fn is_sound(task: &BaselineTask<'_>, mesh: &BaselineMesh) -> bool {
    mesh.surface().all(|id| {
        let plane = TrianglePlane::new(&task.grid, mesh.tris[id as usize].corners);
        !plane.offsets().any(|(_, offset)| task.exceeds(&offset))
    })
}

fn along_row(row: u32, cols: Range<u32>) -> impl Iterator<Item = PackedSample> {
    cols.map(move |col| PackedSample::new(col, row))
}

fn along_column(col: u32, rows: Range<u32>) -> impl Iterator<Item = PackedSample> {
    rows.map(move |row| PackedSample::new(col, row))
}

/// A rectangle between two samples.
#[derive(Clone, Copy, Debug)]
struct SampleRectangle {
    low: [u32; 2],
    high: [u32; 2],
}

impl SampleRectangle {
    /// The parts on both sides of a cut through the middle of the longer side.
    fn halves(self) -> [Self; 2] {
        let [cols, rows] = [0, 1].map(|axis| self.high[axis] - self.low[axis]);
        let axis = usize::from(rows > cols);
        let cut = u32::midpoint(self.low[axis], self.high[axis]);
        let (mut before, mut after) = (self, self);
        (before.high[axis], after.low[axis]) = (cut, cut);
        [before, after]
    }

    fn corners(&self) -> [PackedSample; 4] {
        let ([left, above], [right, below]) = (self.low, self.high);
        [[left, above], [right, above], [right, below], [left, below]]
            .map(|[col, row]| PackedSample::new(col, row))
    }

    /// The samples of the sides without the corners.
    fn sides(&self) -> impl Iterator<Item = PackedSample> + use<> {
        let ([left, above], [right, below]) = (self.low, self.high);
        let (cols, rows) = (left + 1..right, above + 1..below);
        // In ring order: samples are inserted in this order, each near the one before.
        along_row(above, cols.clone())
            .chain(along_column(right, rows.clone()))
            .chain(along_row(below, cols))
            .chain(along_column(left, rows))
    }

    fn mesh(&self) -> BaselineMesh {
        let [low, _, high, _] = self.corners();
        BaselineMesh::of_rectangle(low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_is_across_the_longer_side() {
        let rectangle = SampleRectangle { low: [2, 3], high: [9, 5] };
        let halves = rectangle.halves().map(|half| (half.low, half.high));
        assert_eq!(halves, [([2, 3], [5, 5]), ([5, 3], [9, 5])]);
        assert_eq!(rectangle.sides().count(), 6 + 1 + 6 + 1);
    }

    #[test]
    fn a_corner_within_a_side_becomes_a_vertex_of_both() {
        // A single peak: rectangles around it are small, those beyond are large.
        let mut heights = vec![0.0; 17 * 17];
        heights[3 * 17 + 3] = 9.0;
        let grid = crate::grid::HeightGrid::new(17, 17, &heights, None).unwrap();
        let tin =
            run(&BaselineTask::new(grid, crate::settings::BaselineGoal::MaxError(1.0))).unwrap();
        crate::tests::check_cover(&grid, &tin);
        assert!(tin.vertices.contains(&PackedSample::new(3, 3)) && tin.vertices.len() < 60);
    }
}
