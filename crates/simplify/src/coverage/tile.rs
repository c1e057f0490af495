//! A tile: its runs are cut into arcs where they meet, arcs are simplified once and untangled among the passing
//! segments, and the result is mapped back to the runs.
//!
//! Kept vertices are mapped back to each part's own vertices step by step along its arcs: attributes, heights
//! and measures never come from a neighbour, and a vertex that a part passes twice is mapped correctly. A
//! closed arc keeps its orientation by itself; a ring of several arcs that has changed orientation, which is
//! possible if it touches or crosses itself, is kept whole, and its tile is processed again.

use super::gaps::MeetingGaps;
use super::{kept_bits, own_ring};
use crate::feature::chosen;
use crate::tool::{MetricTask, MetricTool, MetricVertex, SimplifyRule};
use terrane_base::bits::BitSet;
use terrane_base::error::Result;
use terrane_base::geom::plane::key;
use terrane_engine::Cancel;
use terrane_line::arcs::CoverageArcs;
use terrane_line::topology::{
    Chains, PIECE_BYTES, PIECES, RetainedChainVertices, Strategy, UntangleOptions, UntangledChains,
    refining, round, untangle_within,
};
use terrane_line::{DistanceMetric, SimplifyScratch, Xy};
use terrane_vector::{self as vector, RetainedVertices};

/// Largest number of recorded pairs of segments that meet.
pub(super) const MAX_PAIRS: usize = 1 << 16;

/// Lines and rings in flat arrays.
#[derive(Debug)]
pub(super) struct FlatChains {
    pub(super) points: Vec<Xy>,
    /// Heights; empty if distances do not use them.
    pub(super) z: Vec<f64>,
    starts: Vec<usize>,
    pub(super) closed: Vec<bool>,
}

impl Default for FlatChains {
    fn default() -> Self {
        Self { points: Vec::new(), z: Vec::new(), starts: vec![0], closed: Vec::new() }
    }
}

impl FlatChains {
    /// Ends a part of `count` vertices.
    pub(super) fn end_part(&mut self, count: usize, is_ring: bool) {
        self.starts.push(self.starts[self.closed.len()] + count);
        self.closed.push(is_ring);
    }

    fn chains(&self) -> Chains<'_> {
        Chains { points: &self.points, starts: &self.starts, closed: &self.closed }
    }

    fn part(&self, part: usize) -> &[Xy] {
        &self.points[self.starts[part]..self.starts[part + 1]]
    }
}

/// Contents of a tile.
#[derive(Debug, Default)]
pub(super) struct TileContent {
    /// Runs of parts, or whole parts.
    pub(super) flat: FlatChains,
    /// Runs that continue in other tiles: both of their ends stay.
    pub(super) cut: Vec<u32>,
    /// Runs of which all vertices stay.
    pub(super) whole: Vec<u32>,
    /// Segments that cross tile borders, once each.
    pub(super) obstacles: Vec<[Xy; 2]>,
    /// Points that keep their side.
    pub(super) sides: Vec<Xy>,
}

/// Result of a tile.
#[derive(Debug, Default)]
pub(super) struct SolvedTile {
    /// Kept vertices.
    pub(super) bits: BitSet,
    /// Rounded vertices; empty without rounding.
    pub(super) rounded: BitSet,
    /// Number of vertices that could not be rounded.
    pub(super) unrounded: u64,
    pub(super) arcs: u64,
    pub(super) refined: u64,
    pub(super) collapsed: u64,
    /// Pairs of segments that meet in the input and in the output, without pairs of obstacles.
    pub(super) crossings: u64,
    /// The first of these pairs.
    pub(super) pairs: Vec<[[Xy; 2]; 2]>,
    /// Distances of their ends.
    pub(super) gaps: MeetingGaps,
    /// Pairs of obstacles that meet.
    pub(super) meeting: Vec<[[Xy; 2]; 2]>,
    /// Largest squared distance.
    pub(super) distance2: f64,
}

/// Memory in bytes per vertex of a tile in progress without kept vertices: the vertex, its arc, and the vertex
/// in its metric.
pub(super) const VERTEX: u64 = 112;
/// Memory in bytes per vertex if all are kept.
pub(super) const KEPT_VERTEX: u64 = VERTEX + PIECES * PIECE_BYTES;

/// Rounding of kept vertices.
pub(super) struct TileRounding<'a> {
    /// Decimals.
    pub(super) decimals: u8,
    /// Whether a position is in the tile: vertices do not leave it.
    pub(super) holds: &'a dyn Fn(Xy) -> bool,
}

impl TileRounding<'_> {
    fn position(&self, at: Xy) -> Xy {
        at.map(|c| vector::rounded(c, self.decimals))
    }
}

/// Settings for a tile.
pub(super) struct TileSettings<'a> {
    pub(super) strategy: Strategy,
    pub(super) rule: &'a SimplifyRule,
    pub(super) rounding: Option<TileRounding<'a>>,
}

