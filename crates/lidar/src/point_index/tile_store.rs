//! All points of a point cloud in tiles: read once, stored in memory or in a file, returned tile by tile.

use std::path::Path;
use std::sync::Mutex;

use super::coverage::{PointStoreCoverage, parts_in};
use super::summary::TileSummary;
use super::tile_files::PointTileIndexes;
use super::tiling::Tiling;
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_cloud::{PointSource, ReturnCounts};
use terrane_delaunay::{CircumscribedDisc, ConvexHull, FixedPosition, HullLocation, SiteWindow};
use terrane_engine::skip_bad::LostPoints;
use terrane_engine::workers;
use terrane_engine::{Cancel, FileAt, Progress};
use terrane_files::{Buckets, lock};

/// The points of a point cloud by tile.
#[derive(Debug)]
pub(crate) struct PointStore {
    tiling: Tiling,
    pub(super) points: Buckets<Point>,
    /// Further points in files.
    stored: PointTileIndexes,
    /// Tiles to keep, if not all.
    selected: Option<Vec<bool>>,
    summaries: Vec<Mutex<TileSummary>>,
    census: ReturnCounts,
    losses: LostPoints,
    /// Limits, if it has a part of the point cloud only.
    pub(super) limits: Option<PointStoreCoverage>,
    /// Hull of the points, if the points are not kept.
    outline: Option<Mutex<ConvexHull>>,
}

/// How a store is filled.
pub(crate) struct PointStoreSetup<'a> {
    /// Threads that read.
    pub(crate) threads: usize,
    /// Bytes of points that may stay in memory.
    pub(crate) memory: u64,
    /// Folder of the temporary file, if one is needed.
    pub(crate) folder: &'a Path,
    /// Window to read, if not all.
    pub(crate) within: Option<SiteWindow>,
    pub(crate) progress: &'a dyn Progress,
    pub(crate) cancel: &'a Cancel,
}

impl PointStore {
    /// Reads the point cloud once.
    pub(crate) fn fill(
        source: &dyn PointSource,
        tiling: Tiling,
        filling: &PointStoreSetup<'_>,
    ) -> Result<Self> {
        Self::empty(tiling, filling.folder, filling.memory).filled(source, filling)
    }

    /// The store with the points of a point cloud, read once.
    pub(crate) fn filled(
        self,
        source: &dyn PointSource,
        filling: &PointStoreSetup<'_>,
    ) -> Result<Self> {
        self.filled_and(source, filling, &|_| Ok(()))
    }

    /// As [`filled`](Self::filled); also calls `also` with the points.
    pub(crate) fn filled_and(
        self,
        source: &dyn PointSource,
        filling: &PointStoreSetup<'_>,
        also: &(dyn Fn(&[Point]) -> Result<()> + Sync),
    ) -> Result<Self> {
        let census = self.read_all(source, filling, &|batch| {
            let near: Vec<Point>;
            let batch = match filling.within {
                None => batch,
                Some(window) => {
                    near = batch.iter().filter(|p| window.contains([p.x, p.y])).copied().collect();
                    &near
                }
            };
            also(batch)?;
            self.add(batch)
        })?;
        Ok(Self { census, losses: LostPoints::of(source), ..self })
    }

    /// The store with summaries of tiles and the hull only, without points.
    pub(crate) fn outline(self) -> Self {
        Self { outline: Some(Mutex::default()), ..self }
    }

    /// An empty store for about `memory` bytes of points, and more in a file in `folder`.
    pub(crate) fn empty(tiling: Tiling, folder: &Path, memory: u64) -> Self {
        let summaries = (0..tiling.count()).map(|_| Mutex::new(TileSummary::EMPTY)).collect();
        let points = Buckets::new(folder, tiling.count(), memory);
        Self {
            tiling,
            points,
            stored: PointTileIndexes::default(),
            selected: None,
            summaries,
            census: ReturnCounts::default(),
            losses: LostPoints::default(),
            limits: None,
            outline: None,
        }
    }

