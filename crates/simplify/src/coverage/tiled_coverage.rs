//! Features as a coverage, tile by tile: data larger than memory is first sorted into tiles, and the result is
//! assembled when the features are read again.
//!
//! Up to `SQUARE` (2^20) vertices are one tile. For larger inputs a first pass counts vertices in the cells of
//! a grid, a quadtree is divided until every tile is below the limit, and each part is cut into runs where a
//! segment crosses from one tile to another. The result of a tile is one bit per vertex, in input order:
//! features are read again, each part is cut again, takes the next bits of its tiles, and is written. Features
//! are held in memory if they fit, otherwise they are read again: the output is the same, because tiles depend
//! on vertices only.
//!
//! For rings with self-intersections the sign of the area is checked before output; a ring that has changed
//! orientation is kept whole, and its tiles are processed again. The same applies to an outer ring that would
//! be dropped while one of its holes remains. Such rings do not collapse either: under any policy they keep the
//! vertices at tile borders that they cross.
//!
//! **Why segments that cross tile borders stay**, and are not simplified in a second round along the borders: a
//! second round would need tiles around the borders, and a third tiles around their corners. Vertices at
//! borders are few: of the coastlines' 10.6 million vertices, 893 more are kept than without tiles, beside 1.07
//! million.
//!
//! **Why the number of vertices of a tile is fixed** and does not follow the memory: the result depends on it.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::gaps::MeetingGaps;
use super::input::{CoverageInput, REST, memory_for_features};
use super::kept_bits::RetainedBits;
use super::rebuild::{AssembledFeatures, FinishedTiles, Parts, RunCutting};
use super::snapping::{self, SnappedPositions};
use super::spool::{self, TileSpool, by_tile};
use super::tile::{
    FlatChains, KEPT_VERTEX, MAX_PAIRS, SolvedTile, TileContent, TileRounding, TileSettings,
    VERTEX, solve,
};
use super::trial::{OpenedLineJob, SimplifiedSource, TrialGoal};
use crate::files::LineFiles;
use crate::job::{LineJob, Topology};
use crate::report::LineReport;
use crate::tool::{DistanceKind, SimplifyRule, check};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::plane;
use terrane_engine::memory::short;
use terrane_engine::workers;
use terrane_engine::{Cancel, Progress, disk};
use terrane_files::{Buckets, lock};
use terrane_line::Xy;
use terrane_line::tiles::{LastTile, VertexQuadtree};
use terrane_line::topology::{RingCollapse, conflict};
use terrane_vector::{self as vector, VectorOpenOptions};

/// Memory in bytes per segment that crosses a tile.
const OBSTACLE: u64 = 320;
/// A job on all features.
pub(super) struct CoverageJob<'a> {
    pub(super) job: &'a LineJob,
    pub(super) files: &'a LineFiles,
    pub(super) topology: &'a Topology,
    pub(super) rule: &'a SimplifyRule,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
}