/// Simplifies the contents of a tile. A ring of several arcs that changes orientation keeps all vertices, and
/// the tile is processed again. Fails if `memory` bytes are too few.
pub(super) fn solve(
    content: &TileContent,
    how: &TileSettings<'_>,
    memory: u64,
    cancel: &Cancel,
) -> Result<SolvedTile> {
    let &TileSettings { strategy, rule, .. } = how;
    let left = memory.saturating_sub(VERTEX * content.flat.points.len() as u64);
    let pieces = usize::try_from(left / PIECE_BYTES).unwrap_or(usize::MAX);
    let mut whole = content.whole.clone();
    loop {
        cancel.check()?;
        let arcs = with_obstacles(content)?;
        let made = rule.apply(SharedArcs {
            arcs,
            content,
            whole: &whole,
            strategy,
            rule,
            pieces,
            cancel,
        })?;
        let mut solved = made.solved(content);
        let spoiled = made.own_bits(content, &whole, rule, &mut solved.bits);
        if spoiled.is_empty() {
            if let Some(rounding) = &how.rounding {
                made.round(content, rounding, &mut solved, cancel)?;
            }
            return Ok(solved);
        }
        // A ring that is whole is never spoiled: each round leaves more of them, so that the loop ends.
        whole.extend(spoiled);
        whole.sort_unstable();
    }
}

/// The arcs of all runs, and each obstacle as one more.
fn with_obstacles(content: &TileContent) -> Result<CoverageArcs> {
    let mut arcs = CoverageArcs::new(&content.flat.chains(), 0.0)?;
    for segment in &content.obstacles {
        arcs.points.extend(segment);
        // Heights are not needed: obstacles are never simplified.
        arcs.sources.extend([0, 0]);
        arcs.starts.push(arcs.points.len());
        arcs.closed.push(false);
        arcs.free.push(false);
    }
    Ok(arcs)
}

/// Arcs simplified together.
struct SharedArcs<'a> {
    arcs: CoverageArcs,
    content: &'a TileContent,
    /// Runs of which all vertices stay, ascending.
    whole: &'a [u32],
    strategy: Strategy,
    rule: &'a SimplifyRule,
    /// Largest number of pieces that fit in memory.
    pieces: usize,
    cancel: &'a Cancel,
}

/// Result of the arcs.
struct TileOutcome {
    arcs: CoverageArcs,
    outcome: UntangledChains,
    /// Largest squared distance.
    distance2: f64,
}

impl TileOutcome {
    /// Statistics.
    fn solved(&self, content: &TileContent) -> SolvedTile {
        let own = self.arcs.closed.len() - content.obstacles.len();
        let first = self.arcs.starts[own] as u32;
        let mut solved = SolvedTile {
            arcs: own as u64,
            refined: self.outcome.refined,
            collapsed: self.outcome.collapsed,
            distance2: self.distance2,
            ..SolvedTile::default()
        };
        for pair in &self.outcome.crossings {
            let segments = pair.map(|from| [0, 1].map(|k| self.arcs.points[from as usize + k]));
            if pair.iter().all(|from| *from >= first) {
                solved.meeting.push(segments);
                continue;
            }
            solved.crossings += 1;
            solved.gaps.add(segments);
            if solved.pairs.len() < MAX_PAIRS {
                solved.pairs.push(segments);
            }
        }
        solved
    }

    /// Sets the bits of kept vertices of all runs; returns rings that have to stay whole but were simplified.
    fn own_bits(
        &self,
        content: &TileContent,
        whole: &[u32],
        rule: &SimplifyRule,
        bits: &mut BitSet,
    ) -> Vec<u32> {
        let flat = &content.flat;
        *bits = BitSet::new(flat.points.len());
        let (mut left, mut spoiled) = (Vec::new(), Vec::new());
        for run in 0..flat.closed.len() {
            let (points, is_ring) = (flat.part(run), flat.closed[run]);
            self.arcs.own(run, points, is_ring, &self.outcome.kept, &mut left);
            let kept = match is_ring {
                // Includes consecutive duplicates, which arcs omit.
                _ if rule.keeps_everything() => Some(RetainedVertices::All),
                true if whole.binary_search(&(run as u32)).is_ok() => Some(RetainedVertices::All),
                true => own_ring::ring(points, &left, rule.collapse),
                false => Some(chosen(&left)),
            };
            match kept {
                Some(kept) => kept_bits::add(bits, &kept, flat.starts[run], points.len()),
                None => spoiled.push(run as u32),
            }
        }
        spoiled
    }
}