    /// The store with `limits`, if there are any.
    pub(crate) fn limited(self, limits: Option<PointStoreCoverage>) -> Self {
        Self { limits, ..self }
    }

    /// The store with further points in files.
    pub(crate) fn over(self, stored: PointTileIndexes) -> Self {
        for (square, summary) in stored.squares() {
            lock(&self.summaries[square]).merge(&summary);
        }
        Self { stored, ..self }
    }

    /// The store, keeping only points of these tiles.
    pub(crate) fn only(self, squares: impl Iterator<Item = usize>) -> Self {
        let mut selected = vec![false; self.tiling.count()];
        squares.for_each(|square| selected[square] = true);
        Self { selected: Some(selected), ..self }
    }

    /// True once a query needed points that it does not hold.
    pub(crate) fn is_exceeded(&self) -> bool {
        self.limits.as_ref().is_some_and(PointStoreCoverage::is_exceeded)
    }

    fn read_all(
        &self,
        source: &dyn PointSource,
        filling: &PointStoreSetup<'_>,
        take: &(dyn Fn(&[Point]) -> Result<()> + Sync),
    ) -> Result<ReturnCounts> {
        let census = Mutex::new(ReturnCounts::default());
        let parts = match &filling.within {
            Some(window) => parts_in(source, window),
            None => (0..source.parts()).collect(),
        };
        filling.progress.begin("read", parts.iter().map(|part| source.points_of(*part)).sum());
        workers::run(
            filling.threads,
            parts.len() as u64,
            filling.cancel,
            ReturnCounts::default,
            |counts, part| {
                let part = parts[part as usize];
                FileAt::report_part(filling.progress, source, part);
                let read = source.positions(part, &mut |batch| take(batch))?;
                counts.add(&read);
                filling.progress.advance(read.read);
                Ok(())
            },
            |counts| {
                lock(&census).add(&counts);
                Ok(())
            },
        )?;
        filling.progress.end();
        Ok(*lock(&census))
    }

    /// Adds points, in runs of the same tile.
    pub(crate) fn add(&self, points: &[Point]) -> Result<()> {
        if let Some(outline) = &self.outline {
            surround(outline, points);
        }
        for run in points.chunk_by(|a, b| self.tiling.square_of(*a) == self.tiling.square_of(*b)) {
            let square = self.tiling.square_of(run[0]);
            if self.selected.as_ref().is_some_and(|selected| !selected[square]) {
                continue;
            }
            lock(&self.summaries[square]).add(run);
            if self.outline.is_none() {
                self.points.push(square, run)?;
            }
        }
        Ok(())
    }

    /// The tiling.
    pub(crate) fn tiling(&self) -> &Tiling {
        &self.tiling
    }

    /// Files with skipped damage.
    pub(crate) fn losses(&self) -> &LostPoints {
        &self.losses
    }

    /// Statistics of the points read.
    pub(crate) fn census(&self) -> &ReturnCounts {
        &self.census
    }

    /// The summary of a tile; `None` if it is empty.
    pub(crate) fn summary(&self, square: usize) -> Option<TileSummary> {
        let summary = *lock(&self.summaries[square]);
        (summary.count > 0).then_some(summary)
    }

    /// Replaces `out` by the points of a tile, in canonical order.
    pub(crate) fn load(&self, square: usize, out: &mut Vec<Point>) -> Result<()> {
        out.clear();
        self.visit(square, |run| out.extend_from_slice(run))?;
        // Threads add points in any order; from here on all depends on the points alone.
        out.sort_unstable();
        Ok(())
    }

    /// Reads the points of a tile, a run at a time, in arbitrary order.
    pub(crate) fn visit(&self, square: usize, mut each: impl FnMut(&[Point])) -> Result<()> {
        self.stored.read(square, &mut each)?;
        self.points.read(square, each)
    }

    /// Points in the store.
    pub(crate) fn count(&self) -> u64 {
        self.summaries.iter().map(|summary| lock(summary).count).sum()
    }

