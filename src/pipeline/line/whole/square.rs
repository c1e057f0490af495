//! A square: its runs are cut into arcs where they meet, arcs are simplified once and untangled
//! among the segments that come by, and what is left is found in the runs again.

use super::kept::Bits;
use super::own::own_vertices;
use crate::error::{Error, ErrorKind, Result};
use crate::line::arcs::{Arcs, Parts};
use crate::line::topology::{
    Chains, Collapse, Kept as Chosen, Options, Outcome, PIECE_BYTES, PIECES, Strategy, refining,
    untangle_within,
};
use crate::line::{Metric, Scratch, Xy};
use crate::pipeline::line::tool::{Rule, Task, Tool, Vertex};
use crate::vector::Kept;

/// Lines and rings, flat.
#[derive(Debug)]
pub(super) struct Flat {
    pub(super) points: Vec<Xy>,
    /// Heights; empty where no distance asks for them.
    pub(super) z: Vec<f64>,
    starts: Vec<usize>,
    pub(super) closed: Vec<bool>,
}

impl Default for Flat {
    fn default() -> Self {
        Self { points: Vec::new(), z: Vec::new(), starts: vec![0], closed: Vec::new() }
    }
}

impl Flat {
    /// Ends a part of `count` vertices.
    pub(super) fn end_part(&mut self, count: usize, is_ring: bool) {
        self.starts.push(self.starts[self.closed.len()] + count);
        self.closed.push(is_ring);
    }

    fn chains(&self) -> Chains<'_> {
        Chains { points: &self.points, starts: &self.starts, closed: &self.closed }
    }
}

/// What a square holds.
#[derive(Debug, Default)]
pub(super) struct World {
    /// Runs of parts, some of which are whole parts.
    pub(super) flat: Flat,
    /// Numbers of those that go on in other squares: both of their ends stay.
    pub(super) cut: Vec<u32>,
    /// Numbers of those of which all vertices stay.
    pub(super) whole: Vec<u32>,
    /// Segments that cross over, once each.
    pub(super) obstacles: Vec<[Xy; 2]>,
    /// Points that stay on their side.
    pub(super) sides: Vec<Xy>,
}

/// What became of it.
#[derive(Debug, Default)]
pub(super) struct Solved {
    /// The vertices that are kept.
    pub(super) bits: Bits,
    pub(super) arcs: u64,
    pub(super) refined: u64,
    pub(super) collapsed: u64,
    /// Pairs of segments that meet in the input and still do, but for pairs of obstacles.
    pub(super) crossings: u64,
    /// Pairs of obstacles that meet.
    pub(super) meeting: Vec<[[Xy; 2]; 2]>,
    /// The largest squared distance.
    pub(super) square: f64,
}

/// Bytes for each vertex of a square that is worked on, beside what becomes of those that are kept: itself,
/// its arc, and the vertex in its metric.
pub(super) const VERTEX: u64 = 112;
/// Bytes for each vertex where all of them are kept.
pub(super) const KEPT_VERTEX: u64 = VERTEX + PIECES * PIECE_BYTES;

/// Simplifies what a square holds, in `room` bytes; fails where that is too little.
pub(super) fn solve(world: &World, strategy: Strategy, rule: &Rule, room: u64) -> Result<Solved> {
    let mut arcs = Arcs::new(&world.flat.chains(), 0.0)?;
    let own = arcs.closed.len();
    for segment in &world.obstacles {
        arcs.points.extend(segment);
        // Without heights: nothing of it is left out.
        arcs.sources.extend([0, 0]);
        arcs.starts.push(arcs.points.len());
        arcs.closed.push(false);
        arcs.free.push(false);
    }
    let left = room.saturating_sub(VERTEX * world.flat.points.len() as u64);
    let pieces = usize::try_from(left / PIECE_BYTES).unwrap_or(usize::MAX);
    let made = rule.apply(Together { arcs, world, strategy, rule, pieces })?;
    let first = made.arcs.starts[own] as u32;
    let is_pair = |pair: &&[u32; 2]| pair.iter().all(|from| *from >= first);
    let segment = |from: u32| world.obstacles[(from - first) as usize / 2];
    let crossings = &made.outcome.crossings;
    let meeting: Vec<_> = crossings.iter().filter(is_pair).map(|pair| pair.map(segment)).collect();
    Ok(Solved {
        bits: own_bits(world, &made, rule)?,
        arcs: own as u64,
        refined: made.outcome.refined,
        collapsed: made.outcome.collapsed,
        crossings: (crossings.len() - meeting.len()) as u64,
        meeting,
        square: made.square,
    })
}

