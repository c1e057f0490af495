//! Breaklines: paths of samples along which mesh edges run.
//!
//! The *path* of a segment consists of samples from one end to the other, each a step along a row or a column from the
//! previous one, at most 0.71 cells from the straight segment. The promise: from each vertex on a path an edge leads to
//! a later one, so that edges run along the whole path. The implementation joins neighbouring vertices on a path.
//!
//! Where an edge is missing, a sample in the middle of that part of the path becomes a vertex (a conforming
//! triangulation, as in Edelsbrunner & Tan 1993). The mesh stays Delaunay, tiles and seams are unchanged, and crossing
//! lines share a vertex. The insertion terminates because a step of a path is an edge of every Delaunay triangulation
//! that has both samples: its diametral circle contains no other. A path does not depend on the direction of its
//! segment, so that borders may be shared.

use super::angles::{WalkEnd, walk};
use super::heights::HeightField;
use super::lattice_position::TilePosition;
use super::mesh::{LatticeMesh, TriangleScanState};
use terrane_base::bits::BitSet;
use terrane_base::geom::SampleSegment;

/// A part of a segment's path whose samples all lie in a tile or patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PathStretch {
    segment: SampleSegment,
    first: u64,
    last: u64,
}

impl PathStretch {
    /// The part of a segment in a rectangle of samples; positions are relative to its first sample.
    pub fn of(segment: SampleSegment, width: u32, height: u32) -> Option<Self> {
        let high = [width, height].map(|count| i64::from(count) - 1);
        let steps = segment.within([0, 0], high)?;
        Some(Self { segment, first: *steps.start(), last: *steps.end() })
    }

    /// The samples, in order.
    pub fn samples(&self) -> impl Iterator<Item = TilePosition> + '_ {
        (self.first..=self.last).map(|step| self.at(step))
    }

    fn at(&self, step: u64) -> TilePosition {
        let [col, row] = self.segment.at(step);
        TilePosition::new(col as u32, row as u32)
    }

    /// The samples that must be vertices if the rectangle is a tile, the same for all tiles that share them: ends of
    /// the segment, and positions where the path enters or leaves a side of the tile.
    pub fn ends(&self, width: u32, height: u32) -> impl Iterator<Item = TilePosition> + '_ {
        let high = [width, height].map(|count| i64::from(count) - 1);
        let ends = (self.first..=self.last).filter(move |&step| self.is_end(step, high));
        ends.map(|step| self.at(step))
    }

    /// True at an end of the segment, and where the path enters or leaves a side of the tile up to `high`.
    fn is_end(&self, step: u64, high: [i64; 2]) -> bool {
        if step == 0 || step == self.segment.steps() {
            return true;
        }
        let [before, at, after] = [step - 1, step, step + 1].map(|step| self.segment.at(step));
        [0, 1].into_iter().any(|axis| {
            let on_side = at[axis] == 0 || at[axis] == high[axis];
            let runs_along = before[axis] == at[axis] && after[axis] == at[axis];
            on_side && !runs_along
        })
    }
}

/// Mesh edges from samples on paths.
#[derive(Debug, Default)]
pub(super) struct PathEdges {
    /// Samples on paths, and the vertices among them.
    on: BitSet,
    vertices: BitSet,
    width: usize,
    /// Sorted.
    all: Vec<PathEdge>,
}

/// A half-edge that begins on a path. Fields are in the order of sorting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct PathEdge {
    from: TilePosition,
    to: TilePosition,
    half_edge: u32,
}

/// Two neighbouring vertices on a path without a common edge.
#[derive(Clone, Copy, Debug)]
struct PathGap<'a> {
    line: &'a PathStretch,
    steps: [u64; 2],
}

impl PathGap<'_> {
    /// The samples between the two, the middle one first.
    fn samples(&self) -> impl Iterator<Item = TilePosition> + '_ {
        let [from, to] = self.steps;
        let middle = from.midpoint(to);
        let apart = (0..=to - middle).flat_map(move |off| [middle + off, middle.wrapping_sub(off)]);
        apart.filter(move |step| (from + 1..to).contains(step)).map(|step| self.line.at(step))
    }
}