    /// Number of points of the tiles that a window touches.
    pub(crate) fn points_near(&self, window: SiteWindow) -> u64 {
        let squares = self.tiling.touching(window);
        squares.filter_map(|square| Some(self.summary(square)?.count)).sum()
    }

    /// Replaces `out` by the points of a tile at distinct positions, in canonical order; keeps the lowest of
    /// points at one position.
    pub(crate) fn load_distinct(&self, square: usize, out: &mut Vec<Point>) -> Result<()> {
        self.load(square, out)?;
        out.dedup_by_key(|point| (point.x, point.y));
        Ok(())
    }

    /// The convex hull of all points.
    pub(crate) fn hull(&self) -> Result<ConvexHull> {
        if let Some(outline) = &self.outline {
            return Ok(lock(outline).clone());
        }
        let summaries = (0..self.tiling.count()).filter_map(|i| Some((i, self.summary(i)?)));
        let inner = ConvexHull::of(summaries.clone().map(|(_, summary)| summary.lowest).collect());
        let (mut hull, mut points) = (inner.clone(), Vec::new());
        for (square, TileSummary { window: SiteWindow { low, high }, .. }) in summaries {
            let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
            let locations = corners.map(|corner| inner.locate(FixedPosition::of(corner)));
            // A square with all corners inside the hull of the lowest points has no point of the whole hull.
            if locations.contains(&HullLocation::Outside) {
                self.load_distinct(square, &mut points)?;
                hull = hull.merge(&ConvexHull::of(points.clone()));
            }
        }
        Ok(hull)
    }

    /// True when every point that may lie in the disc lies in `known`.
    pub(crate) fn is_within(&self, disc: &CircumscribedDisc, known: &SiteWindow) -> bool {
        // Few discs reach beyond, and it takes no root to tell of most that they do not.
        disc.lies_in(known)
            || disc.clip(&self.tiling.window()).is_none_or(|part| known.covers(&part))
    }

    /// The tiles that may have a point in the disc.
    pub(crate) fn squares_in(&self, disc: CircumscribedDisc) -> impl Iterator<Item = usize> {
        let part = disc.clip(&self.tiling.window());
        let rows = part.map(|part| {
            let [low, high] = [part.low, part.high].map(|at| self.tiling.tile_of(at));
            (low[1]..=high[1]).flat_map(move |row| self.row_in(disc, row, [low[0], high[0]]))
        });
        rows.into_iter().flatten().filter(move |&square| {
            self.summary(square).is_some_and(|summary| disc.clip(&summary.window).is_some())
        })
    }

    /// The tiles of a row, between two columns.
    fn row_in(
        &self,
        disc: CircumscribedDisc,
        row: u32,
        [first, last]: [u32; 2],
    ) -> impl Iterator<Item = usize> + use<> {
        let (tiling, strip) = (self.tiling, self.tiling.window_of(self.tiling.square([0, row])));
        let west_to_east = SiteWindow {
            low: [tiling.window().low[0], strip.low[1]],
            high: [tiling.window().high[0], strip.high[1]],
        };
        let part = disc.clip(&west_to_east);
        let columns = part.map(|part| [part.low, part.high].map(|at| tiling.tile_of(at)[0]));
        let columns = columns.map(|[low, high]| low.max(first)..=high.min(last));
        columns.into_iter().flatten().map(move |col| tiling.square([col, row]))
    }

    /// Bytes that went to the temporary file.
    pub(crate) fn spilled(&self) -> u64 {
        self.points.spilled()
    }
}

/// Extends a hull by points.
fn surround(hull: &Mutex<ConvexHull>, points: &[Point]) {
    // Points are tested against a copy, so threads do not wait for each other. Hulls only grow: an older
    // one lets more points through, never fewer.
    let known = lock(hull).clone();
    let beyond = points
        .iter()
        .filter(|p| known.locate(FixedPosition::of([p.x, p.y])) != HullLocation::Inside);
    let beyond = ConvexHull::of(beyond.copied().collect());
    let mut hull = lock(hull);
    *hull = hull.merge(&beyond);
}