impl TileOutcome {
    /// Sets the bits of rounded vertices. Ends of segments that cross tile borders are not rounded.
    fn round(
        &self,
        content: &TileContent,
        rounding: &TileRounding<'_>,
        solved: &mut SolvedTile,
        cancel: &Cancel,
    ) -> Result<()> {
        let mut fixed: Vec<_> =
            content.obstacles.as_flattened().iter().map(|at| key(*at)).collect();
        fixed.sort_unstable();
        let (arcs, kept) = (self.arcs.chains(), &self.outcome.kept);
        let rounded = round(
            &arcs,
            kept,
            &content.sides,
            |at| {
                let to = rounding.position(at);
                // A position in another tile could meet segments that this tile does not know.
                let stays = !(rounding.holds)(to) || fixed.binary_search(&key(at)).is_ok();
                if stays { at } else { to }
            },
            Some(cancel),
        )?;
        solved.rounded = BitSet::new(content.flat.points.len());
        for (run, is_ring) in content.flat.closed.iter().enumerate() {
            let own = content.flat.starts[run]..content.flat.starts[run + 1];
            let last = own.end - 1;
            for vertex in own.filter(|vertex| solved.bits.contains(*vertex)) {
                let at = content.flat.points[vertex];
                let is_rounded = rounded.of(at) == rounding.position(at);
                if is_rounded {
                    solved.rounded.insert(vertex);
                }
                let is_again = *is_ring && vertex == last;
                solved.unrounded += u64::from(!is_rounded && !is_again);
            }
        }
        Ok(())
    }
}

impl MetricTask for SharedArcs<'_> {
    type Output = Result<TileOutcome>;

    fn run<V: MetricVertex, M: DistanceMetric<V> + Copy>(
        mut self,
        tool: &MetricTool<V, M>,
    ) -> Result<TileOutcome> {
        let mut scratch = SimplifyScratch::default();
        let kept = self.plain(tool, &mut scratch);
        let vertices = self.vertices::<V>();
        let loops = self.loops();
        let SimplifyRule { collapse, .. } = *self.rule;
        let options = UntangleOptions {
            strategy: self.strategy,
            collapse,
            loops: &loops,
            cancel: Some(self.cancel),
        };
        let (chains, sides) = (self.arcs.chains(), &self.content.sides);
        let refine = &mut refining(&vertices, |line, kept| tool.line(line, &mut scratch, kept));
        let outcome = untangle_within(&chains, &kept, sides, &options, self.pieces, refine)?;
        let distance2 = largest(tool, &vertices, &outcome.kept);
        Ok(TileOutcome { arcs: self.arcs, outcome, distance2 })
    }
}

impl SharedArcs<'_> {
    /// Vertices of each arc kept by the method. Rings without a junction are opened at a kept vertex; a
    /// collapsed ring keeps that vertex only.
    fn plain<V: MetricVertex, M: DistanceMetric<V> + Copy>(
        &mut self,
        tool: &MetricTool<V, M>,
        scratch: &mut SimplifyScratch,
    ) -> RetainedChainVertices {
        let mut all = RetainedChainVertices::new();
        let whole = self.whole();
        let (mut points, mut kept) = (Vec::new(), Vec::new());
        for arc in 0..self.arcs.closed.len() {
            let range = self.arcs.starts[arc]..self.arcs.starts[arc + 1];
            points.clear();
            points.extend(range.clone().map(|vertex| self.vertex::<V>(vertex)));
            kept.clear();
            match self.arcs.free[arc] {
                _ if self.rule.keeps_everything() => kept.extend(0..points.len() as u32),
                _ if whole.binary_search(&arc).is_ok() => kept.extend(0..points.len() as u32),
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

    /// Arcs of runs that stay whole, ascending.
    fn whole(&self) -> Vec<usize> {
        let mut arcs: Vec<_> =
            self.whole.iter().flat_map(|run| self.arcs_of(*run as usize)).collect();
        arcs.sort_unstable();
        arcs.dedup();
        arcs
    }

    /// Arcs of a run.
    fn arcs_of(&self, run: usize) -> impl Iterator<Item = usize> {
        let passages = self.arcs.parts[run]..self.arcs.parts[run + 1];
        self.arcs.passages[passages].iter().map(|passage| passage.arc())
    }

    /// Arcs that are loops of a run: of a line, or of a ring that touches itself.
    fn loops(&self) -> Vec<bool> {
        let mut loops = vec![false; self.arcs.closed.len()];
        for (run, is_ring) in self.content.flat.closed.iter().enumerate() {
            let first = self.arcs_of(run).next();
            if !is_ring || self.arcs_of(run).any(|arc| Some(arc) != first) {
                self.arcs_of(run).for_each(|arc| loops[arc] = true);
            }
        }
        loops
    }

    fn vertex<V: MetricVertex>(&self, vertex: usize) -> V {
        let source = self.arcs.sources[vertex] as usize;
        V::of(self.arcs.points[vertex], self.content.flat.z.get(source).copied().unwrap_or(0.0))
    }

    fn vertices<V: MetricVertex>(&self) -> Vec<V> {
        (0..self.arcs.points.len()).map(|vertex| self.vertex(vertex)).collect()
    }
}

/// Largest squared distance of omitted vertices of the remaining chains.
fn largest<V: MetricVertex, M: DistanceMetric<V> + Copy>(
    tool: &MetricTool<V, M>,
    points: &[V],
    kept: &RetainedChainVertices,
) -> f64 {
    let chains = kept.starts.windows(2).map(|ends| &kept.vertices[ends[0]..ends[1]]);
    chains.map(|chain| tool.largest(points, chain)).fold(0.0, f64::max)
}