impl CoverageJob<'_> {
    /// Simplifies all features together and writes them if the result meets the goal; otherwise returns its size.
    pub(super) fn run(
        &self,
        input: &mut CoverageInput<'_>,
        goal: Option<&TrialGoal>,
        report: &mut LineReport,
    ) -> Result<Option<u64>> {
        self.snap(input)?;
        let quadtree = self.quadtree(input)?;
        let mut whole = Parts::new();
        loop {
            let kept = self.retained_bits(&quadtree);
            let rounded = self.job.decimals.map(|_| self.retained_bits(&quadtree));
            let (quadtree, rounded) = (&quadtree, rounded.as_ref());
            let tiles = FinishedTiles { quadtree, whole: &whole, kept: &kept, rounded };
            let total = self.solve_all(input, &tiles, report)?;
            // A finished file cannot be undone.
            let may_turn = quadtree.count() > 1 || self.rule.collapse == RingCollapse::Drop;
            if goal.is_some() || (input.all.len() > 1 && may_turn) {
                let assembled = self.scan(input, &tiles)?;
                if !assembled.turned.is_empty() {
                    whole.extend(assembled.turned);
                    continue;
                }
                let rejected_size = match goal {
                    Some(goal) => {
                        let mut leaves = self.assembled(tiles);
                        self.opened().rejected_size(input, goal, assembled.vertices, &mut leaves)?
                    }
                    None => None,
                };
                if rejected_size.is_some() {
                    return Ok(rejected_size);
                }
            }
            let notes = self.notes(input, &total)?;
            let turned = self.write(input, &tiles, report)?;
            if turned.is_empty() {
                report.notes.extend(notes);
                return Ok(None);
            }
            whole.extend(turned);
        }
    }

    fn opened(&self) -> OpenedLineJob<'_> {
        let &Self { job, files, progress, cancel, .. } = self;
        OpenedLineJob { job, files, progress, cancel }
    }

    fn memory(&self) -> u64 {
        self.job.resources.memory
    }

    fn retained_bits(&self, quadtree: &VertexQuadtree) -> RetainedBits {
        let memory = memory_for_features(self.memory()) / 64;
        RetainedBits::new(&self.folder(), quadtree.count(), memory)
    }

    /// Memory in bytes beside features and tiles: bits per vertex, snapped positions, and the rest.
    fn others(&self, input: &CoverageInput<'_>) -> u64 {
        let moved = match self.topology.snap > 0.0 {
            true => {
                (input.vertices * size_of::<Xy>() as u64).min(snapping::max_held(self.memory()))
            }
            false => 0,
        };
        self.bits(input) + moved + REST
    }

    /// Memory in bytes for the bits per vertex: kept and rounded.
    fn bits(&self, input: &CoverageInput<'_>) -> u64 {
        input.vertices / 8 * (1 + u64::from(self.job.decimals.is_some()))
    }

    /// Error for too little memory, with an amount sufficient for a tile of `tile_bytes` bytes whatever is kept:
    /// held features take at most half, and as much of the rest waits for its tile.
    fn too_little(&self, input: &CoverageInput<'_>, tile_bytes: u64) -> Error {
        let rest = tile_bytes + self.others(input);
        let needed = rest + input.bytes.min(rest);
        let mib = ((needed + needed / 7) >> 20) + 1;
        let message = format!("topology requires {mib} MiB of memory");
        let error = short(message, mib << 20).or("leave out ‹topology›");
        error.in_file(&self.files.pairs[0].input)
    }

    /// Folder for temporary files: beside the output by default.
    fn folder(&self) -> PathBuf {
        if let Some(folder) = &self.job.resources.temp_dir {
            return folder.clone();
        }
        let mut folders = self.job.output.ancestors().skip(1);
        folders.find(|folder| folder.is_dir()).unwrap_or(Path::new(".")).to_path_buf()
    }

    /// Divides space so that a tile fits in memory, with or without held features.
    fn quadtree(&self, input: &mut CoverageInput<'_>) -> Result<VertexQuadtree> {
        let most = self.topology.square.clamp(1, spool::MOST);
        let mut quadtree = VertexQuadtree::new(&input.seen.census, most)?;
        while let Some(mut finer) = quadtree.finer() {
            input.visit_all(self.cancel, |feature| {
                feature.geometry.parts().for_each(|part| finer.add(part.xy));
                Ok(())
            })?;
            quadtree = VertexQuadtree::refined(finer, &quadtree)?;
        }
        let largest = (0..quadtree.count()).map(|tile| quadtree.vertices(tile)).max();
        let needed = largest.unwrap_or(0) * VERTEX + self.others(input);
        if input.memory_use().is_some_and(|resident| resident + needed > self.memory()) {
            input.release();
        }
        if needed > self.memory() {
            return Err(self.too_little(input, largest.unwrap_or(0) * KEPT_VERTEX));
        }
        Ok(quadtree)
    }

    /// Snaps vertices of all features.
    fn snap(&self, input: &mut CoverageInput<'_>) -> Result<()> {
        if self.topology.snap == 0.0 || input.moves.snapped.is_some() {
            return Ok(());
        }
        let quadtree = self.quadtree(input)?;
        let folder = self.folder();
        let buckets = Buckets::new(&folder, quadtree.count(), self.memory() / 8);
        input.sort(&quadtree, &buckets, self.cancel)?;
        let snapped = SnappedPositions::new(
            buckets,
            quadtree,
            self.topology.snap,
            &folder,
            self.memory(),
            self.cancel,
        )?;
        input.snap(snapped, self.cancel)
    }

    /// Notes about the input, which is read again before anything is written.
    fn notes(&self, input: &mut CoverageInput<'_>, total: &TileTotals) -> Result<Vec<String>> {
        let mut notes: Vec<String> = total.gaps.note().into_iter().collect();
        let pairs = self.made_by_moving(input, &total.pairs)?;
        let harm = [
            (pairs, "pairs of segments cross, touch or overlap"),
            (input.seen.harm.rings, "rings change orientation or lose their area"),
            (input.seen.harm.touching, "features have rings that touch themselves or each other"),
        ];
        let changes = harm.iter().filter(|(count, _)| *count > 0);
        let changes: Vec<_> = changes.map(|(count, what)| format!("{count} {what}")).collect();
        let snap = self.topology.snap;
        if !changes.is_empty() {
            let changes = changes.join(", ");
            notes.push(format!("new with ‹snap› {snap:?}: {changes}; pass a smaller ‹snap›"));
        }
        let (looked, all) = (total.pairs.len() as u64, total.crossings);
        if snap > 0.0 && looked < all {
            notes.push(format!(
                "{all} pairs of segments meet; the state before ‹snap› {snap:?} is known for \
                 {looked} of them"
            ));
        }
        if let Some(decimals) = self.job.decimals.filter(|_| total.unrounded > 0) {
            notes.push(format!(
                "{} vertices are not rounded to {decimals} decimals: lines would touch, cross or \
                 change sides, or the vertex lies on the border of a tile",
                total.unrounded
            ));
        }
        Ok(notes)
    }

    /// Number of these pairs of segments that come from pairs that did not meet before snapping.
    fn made_by_moving(&self, input: &mut CoverageInput<'_>, pairs: &[[[Xy; 2]; 2]]) -> Result<u64> {
        if pairs.is_empty() || input.moves.is_none() {
            return Ok(0);
        }
        let mut originals: HashMap<_, Vec<[Xy; 2]>> =
            pairs.iter().flatten().map(|segment| (segment_key(segment), Vec::new())).collect();
        input.visit_moves(self.cancel, |before, after| {
            for (from, to) in before.parts().zip(after.parts()) {
                for (from, to) in from.xy.windows(2).zip(to.xy.windows(2)) {
                    if let Some(all) = originals.get_mut(&segment_key(&[to[0], to[1]])) {
                        all.push([from[0], from[1]]);
                    }
                }
            }
            Ok(())
        })?;
        // Merged segments had several originals: some may have met the other segment, and some not.
        let were_apart = pairs.iter().filter(|pair| {
            let [s, t] = pair.map(|segment| originals[&segment_key(&segment)].as_slice());
            s.iter().any(|s| t.iter().any(|t| !conflict(*s, *t)))
        });
        Ok(were_apart.count() as u64)
    }

    /// Computes the kept vertices of all tiles.
    fn solve_all(
        &self,
        input: &mut CoverageInput<'_>,
        tiles: &FinishedTiles<'_>,
        report: &mut LineReport,
    ) -> Result<TileTotals> {
        let quadtree = tiles.quadtree;
        let sides = match &self.topology.sides {
            Some(path) => by_tile(positions(path, &VectorOpenOptions::default())?, quadtree),
            None => Vec::new(),
        };
        self.progress.begin("simplify", quadtree.count() as u64);
        let solver = TileSolver { job: self, tiles, sides, total: Mutex::default() };
        let solved = if quadtree.count() == 1 && input.memory_use().is_some() {
            solver.solve(0, self.flat(input, tiles)?, self.memory_left(input))
        } else {
            let spool = self.spool(input, tiles)?;
            self.solve_spooled(input, &spool, &solver)
        };
        solved.map_err(|e| match e.kind() {
            ErrorKind::Resource => self.too_little(input, self.max_bytes(quadtree)),
            _ => e,
        })?;
        self.progress.end();
        let total = solver.total.into_inner().unwrap_or_default();
        report.arcs = total.arcs;
        report.refined = total.refined;
        report.input_crossings = total.crossings;
        report.collapsed = total.collapsed;
        report.unrounded = total.unrounded;
        report.largest_distance = total.distance2.sqrt();
        Ok(total)
    }

    /// All held parts as one tile.
    fn flat(
        &self,
        input: &mut CoverageInput<'_>,
        tiles: &FinishedTiles<'_>,
    ) -> Result<TileContent> {
        let mut flat = FlatChains::default();
        input.visit_all(self.cancel, |feature| {
            feature.geometry.parts().try_for_each(|part| {
                check(&part, self.rule)?;
                flat.points.extend_from_slice(part.xy);
                if self.rule.measure == DistanceKind::Space {
                    flat.z.extend_from_slice(part.z);
                }
                flat.end_part(part.xy.len(), part.is_ring());
                Ok(())
            })
        })?;
        // One tile holds fewer than 2^32 parts.
        let whole = tiles.whole.iter().map(|part| *part as u32).collect();
        Ok(TileContent { flat, whole, ..TileContent::default() })
    }

    /// Memory in bytes of the largest tile if all its vertices are kept.
    fn max_bytes(&self, quadtree: &VertexQuadtree) -> u64 {
        let sizes = (0..quadtree.count()).map(|tile| quadtree.vertices(tile) * KEPT_VERTEX);
        sizes.max().unwrap_or(0)
    }

    /// Memory for tiles in progress and for data waiting for them.
    fn memory_left(&self, input: &CoverageInput<'_>) -> u64 {
        let resident = input.memory_use().unwrap_or(0) + input.moves.memory_use();
        memory_for_features(self.memory()).saturating_sub(resident + self.bits(input))
    }

    /// Sorts all parts into tiles.
    fn spool<'s>(
        &self,
        input: &mut CoverageInput<'_>,
        tiles: &FinishedTiles<'s>,
    ) -> Result<TileSpool<'s>> {
        let quadtree = tiles.quadtree;
        let has_z = self.rule.measure == DistanceKind::Space;
        let (available, largest) = (self.memory_left(input), self.max_bytes(quadtree));
        let workers = self.workers(available / 8 * 7, largest) as u64;
        let memory =
            available.saturating_sub(workers * largest).max(memory_for_features(self.memory()) / 8);
        let bytes = input.vertices * if has_z { 24 } else { 16 };
        if bytes > memory {
            disk::check(&self.folder(), bytes)?;
        }
        let mut spool = TileSpool::new(quadtree, has_z, &self.folder(), memory);
        let mut parts = RunCutting::new(quadtree);
        input.visit_all(self.cancel, |feature| {
            feature.geometry.parts().try_for_each(|part| {
                check(&part, self.rule)?;
                let number = parts.cut(&part);
                spool.push(&part, &parts.runs, tiles.whole.contains(&number))
            })
        })?;
        Ok(spool)
    }

    fn workers(&self, available: u64, largest: u64) -> usize {
        let fitting = usize::try_from(available / largest.max(1)).unwrap_or(usize::MAX);
        self.job.resources.threads.min(fitting).max(1)
    }

    /// Tiles on as many threads as memory allows, longest first.
    fn solve_spooled(
        &self,
        input: &CoverageInput<'_>,
        spool: &TileSpool<'_>,
        solver: &TileSolver<'_>,
    ) -> Result<()> {
        let quadtree = solver.tiles.quadtree;
        let obstacle_bytes: Vec<u64> =
            (0..quadtree.count()).map(|tile| spool.obstacles(tile) * OBSTACLE).collect();
        let sizes = obstacle_bytes.iter().enumerate();
        let sizes = sizes.map(|(tile, bytes)| quadtree.vertices(tile) * KEPT_VERTEX + bytes);
        let mut order: Vec<_> = sizes.map(Reverse).zip(0..).collect();
        order.sort_unstable();
        let largest = order.first().map_or(0, |(Reverse(size), _)| *size);
        let least = obstacle_bytes.iter().enumerate();
        let least = least.map(|(tile, bytes)| quadtree.vertices(tile) * VERTEX + bytes).max();
        let memory = self.memory_left(input).saturating_sub(spool.memory_use());
        if least.unwrap_or(0) > memory {
            return Err(self.too_little(input, largest));
        }
        let threads = self.workers(memory, largest);
        let share = memory / threads as u64;
        workers::run(
            threads,
            order.len() as u64,
            self.cancel,
            || (),
            |(), unit| {
                let (_, tile) = order[unit as usize];
                let memory = share.saturating_sub(obstacle_bytes[tile]);
                solver.solve(tile, spool.take(tile)?, memory)
            },
            Ok,
        )
    }

    /// Results of all features, from the first.
    fn assembled<'k>(&self, tiles: FinishedTiles<'k>) -> AssembledFeatures<'k> {
        AssembledFeatures::new(tiles, self.rule.collapse, self.job.decimals)
    }

    /// Checks the results of all features.
    fn scan<'k>(
        &self,
        input: &mut CoverageInput<'_>,
        tiles: &FinishedTiles<'k>,
    ) -> Result<AssembledFeatures<'k>> {
        let mut assembled = self.assembled(*tiles);
        input.visit_all(self.cancel, |feature| assembled.of(feature).map(|_| ()))?;
        Ok(assembled)
    }

    /// Writes the results of all features; if more rings have to stay whole, returns them and writes nothing.
    fn write(
        &self,
        input: &mut CoverageInput<'_>,
        tiles: &FinishedTiles<'_>,
        report: &mut LineReport,
    ) -> Result<Parts> {
        let mut assembled = self.assembled(*tiles);
        let written = self.opened().write(input, &mut assembled, None)?;
        self.opened().note(input, written, report);
        (report.features, report.parts) = (assembled.features, assembled.parts.number);
        (report.vertices, report.kept) = (input.vertices, assembled.vertices);
        Ok(assembled.turned)
    }
}

