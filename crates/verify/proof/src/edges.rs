//! Topology of triangles: vertices by position, edges by the vertices they join.

use std::mem::size_of;

use super::breaklines::BreaklineCheck;
use super::exact::{double_area, in_circle};
use super::part::GridProofPart;
use super::required_vertices::RequiredVertexCheck;
use super::sections::{ceil, floor, is_whole};
use super::surface::{OutlineFollowing, OutlineRun, ProofSurface};
use super::surface_error::BreakJudge;
use super::totals::ProofTally;
use super::triangle::{ProofPosition, ProofTriangle, ProofVertex};

/// Bytes of the tables below for one triangle.
pub(crate) const BYTES_PER_TRIANGLE: usize = 3
    * (size_of::<(ProofPosition, u32)>()
        + size_of::<EdgeUse>()
        + size_of::<u32>()
        + size_of::<ProofPosition>());

/// An edge of one triangle only, on the outline of the surface as far as it has been followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnpairedEdge {
    /// The part that remains to be followed.
    pub rest: OutlineRun,
    /// Where the edge begins.
    pub at: ProofPosition,
}

/// Triangles of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EdgeMeeting {
    /// One triangle, with this opposite corner.
    Open(ProofPosition),
    /// Two that pass it in opposite directions, with these opposite corners.
    Inner([ProofPosition; 2]),
    /// More than two, or two that pass it in the same direction.
    Tangled,
}

/// One side of one triangle: the vertices it joins (the smaller number in the high half), then
/// the triangle and the corner it starts at. Vertices are numbered in the order of their positions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeUse {
    ends: u64,
    side: u32,
}

impl EdgeUse {
    fn new(a: u32, b: u32, side: u32) -> Self {
        Self { ends: u64::from(a.min(b)) << 32 | u64::from(a.max(b)), side }
    }

    /// The smaller and the larger vertex number.
    pub(crate) fn numbers(self) -> [u32; 2] {
        [(self.ends >> 32) as u32, self.ends as u32]
    }

    /// Heights of the two ends as its triangle has them, the lower position first.
    pub(crate) fn heights(self, triangles: &[ProofTriangle]) -> [f64; 2] {
        let (triangle, corner) = (&triangles[self.side as usize / 3], self.side as usize % 3);
        let [a, b] = [corner, (corner + 1) % 3].map(|corner| triangle.corners[corner]);
        if a.at < b.at { [a.z, b.z] } else { [b.z, a.z] }
    }
}

/// The corners of a part's triangles as numbered vertices.
#[derive(Debug, Default)]
pub(crate) struct PartCorners {
    /// Distinct positions, sorted.
    pub(crate) positions: Vec<ProofPosition>,
    /// Vertex numbers, three for each triangle.
    numbers: Vec<u32>,
}

/// A sample as a key of half the size, in the same order.
fn sample_key(at: ProofPosition) -> u64 {
    // With the sign bit flipped, unsigned numbers are ordered as the signed ones are.
    let [row, col] = [at.row, at.col].map(|v| u64::from((floor(v) as i32 ^ i32::MIN) as u32));
    row << 32 | col
}

/// A corner by its number: three for each triangle, in order. A list of all would take more memory than is counted.
#[inline]
fn corner(triangles: &[ProofTriangle], number: u32) -> ProofVertex {
    triangles[number as usize / 3].corners[number as usize % 3]
}

impl PartCorners {
    /// Numbers the corners of `triangles`; calls `meet` with each position and the heights of all corners
    /// there.
    pub(crate) fn new(
        triangles: &[ProofTriangle],
        meet: impl FnMut(ProofPosition, &[f64]),
    ) -> Self {
        // Samples, the rule, sort twice as fast by a short key.
        if triangles.iter().all(ProofTriangle::is_lattice) {
            Self::sorted(triangles, sample_key, meet)
        } else {
            Self::sorted(triangles, |at| at, meet)
        }
    }

    fn sorted<K: Ord + Copy>(
        triangles: &[ProofTriangle],
        key: impl Fn(ProofPosition) -> K,
        mut meet: impl FnMut(ProofPosition, &[f64]),
    ) -> Self {
        let all = triangles.iter().flat_map(|t| t.corners);
        let mut order: Vec<(K, u32)> = all.map(|c| key(c.at)).zip(0..).collect();
        order.sort_unstable_by_key(|&(key, _)| key);
        let mut corners = Self { positions: Vec::new(), numbers: vec![0; order.len()] };
        let mut heights = Vec::new();
        for group in order.chunk_by(|a, b| a.0 == b.0) {
            let number = corners.positions.len() as u32;
            let at = corner(triangles, group[0].1).at;
            corners.positions.push(at);
            heights.clear();
            for &(_, place) in group {
                corners.numbers[place as usize] = number;
                heights.push(corner(triangles, place).z);
            }
            meet(at, &heights);
        }
        corners
    }

