//! Features as a coverage: their parts are cut into arcs where they meet, arcs are simplified once
//! and untangled, and parts are put together again.

use std::path::Path;

use super::Collected;
use crate::error::{Error, ErrorKind, Result};
use crate::line::arcs::{self, Arcs, Parts};
use crate::line::topology::{
    Chains, Collapse, Kept as Chosen, Options, Outcome, refining, untangle,
};
use crate::line::{Metric, Scratch, Xy};
use crate::pipeline::Cancel;
use crate::pipeline::line::part::{check, chosen};
use crate::pipeline::line::tool::{Rule, Task, Tool, Vertex};
use crate::pipeline::line::{LineReport, Topology};
use crate::vector::{self, Kept, OpenOptions};

/// The parts of all features, flat, in their order.
#[derive(Default)]
struct Flat {
    points: Vec<Xy>,
    /// Heights; empty where no distance asks for them.
    z: Vec<f64>,
    starts: Vec<usize>,
    closed: Vec<bool>,
}

impl Flat {
    fn of(all: &[Collected], rule: &Rule) -> Result<Self> {
        let mut flat = Self { starts: vec![0], ..Self::default() };
        let has_z = rule.measure == crate::pipeline::line::Measure::Space;
        for feature in all.iter().flat_map(|collected| &collected.features) {
            for part in feature.geometry.parts() {
                check(&part, rule.measure)?;
                flat.points.extend_from_slice(part.xy);
                if has_z {
                    flat.z.extend_from_slice(part.z);
                }
                flat.starts.push(flat.points.len());
                flat.closed.push(part.is_ring());
            }
        }
        Ok(flat)
    }

    fn chains(&self) -> Chains<'_> {
        Chains { points: &self.points, starts: &self.starts, closed: &self.closed }
    }
}

/// Simplifies the parts of all features in place, together.
pub(super) fn simplify(
    all: &mut [Collected],
    topology: &Topology,
    sides: &[Xy],
    rule: &Rule,
    report: &mut LineReport,
    cancel: &Cancel,
) -> Result<()> {
    let mut flat = Flat::of(all, rule)?;
    if topology.snap > 0.0 {
        arcs::snap(&mut flat.points, topology.snap)?;
        let mut moved = flat.points.iter().copied();
        let features = all.iter_mut().flat_map(|collected| &mut collected.features);
        features.for_each(|feature| feature.geometry.place_parts(&mut moved));
    }
    cancel.check()?;
    let arcs = Arcs::new(&flat.chains(), 0.0)?;
    report.arcs = arcs.closed.len() as u64;
    let made = rule.apply(Together { arcs, flat: &flat, topology, sides, rule })?;
    report.refined = made.outcome.refined;
    report.input_crossings = made.outcome.input_crossings;
    report.collapsed = made.outcome.collapsed;
    report.largest_distance = made.square.sqrt();
    report.parts = flat.closed.len() as u64;
    report.vertices = flat.points.len() as u64;
    cancel.check()?;
    let (mut part, mut lost) = (0, false);
    for feature in all.iter_mut().flat_map(|collected| &mut collected.features) {
        report.features += 1;
        feature.geometry = feature.geometry.keep(|_, _| {
            let own = flat.starts[part]..flat.starts[part + 1];
            let left = &made.parts.vertices[made.parts.starts[part]..made.parts.starts[part + 1]];
            let place = |vertex: &u32| made.arcs.points[*vertex as usize];
            let points = &flat.points[own];
            let kept = match left.is_empty() && rule.collapse != Collapse::Drop {
                // It had no area to begin with.
                true => Some(Kept::All),
                false => own_vertices(points, flat.closed[part], left.iter().map(place)),
            };
            part += 1;
            lost |= kept.is_none();
            kept.unwrap_or(Kept::All)
        });
        report.kept += feature.geometry.parts().map(|part| part.xy.len() as u64).sum::<u64>();
    }
    match lost {
        true => Err(Error::new(ErrorKind::Internal, "a part lost its way through its arcs")),
        false => Ok(()),
    }
}

/// What a part keeps of its own vertices, to pass through `left` in order; all of it, where it has no
/// area of its own. `None` when there is no such way.
fn own_vertices(own: &[Xy], is_ring: bool, left: impl Iterator<Item = Xy> + Clone) -> Option<Kept> {
    let Some(first) = left.clone().next() else { return Some(Kept::Nothing) };
    let starts = (0..own.len()).filter(|at| own[*at] == first);
    // A ring may come by its first vertex again, on another way.
    let mut found = starts.filter_map(|start| passing(own, is_ring, start, left.clone()));
    let kept = found.next()?;
    let is_flat = match kept.iter().map(|at| own[*at as usize]).collect::<Vec<_>>()[..] {
        [a, b, c] => a == b || b == c || a == c,
        ref all => all.len() < 3,
    };
    Some(if is_ring && is_flat { Kept::All } else { chosen(&kept) })
}

/// The vertices of a part, from number `start` on and of a ring once around, that lie at `left` one
/// after the other.
fn passing(
    own: &[Xy],
    is_ring: bool,
    start: usize,
    left: impl Iterator<Item = Xy>,
) -> Option<Vec<u32>> {
    let count = own.len() - usize::from(is_ring);
    let round = if is_ring { start..start + count + 1 } else { start..count };
    let mut ahead = round.map(|at| at % count.max(1));
    let find = |at: Xy| ahead.find(|own_at| own[*own_at] == at).map(|found| found as u32);
    let mut kept = left.map(find).collect::<Option<Vec<u32>>>()?;
    if is_ring && kept.len() > 1 && kept.first() == kept.last() {
        kept.pop();
    }
    kept.sort_unstable();
    Some(kept)
}

/// Arcs to be simplified together.
struct Together<'a> {
    arcs: Arcs,
    flat: &'a Flat,
    topology: &'a Topology,
    sides: &'a [Xy],
    rule: &'a Rule,
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
        let options = Options { strategy: self.topology.strategy, collapse: self.rule.collapse };
        let chains = self.arcs.chains();
        let outcome =
            untangle(&chains, &kept, self.sides, &options, &mut refining(&vertices, run))?;
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
        let (mut points, mut kept) = (Vec::new(), Vec::new());
        for arc in 0..self.arcs.closed.len() {
            let range = self.arcs.starts[arc]..self.arcs.starts[arc + 1];
            points.clear();
            points.extend(range.clone().map(|vertex| self.vertex::<V>(vertex)));
            kept.clear();
            match self.arcs.free[arc] && points.len() > 3 {
                false => tool.open(&points, scratch, &mut kept),
                true => {
                    if tool.whole_ring(&points, scratch, &mut kept) {
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

    fn vertex<V: Vertex>(&self, vertex: usize) -> V {
        let source = self.arcs.sources[vertex] as usize;
        V::of(self.arcs.points[vertex], self.flat.z.get(source).copied().unwrap_or(0.0))
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

/// The points of a file, wherever they are in it.
pub(in crate::pipeline) fn positions(path: &Path, options: &OpenOptions) -> Result<Vec<Xy>> {
    let mut source = vector::open(path, options)?;
    let mut all = Vec::new();
    while let Some(feature) = source.next()? {
        let points = feature.geometry.leaves().filter(|leaf| leaf.kind().is_points());
        points.for_each(|leaf| all.extend_from_slice(&leaf.coordinates().xy));
    }
    Ok(all)
}
