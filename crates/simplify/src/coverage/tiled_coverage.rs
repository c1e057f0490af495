//! Simplifies all features together (`--topology`), so that shared borders stay shared, tile by tile if the data are
//! larger than memory.
//!
//! Up to `TILE_VERTICES` (2^20) vertices are one tile. For larger inputs a first pass counts vertices in the cells of a
//! grid, and a quadtree is divided until every tile is below the limit. Each part of a feature (a line or a ring) is cut
//! into runs: wherever a segment crosses from one tile to another, a run ends. Tiles are simplified independently; the
//! result is one bit per vertex, kept or not, in input order. Then the features are read again. Each part is cut into
//! the same runs, takes the next bits of their tiles, and is written. Features are held in memory if they fit, otherwise
//! they are read again each time. The output is the same, because tiles depend on vertices only.
//!
//! For rings with self-intersections the sign of the area is checked before output. A ring that has changed orientation
//! is kept whole, and all tiles are processed again. The same applies to an outer ring that would be dropped while one
//! of its holes remains. A ring in several tiles keeps its vertices where it crosses their borders, so it does not
//! collapse, whatever the setting.
//!
//! **Why segments that cross tile borders stay**, and are not simplified in a second round along the borders: a second
//! round would need tiles around the borders, and a third tiles around their corners. Vertices at borders are few: of
//! the 10.6 million vertices of the world's coastlines 1.07 million are kept, 893 of them because of tile borders.
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
const OBSTACLE_BYTES: u64 = 320;

/// A job on all features together.
pub(super) struct CoverageJob<'a> {
    pub(super) job: &'a LineJob,
    pub(super) files: &'a LineFiles,
    pub(super) topology: &'a Topology,
    pub(super) rule: &'a SimplifyRule,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
}