    fn position(&self, number: u32) -> ProofPosition {
        self.positions[number as usize]
    }

    /// All sides of all triangles, sorted by the vertices they join.
    fn uses(&self) -> Vec<EdgeUse> {
        let mut uses = Vec::with_capacity(self.numbers.len());
        for (triangle, corners) in self.numbers.chunks_exact(3).enumerate() {
            for corner in 0..3 {
                let (a, b) = (corners[corner], corners[(corner + 1) % 3]);
                // A triangle with two corners at one position has a side without length, which joins nothing.
                if a != b {
                    let side = (triangle * 3 + corner) as u32;
                    uses.push(EdgeUse::new(a, b, side));
                }
            }
        }
        uses.sort_unstable_by_key(|u| u.ends);
        uses
    }

    /// True when the side runs from the smaller vertex number to the larger.
    fn is_forward(&self, side: EdgeUse) -> bool {
        self.numbers[side.side as usize] == side.numbers()[0]
    }

    /// Calls `each` with every edge: its ends, the lower first, how triangles meet there, and their sides.
    pub(crate) fn each_edge(
        &self,
        mut each: impl FnMut([ProofPosition; 2], EdgeMeeting, &[EdgeUse]),
    ) {
        for uses in self.uses().chunk_by(|a, b| a.ends == b.ends) {
            let meeting = match *uses {
                [one] => EdgeMeeting::Open(self.apex(one)),
                [a, b] if self.is_forward(a) != self.is_forward(b) => {
                    EdgeMeeting::Inner([self.apex(a), self.apex(b)])
                }
                _ => EdgeMeeting::Tangled,
            };
            each(uses[0].numbers().map(|number| self.position(number)), meeting, uses);
        }
    }

    /// The corner opposite a side.
    fn apex(&self, side: EdgeUse) -> ProofPosition {
        let (triangle, corner) = (side.side / 3, side.side % 3);
        self.position(self.numbers[(triangle * 3 + (corner + 2) % 3) as usize])
    }
}

/// Judges the edges and vertices that `part` owns. Returns open edges to follow further.
pub(crate) fn check(
    part: &GridProofPart<'_>,
    surface: &ProofSurface,
    tally: &mut ProofTally,
) -> Vec<UnpairedEdge> {
    let (mut between, mut kept) = (BreakJudge::new(part, surface), RequiredVertexCheck::new(part));
    let mut follow = BreaklineCheck::new(part.lines, &part.domain, surface);
    let corners = PartCorners::new(part.triangles, |at, heights| {
        if part.domain.owns(at) {
            check_corner(part, surface, at, heights, tally);
            between.corner(at, heights, tally);
            kept.corner(at, heights);
            follow.corner(at);
        }
    });
    kept.finish(surface, tally);
    compare_vertices(part.vertices.unwrap_or_default(), &corners.positions, tally);
    let mut open = Vec::new();
    let mut unfinished = Vec::new();
    corners.each_edge(|ends, meeting, sides| {
        between.edge(ends, sides.iter().map(|side| side.heights(part.triangles)), tally);
        follow.edge(ends);
        if matches!(meeting, EdgeMeeting::Open(_)) {
            open.push(ends);
        }
        if !part.domain.owns(ends[0]) {
            return;
        }
        tally.edge(ends, meeting);
        if matches!(meeting, EdgeMeeting::Open(_)) {
            unfinished.extend(check_open(ends, surface, tally));
        }
    });
    follow.finish(tally);
    t_junctions(part, &corners.positions, &open, tally);
    unfinished
}

/// Counts a position with several heights, and one off the samples.
fn check_corner(
    part: &GridProofPart<'_>,
    surface: &ProofSurface,
    at: ProofPosition,
    heights: &[f64],
    tally: &mut ProofTally,
) {
    if heights.iter().any(|&z| z != heights[0]) {
        tally.split_heights.add(at);
    }
    if !heights.iter().all(|&z| part.is_sample(at, z, surface)) {
        tally.off_samples.add(at);
    }
}

impl ProofTally {
    /// Counts an open edge that leaves the outline of the surface.
    pub fn crack(&mut self, open: &UnpairedEdge) {
        self.cracks.add(open.at);
    }

    /// Counts an edge by how its triangles meet.
    pub(crate) fn edge(&mut self, ends: [ProofPosition; 2], meeting: EdgeMeeting) {
        match meeting {
            EdgeMeeting::Open(_) => self.open_edges += 1,
            EdgeMeeting::Inner([a, b]) => {
                self.interior_edges += 1;
                if is_bad(ends, a, b) {
                    self.non_delaunay.add(ends[0]);
                }
            }
            EdgeMeeting::Tangled => self.non_manifold.add(ends[0]),
        }
    }
}