/// The same for a segment and its reverse.
fn segment_key(segment: &[Xy; 2]) -> [[u64; 2]; 2] {
    let [a, b] = segment.map(plane::key);
    [a.min(b), a.max(b)]
}

/// Simplifies tiles on several threads.
struct TileSolver<'a> {
    job: &'a CoverageJob<'a>,
    tiles: &'a FinishedTiles<'a>,
    /// Positions that keep their side of lines, sorted by tile.
    sides: Vec<(u32, Xy)>,
    total: Mutex<TileTotals>,
}

impl TileSolver<'_> {
    /// Simplifies a tile and stores its kept vertices.
    fn solve(&self, tile: usize, mut content: TileContent, memory: u64) -> Result<()> {
        let Self { job, tiles, sides, .. } = self;
        let quadtree = tiles.quadtree;
        let first = sides.partition_point(|(other, _)| (*other as usize) < tile);
        let inside = sides[first..].iter().take_while(|(other, _)| *other as usize == tile);
        content.sides = inside.map(|(_, at)| *at).collect();
        let last = Mutex::new(LastTile::default());
        let holds = |at: Xy| {
            quadtree.count() == 1 || quadtree.of(at, &mut lock(&last)) == Some(tile as u32)
        };
        let rounding = job.job.decimals.map(|decimals| TileRounding { decimals, holds: &holds });
        let settings = TileSettings { strategy: job.topology.strategy, rule: job.rule, rounding };
        let solved = solve(&content, &settings, memory, job.cancel)?;
        tiles.kept.set(tile, &solved.bits)?;
        tiles.rounded.map_or(Ok(()), |rounded| rounded.set(tile, &solved.rounded))?;
        lock(&self.total).add(&solved, tile, quadtree);
        job.progress.advance(1);
        Ok(())
    }
}