impl CoverageJob<'_> {
    /// Simplifies all features together and writes them. With a `goal`, a result outside its range is not written, and
    /// its size (in the unit of the goal) is returned.
    pub(super) fn run(
        &self,
        input: &mut CoverageInput<'_>,
        goal: Option<&TrialGoal>,
        report: &mut LineReport,
    ) -> Result<Option<u64>> {
        self.snap(input)?;
        let quadtree = self.quadtree(input)?;
        // Parts that are not simplified. The set grows from round to round, so the loop ends.
        let mut kept_whole = Parts::new();
        loop {
            let kept = self.retained_bits(&quadtree);
            let rounded = self.job.decimals.map(|_| self.retained_bits(&quadtree));
            let (quadtree, rounded) = (&quadtree, rounded.as_ref());
            let tiles = FinishedTiles { quadtree, whole: &kept_whole, kept: &kept, rounded };
            let total = self.solve_all(input, &tiles, report)?;
            // If there are several output files, or the size decides, rings are checked before anything is written: a
            // finished file cannot be undone.
            let may_change_rings = quadtree.count() > 1 || self.rule.collapse == RingCollapse::Drop;
            if goal.is_some() || (input.all.len() > 1 && may_change_rings) {
                let results = self.scan(input, &tiles)?;
                if !results.turned.is_empty() {
                    kept_whole.extend(results.turned);
                    continue;
                }
                let rejected_size = match goal {
                    Some(goal) => {
                        let mut assembled = self.assembled(tiles);
                        self.opened().rejected_size(
                            input,
                            goal,
                            results.vertices,
                            &mut assembled,
                        )?
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
            kept_whole.extend(turned);
        }
    }

    fn opened(&self) -> OpenedLineJob<'_> {
        let &Self { job, files, progress, cancel, .. } = self;
        OpenedLineJob { job, files, progress, cancel }
    }

    /// The memory budget in bytes.
    fn memory(&self) -> u64 {
        self.job.resources.memory
    }

    /// An empty set of bits for each tile, spilled beyond a share of the memory.
    fn retained_bits(&self, quadtree: &VertexQuadtree) -> RetainedBits {
        let memory = memory_for_features(self.memory()) / 64;
        RetainedBits::new(&self.temp_folder(), quadtree.count(), memory)
    }

    /// Memory in bytes beside features and tiles: bits per vertex, snapped positions, and the program.
    fn other_bytes(&self, input: &CoverageInput<'_>) -> u64 {
        let snapped = match self.topology.snap > 0.0 {
            true => {
                (input.vertices * size_of::<Xy>() as u64).min(snapping::max_held(self.memory()))
            }
            false => 0,
        };
        self.bit_bytes(input) + snapped + REST
    }

    /// Memory in bytes for the bits per vertex: kept and rounded.
    fn bit_bytes(&self, input: &CoverageInput<'_>) -> u64 {
        input.vertices / 8 * (1 + u64::from(self.job.decimals.is_some()))
    }

    /// Error for too little memory. The amount in it suffices for a tile of `tile_bytes` bytes, however many vertices are
    /// kept: features held in memory take at most half, and data waiting for their tile an eighth.
    fn too_little(&self, input: &CoverageInput<'_>, tile_bytes: u64) -> Error {
        let rest = tile_bytes + self.other_bytes(input);
        let needed = rest + input.bytes.min(rest);
        let mib = ((needed + needed / 7) >> 20) + 1;
        let message = format!("topology requires {mib} MiB of memory");
        let error = short(message, mib << 20).or("leave out ‹topology›");
        error.in_file(&self.files.pairs[0].input)
    }

    /// Folder for temporary files: by default the nearest existing folder above the output.
    fn temp_folder(&self) -> PathBuf {
        if let Some(folder) = &self.job.resources.temp_dir {
            return folder.clone();
        }
        let mut folders = self.job.output.ancestors().skip(1);
        folders.find(|folder| folder.is_dir()).unwrap_or(Path::new(".")).to_path_buf()
    }

    /// Divides space into tiles of at most the set number of vertices. If a tile and the features do not fit into memory
    /// together, the features are released, to be read again each time. Fails if a tile alone does not fit.
    fn quadtree(&self, input: &mut CoverageInput<'_>) -> Result<VertexQuadtree> {
        let max_vertices = self.topology.tile_vertices.clamp(1, spool::MOST);
        let mut quadtree = VertexQuadtree::new(&input.seen.census, max_vertices)?;
        // Where one cell of the histogram has too many vertices for a tile, they are counted again in finer cells.
        while let Some(mut finer) = quadtree.finer() {
            input.visit_all(self.cancel, |feature| {
                feature.geometry.parts().for_each(|part| finer.add(part.xy));
                Ok(())
            })?;
            quadtree = VertexQuadtree::refined(finer, &quadtree)?;
        }
        let largest = (0..quadtree.count()).map(|tile| quadtree.vertices(tile)).max();
        let needed = largest.unwrap_or(0) * VERTEX + self.other_bytes(input);
        if input.memory_use().is_some_and(|resident| resident + needed > self.memory()) {
            input.release();
        }
        if needed > self.memory() {
            return Err(self.too_little(input, largest.unwrap_or(0) * KEPT_VERTEX));
        }
        Ok(quadtree)
    }

    /// Snaps vertices of all features to each other, if requested and not done yet.
    fn snap(&self, input: &mut CoverageInput<'_>) -> Result<()> {
        if self.topology.snap == 0.0 || input.moves.snapped.is_some() {
            return Ok(());
        }
        let quadtree = self.quadtree(input)?;
        let folder = self.temp_folder();
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

    /// Notes about gaps, snapping and rounding. Reads the input again, so they are made before anything is written.
    fn notes(&self, input: &mut CoverageInput<'_>, total: &TileTotals) -> Result<Vec<String>> {
        let mut notes: Vec<String> = total.gaps.note().into_iter().collect();
        let pairs = self.pairs_made_by_snapping(input, &total.pairs)?;
        let damage = [
            (pairs, "pairs of segments cross, touch or overlap"),
            (input.seen.harm.rings, "rings change orientation or lose their area"),
            (input.seen.harm.touching, "features have rings that touch themselves or each other"),
        ];
        let damage = damage.iter().filter(|(count, _)| *count > 0);
        let damage: Vec<_> = damage.map(|(count, what)| format!("{count} {what}")).collect();
        let snap = self.topology.snap;
        if !damage.is_empty() {
            let damage = damage.join(", ");
            notes.push(format!("new with ‹snap› {snap:?}: {damage}; pass a smaller ‹snap›"));
        }
        // Only a limited number of pairs is recorded.
        let (recorded, all) = (total.pairs.len() as u64, total.crossings);
        if snap > 0.0 && recorded < all {
            notes.push(format!(
                "{all} pairs of segments meet; the state before ‹snap› {snap:?} is known for \
                 {recorded} of them"
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

    /// The number of `pairs` of segments that meet only because of snapping: some original segments of the two did not.
    fn pairs_made_by_snapping(
        &self,
        input: &mut CoverageInput<'_>,
        pairs: &[[[Xy; 2]; 2]],
    ) -> Result<u64> {
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
        // Snapping can merge segments. One of the originals may have met the other segment, and another may not.
        let were_apart = pairs.iter().filter(|pair| {
            let [s, t] = pair.map(|segment| originals[&segment_key(&segment)].as_slice());
            s.iter().any(|s| t.iter().any(|t| !conflict(*s, *t)))
        });
        Ok(were_apart.count() as u64)
    }

    /// Simplifies all tiles: stores the bits of kept vertices in `tiles`, and the totals in the report.
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
            solver.solve(0, self.single_tile(input, tiles)?, self.memory_left(input))
        } else {
            let spool = self.spool(input, tiles)?;
            self.solve_spooled(input, &spool, &solver)
        };
        solved.map_err(|e| match e.kind() {
            ErrorKind::Resource => self.too_little(input, self.max_tile_bytes(quadtree)),
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

    /// The parts of all features as one tile.
    fn single_tile(
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
        // A single tile has fewer than 2^32 vertices, so part numbers fit.
        let whole = tiles.whole.iter().map(|part| *part as u32).collect();
        Ok(TileContent { flat, whole, ..TileContent::default() })
    }

    /// Memory in bytes of the largest tile if all its vertices are kept.
    fn max_tile_bytes(&self, quadtree: &VertexQuadtree) -> u64 {
        let sizes = (0..quadtree.count()).map(|tile| quadtree.vertices(tile) * KEPT_VERTEX);
        sizes.max().unwrap_or(0)
    }

    /// Memory in bytes for tiles in progress and for the data of tiles that wait.
    fn memory_left(&self, input: &CoverageInput<'_>) -> u64 {
        let resident = input.memory_use().unwrap_or(0) + input.moves.memory_use();
        memory_for_features(self.memory()).saturating_sub(resident + self.bit_bytes(input))
    }

    /// Cuts all parts into runs, sorted by tile, in memory or in a temporary file.
    fn spool<'s>(
        &self,
        input: &mut CoverageInput<'_>,
        tiles: &FinishedTiles<'s>,
    ) -> Result<TileSpool<'s>> {
        let quadtree = tiles.quadtree;
        let has_z = self.rule.measure == DistanceKind::Space;
        let (available, largest) = (self.memory_left(input), self.max_tile_bytes(quadtree));
        // Waiting data get at least an eighth, and whatever the workers cannot use.
        let workers = self.workers(available / 8 * 7, largest) as u64;
        let memory =
            available.saturating_sub(workers * largest).max(memory_for_features(self.memory()) / 8);
        // Two or three coordinates in doubles.
        let bytes = input.vertices * if has_z { 24 } else { 16 };
        if bytes > memory {
            disk::check(&self.temp_folder(), bytes)?;
        }
        let mut spool = TileSpool::new(quadtree, has_z, &self.temp_folder(), memory);
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

    /// The number of threads, at least 1, for tiles of up to `largest` bytes in `available` bytes.
    fn workers(&self, available: u64, largest: u64) -> usize {
        let fitting = usize::try_from(available / largest.max(1)).unwrap_or(usize::MAX);
        self.job.resources.threads.min(fitting).max(1)
    }

    /// Simplifies tiles on as many threads as memory allows, the largest first: a large tile at the end would leave the
    /// other threads idle.
    fn solve_spooled(
        &self,
        input: &CoverageInput<'_>,
        spool: &TileSpool<'_>,
        solver: &TileSolver<'_>,
    ) -> Result<()> {
        let quadtree = solver.tiles.quadtree;
        let tiles = 0..quadtree.count();
        let obstacle_bytes: Vec<u64> =
            tiles.clone().map(|tile| spool.obstacles(tile) * OBSTACLE_BYTES).collect();
        let sizes =
            tiles.clone().map(|tile| quadtree.vertices(tile) * KEPT_VERTEX + obstacle_bytes[tile]);
        let mut order: Vec<_> = sizes.map(Reverse).zip(0..).collect();
        order.sort_unstable();
        let largest = order.first().map_or(0, |(Reverse(size), _)| *size);
        // Without the memory for kept vertices, whose number is not known yet.
        let min_bytes =
            tiles.map(|tile| quadtree.vertices(tile) * VERTEX + obstacle_bytes[tile]).max();
        let memory = self.memory_left(input).saturating_sub(spool.memory_use());
        if min_bytes.unwrap_or(0) > memory {
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

    /// The simplified features, assembled from the first on as they are read again.
    fn assembled<'k>(&self, tiles: FinishedTiles<'k>) -> AssembledFeatures<'k> {
        AssembledFeatures::new(tiles, self.rule.collapse, self.job.decimals)
    }

    /// Assembles all features without writing them: finds the rings that have to be kept whole, and counts vertices.
    fn scan<'k>(
        &self,
        input: &mut CoverageInput<'_>,
        tiles: &FinishedTiles<'k>,
    ) -> Result<AssembledFeatures<'k>> {
        let mut results = self.assembled(*tiles);
        input.visit_all(self.cancel, |feature| results.of(feature).map(|_| ()))?;
        Ok(results)
    }

    /// Writes the results of all features. If more rings have to be kept whole, returns them, and no file appears.
    fn write(
        &self,
        input: &mut CoverageInput<'_>,
        tiles: &FinishedTiles<'_>,
        report: &mut LineReport,
    ) -> Result<Parts> {
        let mut results = self.assembled(*tiles);
        let written = self.opened().write(input, &mut results, None)?;
        self.opened().note(input, written, report);
        (report.features, report.parts) = (results.features, results.parts.number);
        (report.vertices, report.kept) = (input.vertices, results.vertices);
        Ok(results.turned)
    }
}

/// A key of a segment, the same for both directions.
fn segment_key(segment: &[Xy; 2]) -> [[u64; 2]; 2] {
    let [a, b] = segment.map(plane::key);
    [a.min(b), a.max(b)]
}

/// Simplifies tiles on several threads.
struct TileSolver<'a> {
    job: &'a CoverageJob<'a>,
    tiles: &'a FinishedTiles<'a>,
    /// Points whose side of every line must not change, sorted by tile.
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
        // A rounded vertex must stay in its tile: the other tiles do not know that it moves.
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
    /// Largest squared distance of a vertex from its simplified line.
    distance2: f64,
    /// Some of the pairs of segments that meet, at most [`MAX_PAIRS`].
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
        // Two segments across tile borders may meet in several tiles. The first tile that both cross counts the pair.
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
        // The same number from each tile, so that the record does not depend on the order of tiles.
        let max_per_tile = MAX_PAIRS.div_ceil(quadtree.count());
        self.pairs.extend(solved.pairs.iter().chain(&meeting).take(max_per_tile));
    }
}

/// The positions of all points of a file; lines and polygons are skipped.
pub fn positions(path: &Path, options: &VectorOpenOptions) -> Result<Vec<Xy>> {
    let mut source = vector::open(path, options)?;
    let mut all = Vec::new();
    while let Some(feature) = source.next()? {
        let points = feature.geometry.leaves().filter(|leaf| leaf.kind().is_points());
        points.for_each(|leaf| all.extend_from_slice(&leaf.coordinates().xy));
    }
    Ok(all)
}