/// True when the edge of two triangles, one on each side, fails the Delaunay test. Does not depend on the
/// order of the two.
fn is_bad([p, q]: [ProofPosition; 2], a: ProofPosition, b: ProofPosition) -> bool {
    let (low, high) = (a.min(b), a.max(b));
    let sides = [low, high].map(|apex| double_area(p, q, apex).signum());
    sides[0] * sides[1] < 0 && in_circle(p, q, low, high)
}

/// Follows an open edge as far as the window reaches.
fn check_open(
    ends: [ProofPosition; 2],
    surface: &ProofSurface,
    tally: &mut ProofTally,
) -> Option<UnpairedEdge> {
    let followed = lattice_run(ends).map_or(OutlineFollowing::Off, |run| surface.follow(run));
    match followed {
        OutlineFollowing::On => None,
        OutlineFollowing::Off => {
            tally.cracks.add(ends[0]);
            None
        }
        OutlineFollowing::Rest(rest) => Some(UnpairedEdge { rest, at: ends[0] }),
    }
}

/// The unit edges under an edge; `None` unless it lies on a line of the lattice.
fn lattice_run([p, q]: [ProofPosition; 2]) -> Option<OutlineRun> {
    let (vertical, line, a, b) = if p.row == q.row && is_whole(p.row) {
        (false, p.row, p.col, q.col)
    } else if p.col == q.col && is_whole(p.col) {
        (true, p.col, p.row, q.row)
    } else {
        return None;
    };
    Some(OutlineRun { vertical, line: floor(line), from: floor(a.min(b)), to: ceil(a.max(b)) })
}

/// Counts `stored` vertices (sorted) that share a position, or that no triangle uses.
pub(crate) fn compare_vertices(
    stored: &[ProofPosition],
    used: &[ProofPosition],
    tally: &mut ProofTally,
) {
    let mut used = used.iter().copied().peekable();
    for group in stored.chunk_by(|a, b| a == b) {
        let at = group[0];
        for _ in 1..group.len() {
            tally.duplicates.add(at);
        }
        while used.next_if(|&u| u < at).is_some() {}
        if used.peek() != Some(&at) {
            group.iter().for_each(|&at| tally.unused.add(at));
        }
    }
}

/// Counts the owned vertices strictly inside an open edge.
fn t_junctions(
    part: &GridProofPart<'_>,
    vertices: &[ProofPosition],
    open: &[[ProofPosition; 2]],
    tally: &mut ProofTally,
) {
    let free: Vec<ProofPosition> = vertices.iter().copied().filter(|v| !v.is_sample()).collect();
    let mut hit = Vec::new();
    for &[p, q] in open {
        let candidates = between(vertices, p, q);
        match lattice_steps(p, q) {
            // Few samples on the edge, or many vertices around it: look each sample up.
            Some(steps) if steps - 1 <= candidates.len() as u64 => {
                let samples = samples_inside(p, q, steps as i64);
                hit.extend(samples.filter(|at| candidates.binary_search(at).is_ok()));
                hit.extend(collinear(between(&free, p, q), p, q));
            }
            _ => hit.extend(collinear(candidates, p, q)),
        }
    }
    hit.sort_unstable();
    hit.dedup();
    hit.into_iter().filter(|&at| part.domain.owns(at)).for_each(|at| tally.t_junctions.add(at));
}

/// The sorted `vertices` after `p` and before `q` (`p < q`).
fn between(vertices: &[ProofPosition], p: ProofPosition, q: ProofPosition) -> &[ProofPosition] {
    let from = vertices.partition_point(|&v| v <= p);
    let count = vertices[from..].partition_point(|&v| v < q);
    &vertices[from..from + count]
}

fn collinear(
    vertices: &[ProofPosition],
    p: ProofPosition,
    q: ProofPosition,
) -> impl Iterator<Item = ProofPosition> {
    vertices.iter().copied().filter(move |&v| double_area(p, q, v) == 0)
}

/// The number of parts into which samples divide an edge; `None` unless its ends are samples.
fn lattice_steps(p: ProofPosition, q: ProofPosition) -> Option<u64> {
    let [cols, rows] = [q.col - p.col, q.row - p.row].map(|d| floor(d).unsigned_abs());
    (p.is_sample() && q.is_sample()).then(|| gcd(cols, rows))
}

/// The samples that divide the edge into `steps` parts.
fn samples_inside(
    p: ProofPosition,
    q: ProofPosition,
    steps: i64,
) -> impl Iterator<Item = ProofPosition> {
    let step = [(q.col - p.col) / steps, (q.row - p.row) / steps];
    (1..steps).map(move |k| ProofPosition { row: p.row + k * step[1], col: p.col + k * step[0] })
}

fn gcd(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}