/// Sums over tiles.
#[derive(Debug, Default)]
struct TileTotals {
    arcs: u64,
    refined: u64,
    crossings: u64,
    collapsed: u64,
    unrounded: u64,
    distance2: f64,
    /// Some of the pairs of segments that meet.
    pairs: Vec<[[Xy; 2]; 2]>,
    gaps: MeetingGaps,
}

impl TileTotals {
    fn add(&mut self, solved: &SolvedTile, tile: usize, quadtree: &VertexQuadtree) {
        self.arcs += solved.arcs;
        self.refined += solved.refined;
        self.collapsed += solved.collapsed;
        self.unrounded += solved.unrounded;
        self.distance2 = self.distance2.max(solved.distance2);
        // Segments that meet may share several tiles: the first tile counts them.
        let mut near = [Vec::new(), Vec::new()];
        let mut meeting = solved.meeting.clone();
        meeting.retain(|pair| {
            (0..2).for_each(|i| quadtree.meeting(pair[i], &mut near[i]));
            let first = near[0].iter().find(|other| near[1].binary_search(other).is_ok());
            first == Some(&(tile as u32))
        });
        self.crossings += solved.crossings + meeting.len() as u64;
        self.gaps.merge(&solved.gaps);
        meeting.iter().for_each(|pair| self.gaps.add(*pair));
        let most = MAX_PAIRS.div_ceil(quadtree.count());
        self.pairs.extend(solved.pairs.iter().chain(&meeting).take(most));
    }
}

/// Points of a file, whatever their position.
pub fn positions(path: &Path, options: &VectorOpenOptions) -> Result<Vec<Xy>> {
    let mut source = vector::open(path, options)?;
    let mut all = Vec::new();
    while let Some(feature) = source.next()? {
        let points = feature.geometry.leaves().filter(|leaf| leaf.kind().is_points());
        points.for_each(|leaf| all.extend_from_slice(&leaf.coordinates().xy));
    }
    Ok(all)
}
