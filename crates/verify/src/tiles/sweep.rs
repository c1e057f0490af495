//! Distances of samples from the surfaces of all levels: the raster is read once, window by window, and decoded tiles
//! stay in a cache while neighbouring windows need them.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::{Arc, Mutex};

use super::cache::TileCache;
use super::context::{TilesProofContext, decoded};
use super::georeference::WindowPositions;
use super::memory_shares::window;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::workers;
use terrane_files::{lock, unlocked};
use terrane_proof::ExactSum;
use terrane_proof::tiles::{
    ProofMeridian, ProofParallel, ProofTileId, SampleRunErrors, TileFacets, TilesetFault,
    TilesetFaults,
};

/// Slope, rise over run, from which on ground is steep.
const STEEP: f64 = 8.0;
/// Metres of a degree, about.
const DEGREE: f64 = 111_000.0;
/// Limit of the number of tiles that are counted as missing.
pub(super) const MAX_MISSING: usize = 1 << 20;

/// The farthest sample of a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FarthestSample {
    /// In metres.
    pub(super) distance: f64,
    /// Row and column.
    pub(super) sample: [u32; 2],
    /// Certain and possible distance of the samples of the tile, given the rounding of positions.
    pub(super) ends: [f64; 2],
}

/// Samples of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileSamples {
    pub(super) count: u64,
    pub(super) far: Option<FarthestSample>,
}

/// Samples of a level.
#[derive(Clone, Debug, Default)]
pub(super) struct LevelSamples {
    pub(super) samples: u64,
    pub(super) over: u64,
    squares: ExactSum,
}

impl LevelSamples {
    /// Root mean square of the distances.
    pub(super) fn rmse(&self) -> Option<f64> {
        (self.samples > 0).then(|| (self.squares.value() / self.samples as f64).sqrt())
    }
}

/// Findings on samples.
#[derive(Debug, Default)]
pub(super) struct SampleFindings {
    pub(super) faults: TilesetFaults,
    pub(super) levels: Vec<LevelSamples>,
    /// Valid samples of the raster.
    pub(super) valid: u64,
    /// Lowest and highest valid sample, in metres.
    pub(super) heights: Option<[f64; 2]>,
    /// West, south, east and north of the valid samples.
    pub(super) bounds: Option<[f64; 4]>,
    /// West, south, east and north of all samples.
    pub(super) all_bounds: Option<[f64; 4]>,
    /// Largest height difference of neighbours, in metres.
    max_jump: f64,
    missing: BTreeSet<ProofTileId>,
}

impl SampleFindings {
    fn new(levels: usize) -> Self {
        Self { levels: vec![LevelSamples::default(); levels], ..Self::default() }
    }

    fn merge(&mut self, other: Self) {
        self.faults.merge(&other.faults);
        for (mine, theirs) in self.levels.iter_mut().zip(&other.levels) {
            mine.samples += theirs.samples;
            mine.over += theirs.over;
            mine.squares.merge(&theirs.squares);
        }
        self.valid += other.valid;
        self.max_jump = self.max_jump.max(other.max_jump);
        other.heights.into_iter().flatten().for_each(|height| self.add_height(height));
        if let Some([west, south, east, north]) = other.bounds {
            extend(&mut self.bounds, [west, south]);
            extend(&mut self.bounds, [east, north]);
        }
        if let Some([west, south, east, north]) = other.all_bounds {
            extend(&mut self.all_bounds, [west, south]);
            extend(&mut self.all_bounds, [east, north]);
        }
        self.missing.extend(other.missing);
    }

    /// Metres between the lowest and the highest sample if the ground is steep, else 0. `spacing` is that of the
    /// samples in degrees.
    pub(super) fn steep(&self, spacing: f64) -> f64 {
        let [low, high] = self.heights.unwrap_or_default();
        if self.max_jump > STEEP * spacing * DEGREE { high - low } else { 0.0 }
    }

    fn add_height(&mut self, height: f64) {
        let [low, high] = self.heights.unwrap_or([height; 2]);
        self.heights = Some([low.min(height), high.max(height)]);
    }

