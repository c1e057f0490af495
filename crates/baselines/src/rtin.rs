//! Right-triangulated irregular networks: a square is cut into two right triangles, and triangles are bisected
//! recursively at the midpoint of the longest side.
//!
//! Source: Evans, Kirkpatrick & Townsend, "Right-triangulated irregular networks" (1998; Algorithmica 2001);
//! the dependencies that keep it free of cracks as in Lindstrom et al., "Real-time, continuous level of detail
//! rendering of height fields" (1996): a triangle and its neighbour across the longest side are cut together, after
//! their parents.
//!
//! A triangle is cut if any sample in it is beyond the tolerance: the true error. Many programs test only the
//! midpoint of the longest side, which costs one subtraction and does not bound the error of other samples.
//!
//! Sides are powers of two. Other grids lie in a corner of the next larger square, whose remainder is void.
//! Triangles partly on the surface are cut, so outlines consist of small triangles (half a cell at least). Time
//! O(n log n), memory a bit per sample of the square, beside the mesh.

use crate::grid::PackedSample;
use crate::mesh::check_surface;
use crate::method::{BaselineMethod, MethodPromise};
use crate::plane::TrianglePlane;
use crate::result::BaselineTin;
use crate::settings::BaselineTask;
use crate::surface::{SurfaceCellSums, SurfaceCoverage};
use terrane_base::bits::BitSet;
use terrane_base::error::Result;

pub(crate) const RTIN: BaselineMethod = BaselineMethod {
    name: "rtin",
    about: "right-triangulated irregular network: triangles halved where a sample exceeds the error",
    source: "Evans, Kirkpatrick & Townsend 1998",
    time: "O(n log n)",
    memory: "the grid, the mesh, and a bit for each sample of the square around it",
    promise: MethodPromise::Samples,
    takes_triangulation: false,
    is_delaunay: false,
    takes_budget: false,
    sample_bytes: 140,
    run,
};

fn run(task: &BaselineTask<'_>) -> Result<BaselineTin> {
    check_surface(&task.grid)?;
    let mut tree = RtinHierarchy::new(task);
    let roots = tree.roots();
    // From the finest level up: a cut requires cuts of the triangles that contain it.
    for level in (0..tree.levels).rev() {
        roots.iter().try_for_each(|&root| tree.mark(root, level))?;
    }
    let mut triangles = Vec::new();
    roots.iter().for_each(|&root| tree.collect(root, &mut triangles));
    Ok(BaselineTin::of_triangles(&task.grid, triangles))
}

/// A right triangle: the ends of its longest side and the opposite corner, counter-clockwise.
#[derive(Clone, Copy, Debug)]
struct RightTriangle {
    corners: [[u32; 2]; 3],
    /// Number of halvings of the square.
    level: u32,
}

impl RightTriangle {
    /// The middle of the longest side.
    fn middle(self) -> [u32; 2] {
        let [a, b, _] = self.corners;
        [u32::midpoint(a[0], b[0]), u32::midpoint(a[1], b[1])]
    }

    fn halves(self) -> [Self; 2] {
        let (middle, [a, b, c]) = (self.middle(), self.corners);
        [[c, a, middle], [b, c, middle]].map(|corners| Self { corners, level: self.level + 1 })
    }

    fn sampled(self) -> [PackedSample; 3] {
        self.corners.map(|[col, row]| PackedSample::new(col, row))
    }
}

/// The hierarchy over a square, and the midpoints at which it is cut.
struct RtinHierarchy<'a> {
    task: &'a BaselineTask<'a>,
    cells: SurfaceCellSums,
    /// Cells along a side.
    side: u32,
    /// Maximum number of halvings of the square.
    levels: u32,
    cut: BitSet,
}

impl<'a> RtinHierarchy<'a> {
    fn new(task: &'a BaselineTask<'a>) -> Self {
        let side = (task.grid.width().max(task.grid.height()) - 1).next_power_of_two();
        let cut = BitSet::new((side as usize + 1).pow(2));
        Self { task, cells: SurfaceCellSums::new(&task.grid), side, levels: 2 * side.ilog2(), cut }
    }

