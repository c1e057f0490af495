//! The spike-free surface of all returns, tile by tile: heights at the centres of cells, computed before
//! writing.
//!
//! Where the circle of a triangle reaches beyond the window of its tile, as in wide voids and along the border
//! of the point cloud, and where there is no triangle, the height is that of the plain triangulation of all
//! returns. Without frozen triangles the result is the plain triangulation.

use std::collections::BTreeMap;
use std::ops::Range;

use super::super::budget::GridBudget;
use super::super::extent::CellRequest;
use super::super::neighbours::{CellCenters, CloudSurfaces};
use super::context::{STORES, SurfaceModelContext, too_little};
use super::first_returns::CanopySurface;
use super::tiles::{SpikeFreeTally, SpikeFreeTiles};
use crate::point_index::{PointStore, has_short_edges};
use terrane_base::error::Result;
use terrane_base::geom::{Point, PointFrame, Rect};
use terrane_delaunay::{CircumscribedDisc, FixedPosition, SiteWindow, SpikeFree, interpolate};
use terrane_engine::workers;
use terrane_files::Buckets;
use terrane_gridding::Statistic;

/// Bytes for each point in the window of a tile.
const BYTES_PER_POINT: u64 = 96;
/// Inverse fraction of the memory of a store for the heights.
const HEIGHTS: u64 = 4;
/// Marks a height from the plain triangulation.
const PLAIN: f64 = f64::INFINITY;

/// Estimated number of points in the window of a tile, before the points are read: for an even point cloud with
/// many returns per pulse.
pub(super) const USUAL: u64 = 1 << 18;

/// Least memory for a tile with `points` points in its window.
pub(super) fn min_memory(points: u64) -> u64 {
    let square = points.saturating_mul(BYTES_PER_POINT).div_ceil(HEIGHTS - 1);
    GridBudget::with_points(square.saturating_mul(STORES * HEIGHTS))
}

/// Heights of the surface, by tile.
pub(super) struct BySquare {
    /// The plain triangulation of all returns.
    plain: CloudSurfaces,
    /// Columns and rows by tile.
    spans: [Spans; 2],
    /// Bucket of the heights of each tile, row by row.
    numbers: BTreeMap<[i32; 2], usize>,
    heights: Buckets<f64>,
}

/// Columns, or rows, whose centres lie in the tiles along an axis.
type Spans = BTreeMap<i32, Range<u32>>;

/// Columns, or rows, of a tile.
struct TileSpan {
    tile: i32,
    all: Range<u32>,
    /// Those of them that are requested.
    part: Range<u32>,
}

/// The tiles with columns, or rows, among `count` from `first` on.
fn spans_within(spans: &Spans, first: u32, count: u32) -> Vec<TileSpan> {
    let spans = spans.iter().map(|(tile, all)| {
        let part = all.start.max(first)..all.end.min(first + count);
        TileSpan { tile: *tile, all: all.clone(), part }
    });
    spans.filter(|span| !span.part.is_empty()).collect()
}

impl CanopySurface for BySquare {
    fn values(&self, piece: CellRequest<'_>, out: &mut [f64]) -> Result<()> {
        out.fill(PLAIN);
        let ([xs, ys], rect) = (&self.spans, piece.rect);
        let cols = spans_within(xs, rect.col, rect.width);
        for y in spans_within(ys, rect.row, rect.height) {
            for x in &cols {
                let Some(number) = self.numbers.get(&[x.tile, y.tile]) else { continue };
                for row in y.part.clone() {
                    let first = (row - y.all.start) as usize * x.all.len()
                        + (x.part.start - x.all.start) as usize;
                    let place = (row - rect.row) as usize * rect.width as usize
                        + (x.part.start - rect.col) as usize;
                    let line = &mut out[place..][..x.part.len()];
                    self.heights.read_from(*number, first as u64, line)?;
                }
            }
        }
        self.fill_plain(piece, out)
    }

    fn is_exceeded(&self) -> bool {
        self.plain.store().is_exceeded()
    }

    fn spilled(&self) -> u64 {
        self.plain.spilled_bytes() + self.heights.spilled()
    }
}

impl BySquare {
    /// Computes the heights from the points of `all`, for the counted tiles.
    pub(super) fn new(
        all: PointStore,
        tally: SpikeFreeTally,
        frame: PointFrame,
        context: &SurfaceModelContext<'_>,
    ) -> Result<Self> {
        let squares = tally.squares;
        let (width, height) = context.extent.lattice.size();
        let centres = CellCenters::new(context.extent, Rect::new(0, 0, width, height), &frame);
        let spans = spans(&squares, &centres);
        let mut counts = tally.counts();
        counts.retain(|[x, y], _| spans[0].contains_key(x) && spans[1].contains_key(y));
        let max_points = counts.values().copied().max().unwrap_or(0);
        let threads = threads(max_points, context)?;
        let numbers: BTreeMap<_, _> = counts.keys().copied().zip(0..).collect();
        let heights =
            Buckets::new(context.folder(), counts.len(), context.store_memory() / HEIGHTS);
        let plain = CloudSurfaces::new(all, frame)?;
        let surface = Self { plain, spans, numbers, heights };
        let work = SpikeFreeContext { made: &surface, squares, centres, frame, context };
        let counts: Vec<_> = counts.into_iter().collect();
        let (progress, units) = (context.progress, counts.len() as u64);
        progress.begin("surface", units);
        workers::run(
            threads,
            units,
            context.cancel,
            || (),
            |(), number| {
                let (square, points) = counts[number as usize];
                work.fill(number as usize, square, points as usize)?;
                progress.advance(1);
                Ok(())
            },
            Ok,
        )?;
        progress.end();
        Ok(surface)
    }