    fn miss(&mut self, id: ProofTileId) {
        if self.missing.len() < MAX_MISSING {
            self.missing.insert(id);
        }
    }
}

fn extend(bounds: &mut Option<[f64; 4]>, [x, y]: [f64; 2]) {
    let [west, south, east, north] = bounds.unwrap_or([x, y, x, y]);
    *bounds = Some([west.min(x), south.min(y), east.max(x), north.max(y)]);
}

/// Measures all samples. The samples of tiles are indexed by the number of the tile.
pub(super) fn check(context: &TilesProofContext<'_>) -> Result<(SampleFindings, Vec<TileSamples>)> {
    let levels = usize::from(context.layer.finest) + 1;
    let sweep = SampleSweep {
        context,
        bounds: context.raster.bounds(),
        side: window(&context.raster),
        facets: TileCache::new(context.memory.bytes / 2),
        samples: Mutex::new(vec![TileSamples::default(); context.tiles.all.len()]),
    };
    let Rect { width, height, .. } = sweep.bounds;
    let windows = sweep.windows_across() * u64::from(height.div_ceil(sweep.side));
    context.progress.begin("samples", u64::from(width) * u64::from(height));
    let findings = Mutex::new(SampleFindings::new(levels));
    workers::run(
        context.memory.threads,
        windows,
        context.cancel,
        || SweepThread { findings: SampleFindings::new(levels), heights: Vec::new() },
        |thread, number| sweep.measure(thread, number),
        |thread| {
            lock(&findings).merge(thread.findings);
            Ok(())
        },
    )?;
    context.progress.end();
    let mut findings = unlocked(findings);
    let missing = std::mem::take(&mut findings.missing);
    missing.into_iter().for_each(|id| findings.faults.add(TilesetFault::Missing, 1, id));
    Ok((findings, unlocked(sweep.samples)))
}

/// State of one thread.
struct SweepThread {
    findings: SampleFindings,
    /// Heights of the window, reused.
    heights: Vec<f64>,
}

/// State shared by all threads.
struct SampleSweep<'a> {
    context: &'a TilesProofContext<'a>,
    /// The rectangle of all samples.
    bounds: Rect,
    /// Columns and rows of a window.
    side: u32,
    facets: TileCache<TileFacets>,
    /// By the number of the tile.
    samples: Mutex<Vec<TileSamples>>,
}

impl SampleSweep<'_> {
    fn windows_across(&self) -> u64 {
        u64::from(self.bounds.width.div_ceil(self.side))
    }

    /// Measures the samples of a window on all levels.
    fn measure(&self, thread: &mut SweepThread, number: u64) -> Result<()> {
        let across = self.windows_across();
        let [row, col] = [number / across, number % across].map(|at| at as u32 * self.side);
        let rect = Rect::new(col, row, self.side, self.side).intersect(&self.bounds);
        let SweepThread { findings, heights } = thread;
        heights.resize(rect.len(), 0.0);
        self.context.raster.read(rect, heights)?;
        let positions = self.context.raster.window(rect)?;
        let window = SweepWindow { rect, heights, positions };
        window.count(findings);
        for level in 0..=self.context.layer.finest {
            SweepLevel { sweep: self, window: &window, level, findings }.measure()?;
        }
        self.context.progress.advance(rect.len() as u64);
        Ok(())
    }
}

/// Samples that are read together.
struct SweepWindow<'a> {
    rect: Rect,
    heights: &'a [f64],
    positions: WindowPositions,
}

