//! Samples against the surfaces of all levels: the raster is read once, window by window, and decoded tiles
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
use terrane_files::lock;
use terrane_proof::ExactSum;
use terrane_proof::tiles::{
    ProofMeridian, ProofParallel, ProofTileId, SampleRunErrors, TileFacets, TilesetFault,
    TilesetFaults,
};

/// Metres for a metre from which on ground is steep, and metres of a degree, about.
const STEEP: f64 = 8.0;
const DEGREE: f64 = 111_000.0;
/// Most tiles that are counted as missing.
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
pub(super) struct OfLevel {
    pub(super) samples: u64,
    pub(super) over: u64,
    squares: ExactSum,
}

impl OfLevel {
    /// Root mean square of the distances.
    pub(super) fn rmse(&self) -> Option<f64> {
        (self.samples > 0).then(|| (self.squares.value() / self.samples as f64).sqrt())
    }
}

/// Findings on samples.
#[derive(Debug, Default)]
pub(super) struct SampleFindings {
    pub(super) faults: TilesetFaults,
    pub(super) levels: Vec<OfLevel>,
    /// Valid samples of the raster.
    pub(super) valid: u64,
    /// Lowest and highest of them, in metres.
    pub(super) heights: Option<[f64; 2]>,
    /// West, south, east and north of them.
    pub(super) bounds: Option<[f64; 4]>,
    /// The same of all samples.
    pub(super) whole: Option<[f64; 4]>,
    /// Metres between the heights of neighbours, at the most.
    jump: f64,
    missing: BTreeSet<ProofTileId>,
}

impl SampleFindings {
    fn new(levels: usize) -> Self {
        Self { levels: vec![OfLevel::default(); levels], ..Self::default() }
    }

    fn merge(&mut self, other: Self) {
        self.faults.merge(&other.faults);
        for (mine, theirs) in self.levels.iter_mut().zip(&other.levels) {
            mine.samples += theirs.samples;
            mine.over += theirs.over;
            mine.squares.merge(&theirs.squares);
        }
        self.valid += other.valid;
        self.jump = self.jump.max(other.jump);
        other.heights.into_iter().flatten().for_each(|height| self.reach(height));
        if let Some([west, south, east, north]) = other.bounds {
            hold(&mut self.bounds, [west, south]);
            hold(&mut self.bounds, [east, north]);
        }
        if let Some([west, south, east, north]) = other.whole {
            hold(&mut self.whole, [west, south]);
            hold(&mut self.whole, [east, north]);
        }
        self.missing.extend(other.missing);
    }

    /// Metres between the lowest and the highest sample, where neighbours are further apart in height than steep ground
    /// is, their places being so many degrees apart; else none.
    pub(super) fn steep(&self, spacing: f64) -> f64 {
        let [low, high] = self.heights.unwrap_or_default();
        if self.jump > STEEP * spacing * DEGREE { high - low } else { 0.0 }
    }

    fn reach(&mut self, height: f64) {
        let [low, high] = self.heights.unwrap_or([height; 2]);
        self.heights = Some([low.min(height), high.max(height)]);
    }

    fn miss(&mut self, id: ProofTileId) {
        if self.missing.len() < MAX_MISSING {
            self.missing.insert(id);
        }
    }
}

fn hold(bounds: &mut Option<[f64; 4]>, [x, y]: [f64; 2]) {
    let [west, south, east, north] = bounds.unwrap_or([x, y, x, y]);
    *bounds = Some([west.min(x), south.min(y), east.max(x), north.max(y)]);
}