/// The kept vertices of all runs.
fn own_bits(world: &World, made: &Made, rule: &Rule) -> Result<Bits> {
    let flat = &world.flat;
    let mut bits = Bits::new(flat.points.len());
    for run in 0..flat.closed.len() {
        let points = &flat.points[flat.starts[run]..flat.starts[run + 1]];
        let left = &made.parts.vertices[made.parts.starts[run]..made.parts.starts[run + 1]];
        let place = |vertex: &u32| made.arcs.points[*vertex as usize];
        let kept = match left.is_empty() {
            // Vertices that arcs leave out, too: those that repeat the one before them.
            _ if rule.keeps_everything() => Some(Kept::All),
            // It has no area to begin with.
            true if rule.collapse != Collapse::Drop => Some(Kept::All),
            true if world.cut.binary_search(&(run as u32)).is_ok() => {
                Some(Kept::Vertices(vec![0, points.len() as u32 - 1]))
            }
            _ => own_vertices(points, flat.closed[run], left.iter().map(place)),
        };
        let lost = || Error::new(ErrorKind::Internal, "a part lost its way through its arcs");
        bits.add(&kept.ok_or_else(lost)?, flat.starts[run], points.len());
    }
    Ok(bits)
}

/// Arcs to be simplified together.
struct Together<'a> {
    arcs: Arcs,
    world: &'a World,
    strategy: Strategy,
    rule: &'a Rule,
    /// Most pieces that there is room for.
    pieces: usize,
}

/// What became of them.
struct Made {
    arcs: Arcs,
    parts: Parts,
    outcome: Outcome,
    /// The largest squared distance.
    square: f64,
}

impl Task for Together<'_> {
    type Output = Result<Made>;

    fn run<V: Vertex, M: Metric<V> + Copy>(mut self, tool: &Tool<V, M>) -> Result<Made> {
        let mut scratch = Scratch::default();
        let kept = self.plain(tool, &mut scratch);
        let vertices = self.vertices::<V>();
        let run = |part: &[V], kept: &mut Vec<u32>| tool.line(part, &mut scratch, kept);
        let options = Options { strategy: self.strategy, collapse: self.rule.collapse };
        let (chains, sides) = (self.arcs.chains(), &self.world.sides);
        let refine = &mut refining(&vertices, run);
        let outcome = untangle_within(&chains, &kept, sides, &options, self.pieces, refine)?;
        let parts = self.arcs.rebuild(&outcome.kept);
        let square = largest(tool, &vertices, &outcome.kept);
        Ok(Made { arcs: self.arcs, parts, outcome, square })
    }
}

impl Together<'_> {
    /// What the method keeps of each arc by itself. Rings without a junction are opened at a vertex that
    /// is kept; of one that collapsed it is only that vertex.
    fn plain<V: Vertex, M: Metric<V> + Copy>(
        &mut self,
        tool: &Tool<V, M>,
        scratch: &mut Scratch,
    ) -> Chosen {
        let mut all = Chosen::new();
        let whole = self.whole();
        let (mut points, mut kept) = (Vec::new(), Vec::new());
        for arc in 0..self.arcs.closed.len() {
            let range = self.arcs.starts[arc]..self.arcs.starts[arc + 1];
            points.clear();
            points.extend(range.clone().map(|vertex| self.vertex::<V>(vertex)));
            kept.clear();
            match self.arcs.free[arc] && points.len() > 3 && !self.rule.keeps_everything() {
                false if self.rule.keeps_everything() => kept.extend(0..points.len() as u32),
                false if whole.binary_search(&arc).is_ok() => kept.extend(0..points.len() as u32),
                false => tool.open(&points, &mut tool.method(), scratch, &mut kept),
                true => {
                    if tool.whole_ring(&points, &mut tool.method(), scratch, &mut kept) {
                        kept.truncate(1);
                    }
                    let at = kept.first().copied().unwrap_or(0);
                    self.arcs.open_at(arc, at as usize);
                    kept.iter_mut().for_each(|vertex| *vertex -= at);
                    kept.push(points.len() as u32 - 1);
                }
            }
            all.vertices.extend(kept.iter().map(|vertex| vertex + range.start as u32));
            all.close();
        }
        all
    }

    /// The arcs of runs that stay whole, ascending.
    fn whole(&self) -> Vec<usize> {
        let runs = self.world.whole.iter().map(|run| *run as usize);
        let passages = runs.map(|run| self.arcs.parts[run]..self.arcs.parts[run + 1]);
        let mut arcs: Vec<_> = passages.flatten().map(|at| self.arcs.passages[at].arc()).collect();
        arcs.sort_unstable();
        arcs.dedup();
        arcs
    }

    fn vertex<V: Vertex>(&self, vertex: usize) -> V {
        let source = self.arcs.sources[vertex] as usize;
        V::of(self.arcs.points[vertex], self.world.flat.z.get(source).copied().unwrap_or(0.0))
    }

    fn vertices<V: Vertex>(&self) -> Vec<V> {
        (0..self.arcs.points.len()).map(|vertex| self.vertex(vertex)).collect()
    }
}

/// The largest squared distance of what was left out of chains that are still there.
fn largest<V: Vertex, M: Metric<V> + Copy>(tool: &Tool<V, M>, points: &[V], kept: &Chosen) -> f64 {
    let chains = kept.starts.windows(2).map(|ends| &kept.vertices[ends[0]..ends[1]]);
    chains.map(|chain| tool.largest(points, chain)).fold(0.0, f64::max)
}