impl SweepWindow<'_> {
    fn row(&self, row: usize, columns: &Range<usize>) -> &[f64] {
        &self.heights[row * self.rect.width as usize..][columns.clone()]
    }

    /// Counts the valid samples.
    fn count(&self, findings: &mut SampleFindings) {
        let width = self.rect.width as usize;
        for (number, &height) in self.heights.iter().enumerate() {
            let position = match &self.positions {
                WindowPositions::Straight { longitudes, latitudes, .. } => {
                    [longitudes[number % width], latitudes[number / width]]
                }
                WindowPositions::Moved(positions) => positions[number],
            };
            extend(&mut findings.all_bounds, position);
            let left = (!number.is_multiple_of(width)).then(|| number - 1);
            for neighbour in left.into_iter().chain(number.checked_sub(width)) {
                // `f64::max` drops the NaN of a void.
                findings.max_jump = findings.max_jump.max((height - self.heights[neighbour]).abs());
            }
            if !height.is_nan() {
                findings.valid += 1;
                findings.add_height(height);
                extend(&mut findings.bounds, position);
            }
        }
    }

    fn has_samples(&self, rows: &Range<usize>, columns: &Range<usize>) -> bool {
        rows.clone().any(|row| self.row(row, columns).iter().any(|height| !height.is_nan()))
    }

    /// Row and column in the raster of a sample of the window.
    fn sample(&self, row: usize, col: usize) -> [u32; 2] {
        [self.rect.row + row as u32, self.rect.col + col as u32]
    }
}

/// Runs of neighbours that lie in a tile each, by the column or row of the tile.
fn runs<I: Iterator<Item = u32>>(
    at: &[f64],
    tiles_of: impl Fn(f64) -> I,
) -> Vec<(u32, Range<usize>)> {
    let mut runs: Vec<(u32, Range<usize>)> = Vec::new();
    for (index, &degrees) in at.iter().enumerate() {
        for tile in tiles_of(degrees) {
            // A border belongs to two tiles, so at most three runs are open.
            match runs.iter_mut().rev().take(3).find(|(known, _)| *known == tile) {
                Some((_, run)) => run.end = index + 1,
                None => runs.push((tile, index..index + 1)),
            }
        }
    }
    runs
}

/// The samples of a window against one level.
struct SweepLevel<'a> {
    sweep: &'a SampleSweep<'a>,
    window: &'a SweepWindow<'a>,
    level: u8,
    findings: &'a mut SampleFindings,
}