/// Measures all samples. Results are indexed by the number of the tile.
pub(super) fn check(context: &TilesProofContext<'_>) -> Result<(SampleFindings, Vec<TileSamples>)> {
    let levels = usize::from(context.layer.finest) + 1;
    let under = Mutex::new(vec![TileSamples::default(); context.tiles.all.len()]);
    let found = Mutex::new(SampleFindings::new(levels));
    let facets = TileCache::new(context.room.memory / 2);
    let bounds = context.places.bounds();
    let side = window(&context.places);
    let across = u64::from(bounds.width.div_ceil(side));
    let windows = across * u64::from(bounds.height.div_ceil(side));
    context.progress.begin("samples", u64::from(bounds.width) * u64::from(bounds.height));
    let work = |(found, heights): &mut (SampleFindings, Vec<f64>), number: u64| {
        let [row, col] = [number / across, number % across].map(|at| at as u32 * side);
        let rect = Rect::new(col, row, side, side).intersect(&bounds);
        heights.resize(rect.len(), 0.0);
        context.places.read(rect, heights)?;
        let window = SweepWindow::new(context, rect, heights)?;
        window.count(found);
        (0..=context.layer.finest).try_for_each(|level| {
            let mut level =
                SweepLevel { window: &window, level, facets: &facets, under: &under, found };
            level.measure()
        })?;
        context.progress.advance(rect.len() as u64);
        Ok(())
    };
    let finish = |(mine, _): (SampleFindings, Vec<f64>)| {
        lock(&found).merge(mine);
        Ok(())
    };
    let start = || (SampleFindings::new(levels), Vec::new());
    workers::run(context.room.threads, windows, context.cancel, start, work, finish)?;
    context.progress.end();
    let mut found = std::mem::take(&mut *lock(&found));
    let missing = std::mem::take(&mut found.missing);
    missing.into_iter().for_each(|id| found.faults.add(TilesetFault::Missing, 1, id));
    Ok((found, std::mem::take(&mut *lock(&under))))
}

/// Samples that are looked at together.
struct SweepWindow<'a> {
    context: &'a TilesProofContext<'a>,
    rect: Rect,
    heights: &'a [f64],
    placed: WindowPositions,
}

impl<'a> SweepWindow<'a> {
    fn new(context: &'a TilesProofContext<'a>, rect: Rect, heights: &'a [f64]) -> Result<Self> {
        Ok(Self { context, rect, heights, placed: context.places.window(rect)? })
    }

    fn row(&self, row: usize, columns: &Range<usize>) -> &[f64] {
        &self.heights[row * self.rect.width as usize..][columns.clone()]
    }

    /// Counts the valid samples.
    fn count(&self, found: &mut SampleFindings) {
        let width = self.rect.width as usize;
        for (number, &height) in self.heights.iter().enumerate() {
            let place = match &self.placed {
                WindowPositions::Straight { longitudes, latitudes, .. } => {
                    [longitudes[number % width], latitudes[number / width]]
                }
                WindowPositions::Moved(places) => places[number],
            };
            hold(&mut found.whole, place);
            let left = (!number.is_multiple_of(width)).then(|| number - 1);
            for beside in left.into_iter().chain(number.checked_sub(width)) {
                // That of a void is no number, and less than any.
                found.jump = found.jump.max((height - self.heights[beside]).abs());
            }
            if !height.is_nan() {
                found.valid += 1;
                found.reach(height);
                hold(&mut found.bounds, place);
            }
        }
    }

    fn has_samples(&self, rows: &Range<usize>, columns: &Range<usize>) -> bool {
        rows.clone().any(|row| self.row(row, columns).iter().any(|height| !height.is_nan()))
    }

    /// Column and row of the raster, of a sample of the window.
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
            // Of those that go on, the last three at the most are not over.
            match runs.iter_mut().rev().take(3).find(|(known, _)| *known == tile) {
                Some((_, run)) => run.end = index + 1,
                None => runs.push((tile, index..index + 1)),
            }
        }
    }
    runs
}

/// A level above a window.
struct SweepLevel<'a> {
    window: &'a SweepWindow<'a>,
    level: u8,
    facets: &'a TileCache<TileFacets>,
    under: &'a Mutex<Vec<TileSamples>>,
    found: &'a mut SampleFindings,
}

