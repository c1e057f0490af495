//! Edge collapse: all samples are vertices, and edges are drawn together into one of their ends, the cheapest
//! first, while no sample is further off than the tolerance and no triangle is turned over.
//!
//! Source: Garland & Heckbert, "Surface simplification using quadric error metrics" (1997), with half-edge
//! collapses, so that vertices stay samples. The quadrics are sums of squared *vertical* distances from the
//! planes of the first triangles, weighted by area: so the unit of the heights does not matter. They only say
//! what goes first; whether it may go is decided by all samples of the star.
//!
//! Ties: of equal costs the lowest vertex to go, then the lowest to stay. Time O(n log n) expected, and the
//! samples of the stars that are looked at. Memory: some hundred bytes a sample.

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
        let slope = |axis: usize| {
            let d = |from: [i32; 2], to: [i32; 2]| f64::from(to[axis] - from[axis]);
            (d(a, c) * (y - x) - d(a, b) * (z - x)) / area
        };
        // z = across * x + down * y + rest
        let (across, down) = (slope(1), -slope(0));
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
        // What rounding leaves below zero is nothing.
        sum.max(0.0)
    }
}

/// A collapse: its cost, by its bits, who goes, who stays, and the stamp of the star of who goes.
type Collapse = Reverse<(u64, PackedSample, PackedSample, u32)>;

/// A mesh that gets coarser.
struct CollapsingMesh<'a> {
    task: &'a BaselineTask<'a>,
    full: FullMesh,
    heap: BinaryHeap<Collapse>,
    /// By sample: its quadric, and how often its star has changed.
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
            let Some(Reverse((_, gone, kept, stamp))) = self.heap.pop() else {
                return size.check(self.task.goal);
            };
            if self.stamps[self.task.grid.index(gone)] == stamp {
                self.collapse(gone, kept, &mut size);
            }
        }
        Ok(())
    }

    /// Draws an edge together, if no triangle is turned over and no sample is too far off then.
    fn collapse(&mut self, gone: PackedSample, kept: PackedSample, size: &mut SurfaceSize) {
        let grid = &self.task.grid;
        let star = self.full.star(grid, gone);
        let Some(filling) = star.fan(kept).filter(|filling| self.is_allowed(filling)) else {
            return;
        };
        size.shrink(&star, &filling);
        self.full.refill(grid, &star, &filling);
        let [from, to] = [gone, kept].map(|vertex| grid.index(vertex));
        self.quadrics[to] = self.quadrics[to].plus(self.quadrics[from]);
        self.stamps[from] += 1;
        self.weigh(kept);
        // All of the ring are neighbours of the one that stays, which costs more now.
        for link in self.full.star(grid, kept).ring {
            self.weigh(link.from);
        }
    }

    fn is_allowed(&self, filling: &[[PackedSample; 3]]) -> bool {
        filling.iter().all(|&corners| {
            let plane = TrianglePlane::new(&self.task.grid, corners);
            !plane.offsets().any(|(_, offset)| self.task.forbids(&offset))
        })
    }

    /// Puts the collapses into the neighbours of a vertex into the heap. Invalidates existing entries.
    fn weigh(&mut self, vertex: PackedSample) {
        let grid = &self.task.grid;
        let index = grid.index(vertex);
        self.stamps[index] += 1;
        if !is_free(grid, vertex) {
            return;
        }
        for link in self.full.star(grid, vertex).ring {
            let both = self.quadrics[index].plus(self.quadrics[grid.index(link.from)]);
            let cost = both.at(grid, link.from).to_bits();
            self.heap.push(Reverse((cost, vertex, link.from, self.stamps[index])));
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