    /// Fills in heights of the plain triangulation where marked.
    fn fill_plain(&self, piece: CellRequest<'_>, out: &mut [f64]) -> Result<()> {
        let (rect, width) = (piece.rect, piece.rect.width as usize);
        let marked = out.iter().enumerate().filter(|(_, height)| **height == PLAIN);
        let ends = marked.map(|(k, _)| [k % width, k / width]).fold(None, |ends, at| {
            let [low, high] = ends.unwrap_or([at; 2]);
            Some([[0, 1].map(|i| at[i].min(low[i])), [0, 1].map(|i| at[i].max(high[i]))])
        });
        let Some([low, high]) = ends else { return Ok(()) };
        let size = [0, 1].map(|i| high[i] - low[i] + 1);
        let part = Rect::new(
            rect.col + low[0] as u32,
            rect.row + low[1] as u32,
            size[0] as u32,
            size[1] as u32,
        );
        let mut plain = vec![f64::NAN; size[0] * size[1]];
        self.plain.values(
            Statistic::linear(None),
            CellRequest { rect: part, ..piece },
            &mut plain,
        )?;
        for (row, line) in plain.chunks(size[0]).enumerate() {
            let heights = &mut out[(low[1] + row) * width + low[0]..][..size[0]];
            let marked = heights.iter_mut().zip(line).filter(|(height, _)| **height == PLAIN);
            marked.for_each(|(height, plain)| *height = *plain);
        }
        Ok(())
    }
}

/// The tiles of columns and rows.
fn spans(squares: &SpikeFreeTiles, centres: &CellCenters) -> [Spans; 2] {
    let at = centres.positions();
    [(0, at.xs), (1, at.ys)].map(|(axis, steps)| {
        let mut spans = Spans::new();
        for (number, &steps) in (0..).zip(steps) {
            let square = squares.along(FixedPosition::from_steps(steps, steps).floor()[axis]);
            spans.entry(square).or_insert(number..number).end = number + 1;
        }
        spans
    })
}

/// Number of threads that fit into memory; fails if none does.
fn threads(points: u64, context: &SurfaceModelContext<'_>) -> Result<usize> {
    let memory = context.store_memory() / HEIGHTS * (HEIGHTS - 1);
    let square = points * BYTES_PER_POINT;
    if square > memory {
        let what = "a tile of the spike-free surface";
        let other = "‹canopy› pit-free, or a shorter freeze";
        return Err(too_little(what, min_memory(points), context.job.resources.memory, other));
    }
    Ok((memory / square.max(1)).min(context.threads as u64) as usize)
}

/// Context of a tile.
struct SpikeFreeContext<'a> {
    made: &'a BySquare,
    squares: SpikeFreeTiles,
    centres: CellCenters,
    frame: PointFrame,
    context: &'a SurfaceModelContext<'a>,
}

impl SpikeFreeContext<'_> {
    /// Computes the heights of a tile with this number of points in its window.
    fn fill(&self, number: usize, square: [i32; 2], points: usize) -> Result<()> {
        let window = self.squares.window(square);
        let (store, mut near) = (self.made.plain.store(), Vec::with_capacity(points));
        for part in store.tiling().touching(window) {
            store.visit(part, |run| {
                near.extend(run.iter().filter(|p| window.contains([p.x, p.y])).copied());
            })?;
        }
        let surface = SpikeFree::new(near, &window, self.squares.freeze)?;
        let [cols, rows] = [0, 1].map(|i| self.made.spans[i].get(&square[i]).cloned());
        let (cols, rows) = (cols.unwrap_or_default(), rows.unwrap_or_default());
        let (at, mut last, mut line) = (self.centres.positions(), 0, Vec::new());
        for row in rows {
            line.clear();
            for col in cols.clone() {
                let at = FixedPosition::from_steps(at.xs[col as usize], at.ys[row as usize]);
                line.push(self.height(&surface, &window, at, &mut last));
            }
            self.made.heights.push(number, &line)?;
        }
        Ok(())
    }

    /// The height at a position; on the shared side of two triangles, that of the one without a long edge.
    fn height(
        &self,
        surface: &SpikeFree,
        window: &SiteWindow,
        at: FixedPosition,
        last: &mut u32,
    ) -> f64 {
        match self.height_in(surface.find(at, last, false), window, at) {
            void if void.is_nan() => match surface.find(at, last, true) {
                None => void,
                behind => self.height_in(behind, window, at),
            },
            height => height,
        }
    }

    fn height_in(
        &self,
        found: Option<([Point; 3], bool)>,
        window: &SiteWindow,
        at: FixedPosition,
    ) -> f64 {
        let Some((corners, is_small)) = found else { return PLAIN };
        if !is_small {
            let disc = CircumscribedDisc::around(corners.map(|p| [p.x, p.y]));
            if !self.made.plain.store().is_within(&disc, window) {
                return PLAIN;
            }
        }
        match has_short_edges(&corners, &self.frame, self.context.job.max_edge) {
            true => interpolate(&corners, at) * self.frame.scale[2] + self.frame.offset[2],
            false => f64::NAN,
        }
    }
}