impl SweepLevel<'_> {
    fn measure(&mut self) -> Result<()> {
        let (window, level) = (self.window, self.level);
        let (longitudes, latitudes) = match &window.placed {
            WindowPositions::Straight { longitudes, latitudes, .. } => (longitudes, latitudes),
            WindowPositions::Moved(places) => return self.scattered(places),
        };
        let columns = runs(longitudes, |at| ProofTileId::columns_of(level, at));
        for (y, rows) in runs(latitudes, |at| ProofTileId::rows_of(level, at)) {
            window.context.cancel.check()?;
            for (x, columns) in &columns {
                let id = ProofTileId { level, y, x: *x };
                if window.has_samples(&rows, columns) {
                    self.tile(id, |level, facets| level.rows(id, facets, &rows, columns))?;
                }
            }
        }
        Ok(())
    }

    /// Samples outside rows and columns of tiles: those of each tile one by one.
    fn scattered(&mut self, places: &[[f64; 2]]) -> Result<()> {
        let level = self.level;
        let mut of_tiles: BTreeMap<ProofTileId, Vec<usize>> = BTreeMap::new();
        let valid = |number: &usize| !self.window.heights[*number].is_nan();
        for number in (0..places.len()).filter(valid) {
            let [longitude, latitude] = places[number];
            for y in ProofTileId::rows_of(level, latitude) {
                for x in ProofTileId::columns_of(level, longitude) {
                    of_tiles.entry(ProofTileId { level, y, x }).or_default().push(number);
                }
            }
        }
        for (id, numbers) in of_tiles {
            self.window.context.cancel.check()?;
            self.tile(id, |level, facets| level.each(id, facets, (places, &numbers)))?;
        }
        Ok(())
    }

    fn tile(
        &mut self,
        id: ProofTileId,
        measure: impl FnOnce(&mut Self, &TileFacets) -> TileSamples,
    ) -> Result<()> {
        let Some(number) = self.window.context.tiles.find_one(id) else {
            self.found.miss(id);
            return Ok(());
        };
        // One that cannot be read is told of elsewhere.
        let Ok(facets) = decoded(self.facets_of(id))? else { return Ok(()) };
        let under = measure(self, &facets);
        let mut all = lock(self.under);
        let known = &mut all[number];
        known.count += under.count;
        known.far = farther(known.far, under.far);
        Ok(())
    }

    fn facets_of(&self, id: ProofTileId) -> Result<Arc<TileFacets>> {
        self.facets.get(id, || {
            let (tile, _) = self.window.context.read(id)?;
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
        let WindowPositions::Straight { meridians, parallels, .. } = &window.placed else {
            return TileSamples::default();
        };
        let meridians = &meridians[columns.clone()];
        let mut from = 0;
        self.measured(id, rows.clone(), |row, limit| {
            let heights = window.row(row, columns);
            let seen = facets.row(&mut from, &parallels[row], meridians, heights, limit);
            (seen, window.sample(row, columns.start + seen.most.map_or(0, |(_, index)| index)))
        })
    }

    fn each(
        &mut self,
        id: ProofTileId,
        facets: &TileFacets,
        (places, numbers): (&[[f64; 2]], &[usize]),
    ) -> TileSamples {
        let window = self.window;
        let width = window.rect.width as usize;
        let mut from = 0;
        self.measured(id, numbers.iter().copied(), |number, limit| {
            let [longitude, latitude] = places[number];
            let (meridian, parallel) = (ProofMeridian::at(longitude), ProofParallel::at(latitude));
            let heights = &window.heights[number..=number];
            let seen = facets.row(&mut from, &parallel, &[meridian], heights, limit);
            (seen, window.sample(number / width, number % width))
        })
    }

    /// Combines the results of parts of a tile, each with the row and column of its farthest sample.
    fn measured<T>(
        &mut self,
        id: ProofTileId,
        parts: impl Iterator<Item = T>,
        mut look: impl FnMut(T, [f64; 2]) -> (SampleRunErrors, [u32; 2]),
    ) -> TileSamples {
        let limit = [self.window.context.limit(self.level), self.window.context.places.rounded()];
        let (mut under, mut squares, mut over) = (TileSamples::default(), 0.0, 0);
        for part in parts {
            let (seen, sample) = look(part, limit);
            under.count += seen.count;
            over += seen.over;
            squares += seen.squares;
            let far =
                seen.most.map(|(distance, _)| FarthestSample { distance, sample, ends: seen.ends });
            under.far = farther(under.far, far);
        }
        let level = &mut self.found.levels[usize::from(self.level)];
        level.samples += under.count;
        level.over += over;
        level.squares.add(squares);
        self.found.faults.add(TilesetFault::OverTolerance, over, id);
        under
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