    fn roots(&self) -> [RightTriangle; 2] {
        let [a, b] = [[0, 0], [self.side, 0]];
        let [c, d] = [[self.side, self.side], [0, self.side]];
        [[c, a, b], [a, c, d]].map(|corners| RightTriangle { corners, level: 0 })
    }

    /// Bit index of the midpoint of a triangle's longest side.
    fn bit(&self, triangle: RightTriangle) -> usize {
        let [col, row] = triangle.middle();
        row as usize * (self.side as usize + 1) + col as usize
    }

    fn is_cut(&self, triangle: RightTriangle) -> bool {
        triangle.level < self.levels && self.cut.contains(self.bit(triangle))
    }

    /// Coverage of the bounding box of a triangle.
    fn extent_around(&self, triangle: RightTriangle) -> SurfaceCoverage {
        let [cols, rows] = [0, 1].map(|axis| {
            let [a, b, c] = triangle.corners.map(|corner| corner[axis]);
            [a.min(b).min(c), a.max(b).max(c)]
        });
        self.cells.extent([cols[0], rows[0]], [cols[1], rows[1]])
    }

    fn extent(&self, triangle: RightTriangle) -> SurfaceCoverage {
        match self.extent_around(triangle) {
            SurfaceCoverage::Partly => {
                let [first, second] = triangle.halves().map(|half| self.extent(half));
                if first == second { first } else { SurfaceCoverage::Partly }
            }
            extent => extent,
        }
    }

    /// Marks cuts of triangles of a level within this one; deeper levels are marked already.
    fn mark(&mut self, triangle: RightTriangle, level: u32) -> Result<()> {
        (self.task.pulse)()?;
        if self.extent_around(triangle) == SurfaceCoverage::Outside {
            return Ok(());
        }
        if triangle.level < level {
            return triangle.halves().into_iter().try_for_each(|half| self.mark(half, level));
        }
        if self.must_cut(triangle) {
            self.cut.insert(self.bit(triangle));
        }
        Ok(())
    }

    fn must_cut(&self, triangle: RightTriangle) -> bool {
        match self.extent(triangle) {
            SurfaceCoverage::Outside => false,
            SurfaceCoverage::Partly => true,
            SurfaceCoverage::Inside => {
                let plane = TrianglePlane::new(&self.task.grid, triangle.sampled());
                triangle.halves().into_iter().any(|half| self.is_cut(half))
                    || plane.offsets().any(|(_, offset)| self.task.exceeds(&offset))
            }
        }
    }

    /// The uncut triangles that belong to the surface.
    fn collect(&self, triangle: RightTriangle, triangles: &mut Vec<[PackedSample; 3]>) {
        if self.is_cut(triangle) {
            triangle.halves().into_iter().for_each(|half| self.collect(half, triangles));
        } else if self.extent(triangle) == SurfaceCoverage::Inside {
            triangles.push(triangle.sampled());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::HeightGrid;
    use crate::settings::BaselineGoal;

    #[test]
    fn a_plane_is_two_triangles_on_a_square_of_a_power_of_two_and_more_elsewhere() {
        for (width, height, triangles) in [(9, 9, 2), (2, 2, 2), (9, 5, 3)] {
            let heights: Vec<f64> = (0..width * height)
                .map(|i| f64::from(3 * (i % width)) - f64::from(i / width))
                .collect();
            let grid = HeightGrid::new(width, height, &heights, None).unwrap();
            let tin = run(&BaselineTask::new(grid, BaselineGoal::MaxError(0.0))).unwrap();
            assert_eq!(tin.triangles.len(), triangles, "{width} x {height}");
        }
    }

    #[test]
    fn what_the_middle_alone_does_not_see_is_seen() {
        // The middles of all longest sides of the first levels are flat; a sample between is not.
        let mut heights = vec![0.0; 81];
        heights[9 + 3] = 5.0;
        let grid = HeightGrid::new(9, 9, &heights, None).unwrap();
        let tin = run(&BaselineTask::new(grid, BaselineGoal::MaxError(1.0))).unwrap();
        assert!(tin.max_error <= 1.0 && tin.vertices.contains(&PackedSample::new(3, 1)));
    }
}
