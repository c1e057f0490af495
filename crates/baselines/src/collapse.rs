//! Edge collapse: starts with all samples as vertices and collapses edges to one of their ends, the cheapest
//! first, while all samples are within the tolerance and no triangle is inverted.
//!
//! Source: Garland & Heckbert, "Surface simplification using quadric error metrics" (1997), with half-edge
//! collapses, so that vertices stay samples. The quadrics are sums of squared *vertical* distances from the
//! planes of the first triangles, weighted by area: so the unit of the heights does not matter. They only determine
//! the order; whether a collapse is allowed is decided by all samples of the star.
//!
//! Ties: for equal costs the lowest removed vertex goes first, then the lowest remaining one. Time O(n log n)
//! expected, plus the samples of the tested stars. Memory: some hundred bytes per sample.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::grid::{HeightGrid, PackedSample};
use crate::mesh::check_surface;
use crate::method::{BaselineMethod, MethodPromise};
use crate::plane::TrianglePlane;
use crate::result::BaselineTin;
use crate::settings::{BaselineTask, SurfaceSize};
use crate::star::{FullMesh, is_free};
use terrane_base::error::Result;
use terrane_base::geom::predicates::orient;

pub(crate) const COLLAPSE: BaselineMethod = BaselineMethod {
    name: "collapse",
    about: "edge collapse to one of the end points, by quadric error",
    source: "Garland & Heckbert 1997",
    time: "O(n log n), expected",
    memory: "the grid, a mesh of all samples, and a heap of its edges",
    promise: MethodPromise::Samples,
    takes_triangulation: false,
    is_delaunay: false,
    takes_budget: true,
    sample_bytes: 600,
    run,
};

fn run(task: &BaselineTask<'_>) -> Result<BaselineTin> {
    let mut collapsing = CollapsingMesh::new(task)?;
    collapsing.run()?;
    Ok(BaselineTin::of_mesh(&task.grid, &collapsing.full.mesh))
}

/// A sum of squared vertical distances from planes, as the upper half of a symmetric matrix for (x, y, z, 1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Quadric([f64; 10]);

impl Quadric {
    /// Quadric of the plane through three corners, weighted by twice its area.
    fn of_plane(grid: &HeightGrid<'_>, corners: [PackedSample; 3]) -> Self {
        let [a, b, c] = corners.map(PackedSample::lattice);
        let [x, y, z] = corners.map(|corner| grid.vertex(corner));
        let area = orient(a, b, c) as f64;
        let slopes = [0, 1].map(|axis| {
            let [ab, ac] = [b, c].map(|to| f64::from(to[axis] - a[axis]));
            (ac * (y - x) - ab * (z - x)) / area
        });
        // z = across * x + down * y + rest
        let (across, down) = (slopes[1], -slopes[0]);
        let rest = x - across * f64::from(a[0]) - down * f64::from(a[1]);
        Self::outer([across, down, -1.0, rest]).times(area)
    }

    fn outer(n: [f64; 4]) -> Self {
        let [a, b, c, d] = n;
        Self([a * a, a * b, a * c, a * d, b * b, b * c, b * d, c * c, c * d, d * d])
    }

    fn times(self, factor: f64) -> Self {
        Self(self.0.map(|part| part * factor))
    }

    fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }

    /// The sum at a vertex.
    fn at(self, grid: &HeightGrid<'_>, vertex: PackedSample) -> f64 {
        let [x, y] = vertex.lattice().map(f64::from);
        let Self(place) = Self::outer([x, y, grid.vertex(vertex), 1.0]);
        let twice = [1.0, 2.0, 2.0, 2.0, 1.0, 2.0, 2.0, 1.0, 2.0, 1.0];
        let sum: f64 = (0..10).map(|i| twice[i] * self.0[i] * place[i]).sum();
        // Rounding may leave a sum below zero.
        sum.max(0.0)
    }
}

/// A collapse of an edge; the order is that of costs, and for equal costs that of vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct EdgeCollapse {
    /// Bits of the cost: costs are not negative, so bits have their order.
    cost: u64,
    removed: PackedSample,
    remaining: PackedSample,
    /// Stamp of the star of the removed vertex.
    stamp: u32,
}

/// A mesh during simplification.
struct CollapsingMesh<'a> {
    task: &'a BaselineTask<'a>,
    full: FullMesh,
    heap: BinaryHeap<Reverse<EdgeCollapse>>,
    /// By sample: its quadric, and the number of changes of its star.
    quadrics: Vec<Quadric>,
    stamps: Vec<u32>,
}

