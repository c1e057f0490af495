//! The drop heuristic: starts with all samples as vertices and repeatedly removes the one that leaves the smallest
//! error, while all samples are within the tolerance.
//!
//! Source: Lee, "A drop heuristic conversion method for extracting irregular network for digital elevation
//! models" (1989); "Comparison of existing methods for building triangular irregular network models of terrain
//! from grid digital elevation models" (1991). The error of a removal is the largest of all samples in the
//! star of the vertex, refilled with Delaunay triangles, including samples removed before; a vertex is
//! measured again when its star changes. At the end no vertex can be removed. Outlines stay.
//!
//! Ties: for equal errors the lowest (row, column) goes first.
//!
//! Time O(n log n log (n/m)) expected to come from n samples to m vertices: a star holds some n/m samples when
//! m are left. Memory: some words per sample.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::grid::PackedSample;
use crate::mesh::check_surface;
use crate::method::{BaselineMethod, MethodPromise};
use crate::plane::TrianglePlane;
use crate::result::BaselineTin;
use crate::settings::{BaselineTask, SurfaceSize};
use crate::star::{FullMesh, VertexStar, is_free};
use terrane_base::error::Result;

pub(crate) const DROP: BaselineMethod = BaselineMethod {
    name: "drop",
    about: "decimation: removes the vertex with the smallest resulting error, repeatedly",
    source: "Lee 1989, 1991",
    time: "O(n log n log (n/m)), expected",
    memory: "the grid, and a mesh of all samples",
    promise: MethodPromise::Samples,
    takes_triangulation: false,
    is_delaunay: true,
    takes_budget: true,
    sample_bytes: 340,
    run,
};

fn run(task: &BaselineTask<'_>) -> Result<BaselineTin> {
    let mut dropping = DroppingMesh::new(task)?;
    dropping.run()?;
    Ok(BaselineTin::of_mesh(&task.grid, &dropping.full.mesh))
}

/// A removal of a vertex; the order is that of errors, and for equal errors that of vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct VertexRemoval {
    /// Bits of the resulting error: errors are not negative, so bits have their order.
    error: u64,
    vertex: PackedSample,
    /// Stamp of the star of the vertex.
    stamp: u32,
}

/// A mesh during simplification.
struct DroppingMesh<'a> {
    task: &'a BaselineTask<'a>,
    full: FullMesh,
    heap: BinaryHeap<Reverse<VertexRemoval>>,
    /// By sample: the number of changes of its star.
    stamps: Vec<u32>,
}

impl<'a> DroppingMesh<'a> {
    fn new(task: &'a BaselineTask<'a>) -> Result<Self> {
        let grid = &task.grid;
        check_surface(grid)?;
        let stamps = vec![0; grid.len()];
        let mut new = Self { task, full: FullMesh::new(grid), heap: BinaryHeap::new(), stamps };
        for at in grid.samples() {
            (task.pulse)()?;
            new.weigh(at);
        }
        Ok(new)
    }

    fn run(&mut self) -> Result<()> {
        let mut size = SurfaceSize::counted(&self.full.mesh);
        while !size.meets(self.task.goal) {
            (self.task.pulse)()?;
            let Some(vertex) = self.next() else { return size.check(self.task.goal) };
            let star = self.full.star(&self.task.grid, vertex);
            let Some(filling) = star.ears() else { continue };
            size.shrink(&star, &filling);
            self.full.refill(&self.task.grid, &star, &filling);
            star.ring.iter().for_each(|link| self.weigh(link.from));
        }
        Ok(())
    }

    /// The vertex to remove next.
    fn next(&mut self) -> Option<PackedSample> {
        loop {
            let Reverse(removal) = self.heap.pop()?;
            if self.stamps[self.task.grid.index(removal.vertex)] == removal.stamp {
                return Some(removal.vertex);
            }
        }
    }

    /// Queues the removal of a vertex, if it is allowed. Invalidates existing entries.
    fn weigh(&mut self, vertex: PackedSample) {
        let index = self.task.grid.index(vertex);
        self.stamps[index] += 1;
        if is_free(&self.task.grid, vertex) {
            let star = self.full.star(&self.task.grid, vertex);
            let stamp = self.stamps[index];
            self.heap.extend(
                removal_error(self.task, &star)
                    .map(|error| Reverse(VertexRemoval { error: error.to_bits(), vertex, stamp })),
            );
        }
    }
}

/// The largest error in the star of a vertex after its removal; `None` if it is beyond the tolerance.
fn removal_error(task: &BaselineTask<'_>, star: &VertexStar) -> Option<f64> {
    let mut worst = 0.0;
    for corners in star.ears()? {
        let plane = TrianglePlane::new(&task.grid, corners);
        for (_, offset) in plane.offsets() {
            if task.forbids(&offset) {
                return None;
            }
            worst = offset.error().max(worst);
        }
    }
    Some(worst)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::BaselineGoal;
    use crate::tests::{grids, tolerances};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn in_the_end_no_vertex_can_go(heights in grids(), tolerance in tolerances()) {
            let grid = heights.grid();
            prop_assume!(check_surface(&grid).is_ok());
            let task = BaselineTask::new(grid, BaselineGoal::MaxError(tolerance));
            let mut dropping = DroppingMesh::new(&task).unwrap();
            dropping.run().unwrap();
            dropping.full.mesh.validate();
            let tin = BaselineTin::of_mesh(&grid, &dropping.full.mesh);
            for &vertex in tin.vertices.iter().filter(|at| is_free(&grid, **at)) {
                let star = dropping.full.star(&grid, vertex);
                prop_assert!(star.ears().is_some(), "a star has no filling");
                prop_assert!(removal_error(&task, &star).is_none(), "{:?} can go", vertex);
            }
        }
    }

    #[test]
    fn a_plane_keeps_its_corners_alone() {
        let heights: Vec<f64> = (0..40 * 30).map(|i| f64::from(2 * (i % 40) - i / 40)).collect();
        let grid = crate::grid::HeightGrid::new(40, 30, &heights, None).unwrap();
        let tin = run(&BaselineTask::new(grid, BaselineGoal::MaxError(0.0))).unwrap();
        assert_eq!((tin.vertices.len(), tin.triangles.len(), tin.max_error), (4, 2, 0.0));
    }
}