/// Inserts samples until vertices on paths are joined, as far as possible; a sample in a triangle is inserted if `may`
/// allows it. After each round `settle` restores the other promises of the mesh. Returns the number of gaps that must
/// stay. Each round is linear in the triangles and the samples of paths.
pub(super) fn follow(
    lines: &[PathStretch],
    field: &HeightField,
    mesh: &mut LatticeMesh,
    edges: &mut PathEdges,
    may: impl Fn(&LatticeMesh, u32, TilePosition) -> bool,
    mut settle: impl FnMut(&mut LatticeMesh),
) -> u64 {
    let (mut star, mut gaps) = (Vec::new(), Vec::new());
    loop {
        edges.find(lines, field, mesh);
        gaps.clear();
        lines.iter().for_each(|line| edges.gaps(line, &mut gaps));
        let (mut is_done, mut left) = (true, 0);
        for gap in &gaps {
            let located = gap.samples().filter_map(|at| Some((edges.holder(gap, at, mesh)?, at)));
            let mut located = located.peekable();
            let is_on_surface = located.peek().is_some();
            match located.find(|&(holder, at)| may(mesh, holder, at)) {
                Some((holder, at)) => {
                    star.clear();
                    is_done &= !mesh.insert(holder, at, &mut star);
                }
                None => left += u64::from(is_on_surface),
            }
        }
        if is_done {
            return left;
        }
        settle(mesh);
    }
}

/// Appends the vertices of a mesh that are on paths.
pub(super) fn vertices(
    lines: &[PathStretch],
    field: &HeightField,
    mesh: &LatticeMesh,
    edges: &mut PathEdges,
    out: &mut Vec<TilePosition>,
) {
    edges.find(lines, field, mesh);
    out.extend(edges.all.chunk_by(|a, b| a.from == b.from).map(|edges| edges[0].from));
}

impl PathEdges {
    /// Maximum bytes for a tile or patch of `samples` samples.
    pub(super) fn bytes(samples: u64) -> u64 {
        // Six begin at a vertex.
        samples * (6 * size_of::<PathEdge>() as u64 + 1)
    }

    /// Lists the edges of the surface that begin on a path.
    fn find(&mut self, lines: &[PathStretch], field: &HeightField, mesh: &LatticeMesh) {
        self.all.clear();
        if lines.is_empty() {
            return;
        }
        self.width = field.width() as usize;
        let samples = self.width * field.height() as usize;
        self.on.reset(samples);
        self.vertices.reset(samples);
        for p in lines.iter().flat_map(PathStretch::samples) {
            self.on.insert(self.index(p));
        }
        for id in
            mesh.ids().filter(|&id| mesh.tris[id as usize].state != TriangleScanState::Outside)
        {
            for half_edge in 4 * id..4 * id + 3 {
                let from = mesh.origin(half_edge);
                if self.on.contains(self.index(from)) {
                    self.vertices.insert(self.index(from));
                    self.all.push(PathEdge { from, to: mesh.end(half_edge), half_edge });
                }
            }
        }
        self.all.sort_unstable();
    }

    fn index(&self, p: TilePosition) -> usize {
        p.row() as usize * self.width + p.col() as usize
    }

    /// The half-edges from a sample: none if it is not a vertex.
    fn from(&self, from: TilePosition) -> impl Iterator<Item = u32> + '_ {
        let first = self.all.partition_point(|edge| edge.from < from);
        let edges = self.all[first..].iter().take_while(move |edge| edge.from == from);
        edges.map(|edge| edge.half_edge)
    }

    /// The triangle that contains a sample in a gap, if it is visible from a triangle at the gap's ends; near voids and
    /// borders not all of them see it.
    fn holder(&self, gap: &PathGap<'_>, at: TilePosition, mesh: &LatticeMesh) -> Option<u32> {
        let ends = gap.steps.map(|step| gap.line.at(step));
        ends.into_iter().flat_map(|end| self.from(end)).find_map(|half_edge| {
            match walk(mesh, half_edge >> 2, at.lattice()) {
                WalkEnd::Triangle(holder) => Some(holder),
                WalkEnd::Border(_) => None,
            }
        })
    }

    /// True if an edge joins two samples.
    fn joins(&self, from: TilePosition, to: TilePosition) -> bool {
        // An edge of the border has one half-edge.
        self.has(from, to) || self.has(to, from)
    }

    fn has(&self, from: TilePosition, to: TilePosition) -> bool {
        self.all.binary_search_by_key(&(from, to), |edge| (edge.from, edge.to)).is_ok()
    }

    /// Appends the gaps of a stretch. Single steps are never gaps: if both samples are vertices, they are joined by an
    /// edge.
    fn gaps<'a>(&self, line: &'a PathStretch, gaps: &mut Vec<PathGap<'a>>) {
        let steps = (line.first..).zip(line.samples());
        let vertices = steps.filter(|&(_, at)| self.vertices.contains(self.index(at)));
        let mut vertices = vertices.peekable();
        while let (Some((step, at)), Some(&(next, to))) = (vertices.next(), vertices.peek()) {
            if next > step + 1 && !self.joins(at, to) {
                gaps.push(PathGap { line, steps: [step, next] });
            }
        }
    }
}