impl SweepLevel<'_> {
    fn measure(&mut self) -> Result<()> {
        let (window, level) = (self.window, self.level);
        let (longitudes, latitudes) = match &window.positions {
            WindowPositions::Straight { longitudes, latitudes, .. } => (longitudes, latitudes),
            WindowPositions::Moved(positions) => return self.scattered(positions),
        };
        let columns = runs(longitudes, |at| ProofTileId::columns_of(level, at));
        for (y, rows) in runs(latitudes, |at| ProofTileId::rows_of(level, at)) {
            self.sweep.context.cancel.check()?;
            for (x, columns) in &columns {
                let id = ProofTileId { level, y, x: *x };
                if window.has_samples(&rows, columns) {
                    self.tile(id, |level, facets| level.rows(id, facets, &rows, columns))?;
                }
            }
        }
        Ok(())
    }

    /// Measures a window whose columns are not meridians: the samples of each tile one by one.
    fn scattered(&mut self, positions: &[[f64; 2]]) -> Result<()> {
        let level = self.level;
        let mut of_tiles: BTreeMap<ProofTileId, Vec<usize>> = BTreeMap::new();
        for (number, &[longitude, latitude]) in positions.iter().enumerate() {
            if self.window.heights[number].is_nan() {
                continue;
            }
            for y in ProofTileId::rows_of(level, latitude) {
                for x in ProofTileId::columns_of(level, longitude) {
                    of_tiles.entry(ProofTileId { level, y, x }).or_default().push(number);
                }
            }
        }
        for (id, numbers) in of_tiles {
            self.sweep.context.cancel.check()?;
            self.tile(id, |level, facets| level.each(id, facets, positions, &numbers))?;
        }
        Ok(())
    }

    fn tile(
        &mut self,
        id: ProofTileId,
        measure: impl FnOnce(&mut Self, &TileFacets) -> TileSamples,
    ) -> Result<()> {
        let Some(number) = self.sweep.context.tiles.number_of(id) else {
            self.findings.miss(id);
            return Ok(());
        };
        // The pass over the tiles reports unreadable ones.
        let Ok(facets) = decoded(self.facets_of(id))? else { return Ok(()) };
        let samples = measure(self, &facets);
        let mut all = lock(&self.sweep.samples);
        let known = &mut all[number];
        known.count += samples.count;
        known.far = farther(known.far, samples.far);
        Ok(())
    }

    fn facets_of(&self, id: ProofTileId) -> Result<Arc<TileFacets>> {
        self.sweep.facets.get(id, || {
            let (tile, _) = self.sweep.context.read(id)?;
            let facets = TileFacets::new(&tile, &TileFacets::positions(id, &tile));
            let bytes = facets.bytes();
            Ok((facets, bytes))
        })
    }

    fn rows(
        &mut self,
        id: ProofTileId,
        facets: &TileFacets,
        rows: &Range<usize>,
        columns: &Range<usize>,
    ) -> TileSamples {
        let window = self.window;
        let WindowPositions::Straight { meridians, parallels, .. } = &window.positions else {
            return TileSamples::default();
        };
        let meridians = &meridians[columns.clone()];
        let mut from = 0;
        let (limit, rounded) = self.limits();
        self.measured(id, rows.clone(), |row| {
            let heights = window.row(row, columns);
            let errors = facets.row(&mut from, &parallels[row], meridians, heights, limit, rounded);
            (errors, window.sample(row, columns.start + errors.max.map_or(0, |(_, index)| index)))
        })
    }

    fn each(
        &mut self,
        id: ProofTileId,
        facets: &TileFacets,
        positions: &[[f64; 2]],
        numbers: &[usize],
    ) -> TileSamples {
        let window = self.window;
        let width = window.rect.width as usize;
        let mut from = 0;
        let (limit, rounded) = self.limits();
        self.measured(id, numbers.iter().copied(), |number| {
            let [longitude, latitude] = positions[number];
            let (meridian, parallel) = (ProofMeridian::at(longitude), ProofParallel::at(latitude));
            let heights = &window.heights[number..=number];
            let errors = facets.row(&mut from, &parallel, &[meridian], heights, limit, rounded);
            (errors, window.sample(number / width, number % width))
        })
    }

    /// The allowed distance of samples, and the rounding of their positions.
    fn limits(&self) -> (f64, f64) {
        let context = self.sweep.context;
        (context.limit(self.level), context.raster.rounded())
    }

    /// Combines the errors of runs of samples of a tile, each with the row and column of its farthest sample.
    fn measured<T>(
        &mut self,
        id: ProofTileId,
        runs: impl Iterator<Item = T>,
        mut measure: impl FnMut(T) -> (SampleRunErrors, [u32; 2]),
    ) -> TileSamples {
        let (mut samples, mut squares, mut over) = (TileSamples::default(), 0.0, 0);
        for run in runs {
            let (errors, sample) = measure(run);
            samples.count += errors.count;
            over += errors.over;
            squares += errors.squares;
            let far = errors.max.map(|(distance, _)| FarthestSample {
                distance,
                sample,
                ends: errors.ends,
            });
            samples.far = farther(samples.far, far);
        }
        let level = &mut self.findings.levels[usize::from(self.level)];
        level.samples += samples.count;
        level.over += over;
        level.squares.add(squares);
        self.findings.faults.add(TilesetFault::OverTolerance, over, id);
        samples
    }
}

/// The farther of two samples; of equal ones the first in the raster.
pub(super) fn farther(
    a: Option<FarthestSample>,
    b: Option<FarthestSample>,
) -> Option<FarthestSample> {
    a.into_iter().chain(b).reduce(|a, b| {
        let is_b = b.distance.total_cmp(&a.distance).then(a.sample.cmp(&b.sample)).is_gt();
        let ends = [0, 1].map(|i| a.ends[i].max(b.ends[i]));
        FarthestSample { ends, ..if is_b { b } else { a } }
    })
}