impl<'a> CollapsingMesh<'a> {
    fn new(task: &'a BaselineTask<'a>) -> Result<Self> {
        let grid = &task.grid;
        check_surface(grid)?;
        let full = FullMesh::new(grid);
        let mut quadrics = vec![Quadric::default(); grid.len()];
        for corners in full.mesh.surface().map(|id| full.mesh.tris[id as usize].corners) {
            let quadric = Quadric::of_plane(grid, corners);
            for index in corners.map(|corner| grid.index(corner)) {
                quadrics[index] = quadrics[index].plus(quadric);
            }
        }
        let stamps = vec![0; grid.len()];
        let mut new = Self { task, full, heap: BinaryHeap::new(), quadrics, stamps };
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
            let Some(Reverse(next)) = self.heap.pop() else {
                return size.check(self.task.goal);
            };
            if self.stamps[self.task.grid.index(next.removed)] == next.stamp {
                self.collapse(next.removed, next.remaining, &mut size);
            }
        }
        Ok(())
    }

    /// Collapses an edge unless that inverts a triangle or leaves a sample beyond the tolerance.
    fn collapse(&mut self, removed: PackedSample, remaining: PackedSample, size: &mut SurfaceSize) {
        let grid = &self.task.grid;
        let star = self.full.star(grid, removed);
        let Some(filling) = star.fan(remaining).filter(|filling| self.is_allowed(filling)) else {
            return;
        };
        size.shrink(&star, &filling);
        self.full.refill(grid, &star, &filling);
        let [from, to] = [removed, remaining].map(|vertex| grid.index(vertex));
        self.quadrics[to] = self.quadrics[to].plus(self.quadrics[from]);
        self.stamps[from] += 1;
        self.weigh(remaining);
        // The quadric of the remaining vertex changed, and so do the costs of its neighbours.
        for link in self.full.star(grid, remaining).ring {
            self.weigh(link.from);
        }
    }

    fn is_allowed(&self, filling: &[[PackedSample; 3]]) -> bool {
        filling.iter().all(|&corners| {
            let plane = TrianglePlane::new(&self.task.grid, corners);
            !plane.offsets().any(|(_, offset)| self.task.forbids(&offset))
        })
    }

    /// Queues the collapses of a vertex into its neighbours. Invalidates existing entries.
    fn weigh(&mut self, vertex: PackedSample) {
        let grid = &self.task.grid;
        let index = grid.index(vertex);
        self.stamps[index] += 1;
        if !is_free(grid, vertex) {
            return;
        }
        for link in self.full.star(grid, vertex).ring {
            let both = self.quadrics[index].plus(self.quadrics[grid.index(link.from)]);
            self.heap.push(Reverse(EdgeCollapse {
                cost: both.at(grid, link.from).to_bits(),
                removed: vertex,
                remaining: link.from,
                stamp: self.stamps[index],
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::BaselineGoal;
    use crate::tests::{grids, tolerances};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn in_the_end_no_edge_can_collapse(heights in grids(), tolerance in tolerances()) {
            let grid = heights.grid();
            prop_assume!(check_surface(&grid).is_ok());
            let task = BaselineTask::new(grid, BaselineGoal::MaxError(tolerance));
            let mut collapsing = CollapsingMesh::new(&task).unwrap();
            collapsing.run().unwrap();
            collapsing.full.mesh.validate();
            let tin = BaselineTin::of_mesh(&grid, &collapsing.full.mesh);
            for &vertex in tin.vertices.iter().filter(|at| is_free(&grid, **at)) {
                let star = collapsing.full.star(&grid, vertex);
                for link in &star.ring {
                    let allowed = star.fan(link.from).filter(|f| collapsing.is_allowed(f));
                    prop_assert!(allowed.is_none(), "{:?} can go", vertex);
                }
            }
        }

        #[test]
        fn a_quadric_is_the_square_of_the_vertical_distance(
            z in prop::collection::vec(-9.0_f64..9.0, 36)
        ) {
            let grid = HeightGrid::new(6, 6, &z, None).unwrap();
            let corners = [PackedSample::new(0, 1), PackedSample::new(5, 2), PackedSample::new(1, 4)];
            let quadric = Quadric::of_plane(&grid, corners);
            for (at, offset) in TrianglePlane::new(&grid, corners).offsets() {
                let expected = 14.0 * offset.error().powi(2);
                prop_assert!((quadric.at(&grid, at) - expected).abs() < 1e-9);
            }
        }
    }
}