/// True if an edge leads on along a path from a vertex, false if it is missing.
///
/// `fan` lists the triangles around the vertex, each by its two other corners in counter-clockwise order. Returns
/// `None` if the path ends there, or leaves the surface.
pub fn goes_on(segment: &SampleSegment, step: u64, fan: &[[[i64; 2]; 2]]) -> Option<bool> {
    if step == segment.steps() {
        return None;
    }
    let [at, next] = [step, step + 1].map(|step| segment.at(step));
    if !fan.iter().any(|&[a, b]| turn(at, a, next) >= 0 && turn(at, next, b) >= 0) {
        return None;
    }
    let mut later_steps = fan.iter().flatten().filter_map(|end| segment.step_of(*end));
    Some(later_steps.any(|to| to > step))
}

/// Twice the signed area of a triangle.
pub(super) fn turn(a: [i64; 2], b: [i64; 2], c: [i64; 2]) -> i128 {
    let [u, v] = [b, c].map(|p| [0, 1].map(|axis| i128::from(p[axis] - a[axis])));
    u[0] * v[1] - u[1] * v[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn end() -> impl Strategy<Value = [i64; 2]> {
        [-40..40_i64, -40..40_i64]
    }

    proptest! {
        /// Each sample of a path is one of the two beside which the straight segment passes the diagonal of its step.
        #[test]
        fn a_path_is_steps_along_its_segment_the_same_both_ways(a in end(), b in end()) {
            let segment = SampleSegment::new(a, b);
            prop_assert_eq!(segment, SampleSegment::new(b, a));
            let all: Vec<_> = (0..=segment.steps()).map(|step| segment.at(step)).collect();
            let mut ends = [all[0], all[all.len() - 1]];
            ends.sort_unstable();
            let mut expected = [a, b];
            expected.sort_unstable();
            prop_assert_eq!(ends, expected);
            for (step, pair) in (0..).zip(all.windows(2)) {
                prop_assert_eq!(pair[0][0].abs_diff(pair[1][0]) + pair[0][1].abs_diff(pair[1][1]), 1);
                prop_assert_eq!(segment.step_of(pair[0]), Some(step));
            }
            let [dx, dy] = [0, 1].map(|axis| (b[axis] - a[axis]) as f64);
            let length = dx.hypot(dy);
            for p in all {
                let off = (p[0] - a[0]) as f64 * dy - (p[1] - a[1]) as f64 * dx;
                prop_assert!(length == 0.0 || off.abs() / length <= 0.5_f64.sqrt() + 1e-9, "{:?}", p);
            }
            prop_assert_eq!(segment.step_of([a[0] + 1000, a[1]]), None);
        }

        /// Its twin looks at every step.
        #[test]
        fn a_rectangle_has_a_part_of_a_path(
            a in end(), b in end(), low in end(), size in [0..50_i64, 0..50_i64]
        ) {
            let segment = SampleSegment::new(a, b);
            let high = [low[0] + size[0], low[1] + size[1]];
            let inside = |at: [i64; 2]| (0..2).all(|axis| (low[axis]..=high[axis]).contains(&at[axis]));
            let expected: Vec<u64> =
                (0..=segment.steps()).filter(|&step| inside(segment.at(step))).collect();
            let found: Vec<u64> = segment.within(low, high).into_iter().flatten().collect();
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn a_line_goes_on_where_an_edge_ends_further_along_its_path() {
        // Along a row: 0, 1, 2, 3.
        let segment = SampleSegment::new([0, 0], [3, 0]);
        let fan = |far: [i64; 2]| [[[1, -1], far], [far, [1, 1]]];
        assert_eq!(goes_on(&segment, 0, &fan([3, 0])), Some(true));
        assert_eq!(goes_on(&segment, 0, &fan([2, 0])), Some(true));
        assert_eq!(goes_on(&segment, 0, &fan([4, 0])), Some(false), "beyond its end");
        assert_eq!(goes_on(&segment, 0, &fan([2, 1])), Some(false));
        // No triangle where it would go on; only behind.
        assert_eq!(goes_on(&segment, 0, &[[[0, 1], [-1, 0]], [[-1, 0], [0, -1]]]), None);
        assert_eq!(goes_on(&segment, 3, &fan([5, 0])), None);
        assert_eq!(goes_on(&segment, 2, &[[[2, 1], [1, 0]]]), None);
    }
}
