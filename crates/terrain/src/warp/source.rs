//! The grid on its new lattice, read by window.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::mapping::CrsTransform;
use terrane_base::error::Result;
use terrane_base::geom::{Affine, Rect};
use terrane_raster::{GridInfo, GridSource, SampleType};
use terrane_window::resample::{Place, ResamplingMethod, Scale, SourceWindow};

/// Most samples of the grid that are held for a piece of the output, unless a single height needs more.
pub(super) const MAX_SAMPLES: usize = 1 << 18;

/// Most columns and rows of a piece.
const MOST_SIDE: f64 = 128.0;

/// Samples of the grid along a piece, about: well below the root of [`MAX_SAMPLES`], so that pieces are seldom halved.
const USUAL_SPAN: f64 = 256.0;

/// Block size of the output.
pub(super) const BLOCK: (u32, u32) = (256, 256);

/// Bytes that a thread holds: samples of the grid, positions and heights of a piece, and a share of the
/// operations.
pub(super) const WORKER_BYTES: u64 =
    (MAX_SAMPLES * 8 + (MOST_SIDE * MOST_SIDE) as usize * 24) as u64 + (3 << 20);

/// A grid on another lattice.
pub(super) struct WarpedGrid {
    info: GridInfo,
    inner: Box<dyn GridSource>,
    transform: CrsTransform,
    resampling: &'static ResamplingMethod,
    scale: Scale,
    /// Heights are computed, and rounded to the sample type.
    is_made: bool,
    /// Columns and rows are parallel to those of the grid.
    is_parallel: bool,
    /// Columns of a turn around the globe, for grids in degrees.
    turn: Option<f64>,
    /// Columns and rows of a piece.
    side: u32,
    /// Number of samples that cannot be transformed to the CRS of the grid.
    nowhere: Arc<AtomicU64>,
}

/// Buffers of a piece.
#[derive(Default)]
struct WarpBuffers {
    places: Vec<Place>,
    /// Columns and rows in the grid, if these are parallel.
    axes: [Vec<f64>; 2],
    samples: Vec<f64>,
    heights: Vec<f64>,
}

impl WarpedGrid {
    pub(super) fn new(
        info: GridInfo,
        inner: Box<dyn GridSource>,
        transform: CrsTransform,
        resampling: &'static ResamplingMethod,
        scale: Scale,
        is_made: bool,
        nowhere: Arc<AtomicU64>,
    ) -> Self {
        let [across, down] = scale.get();
        let side = (USUAL_SPAN / across.max(down)).clamp(1.0, MOST_SIDE) as u32;
        let own = inner.info();
        let is_turned = own.crs.horizontal_unit() == "degree"
            && (own.transform.b, own.transform.d) == (0.0, 0.0);
        let turn = is_turned.then(|| 360.0 / own.transform.a.abs());
        let is_upright = |map: &Affine| (map.b, map.d) == (0.0, 0.0);
        let is_parallel =
            transform.is_none() && [&info.transform, &own.transform].into_iter().all(is_upright);
        Self {
            info,
            inner,
            transform,
            resampling,
            scale,
            is_made,
            is_parallel,
            turn,
            side,
            nowhere,
        }
    }

    pub(super) fn scale(&self) -> Scale {
        self.scale
    }

    /// False if a rectangle of the lattice has no sample of the grid, by some of its positions: those between them are no
    /// farther away than the next.
    pub(super) fn is_near(&self, rect: Rect) -> bool {
        const STEPS: usize = 8;
        let map = &self.inner.info().transform;
        let [width, height] = [rect.width, rect.height].map(f64::from);
        let lines: [[Place; STEPS + 1]; STEPS + 1] = std::array::from_fn(|down| {
            let mut line = std::array::from_fn(|across| {
                let share = [across, down].map(|step| step as f64 / STEPS as f64);
                let [col, row] = [rect.col, rect.row].map(|first| f64::from(first) - 0.5);
                self.info.transform.apply(col + share[0] * width, row + share[1] * height)
            });
            self.transform.inverse_line(&mut line);
            line.map(|[x, y]| map.invert(x, y))
        });
        if lines.iter().flatten().flatten().any(|at| !at.is_finite()) {
            return true;
        }
        let sides = [self.inner.info().width, self.inner.info().height].map(f64::from);
        [0, 1].into_iter().all(|axis| {
            let all = || lines.iter().flatten().map(|place| place[axis]);
            let [low, high] = [all().fold(f64::MAX, f64::min), all().fold(f64::MIN, f64::max)];
            let along = lines.iter().flat_map(|line| line.windows(2).map(|two| [two[0], two[1]]));
            let across = lines.windows(2).flat_map(|two| two[0].into_iter().zip(two[1]));
            let steps = along.chain(across.map(|(one, other)| [one, other]));
            let step = steps.map(|[a, b]| (a[axis] - b[axis]).abs()).fold(1.0, f64::max);
            let turns = self.turn.filter(|_| axis == 0).map_or([0.0; 3], |turn| [0.0, turn, -turn]);
            let is_on = |by: f64| low - step + by < sides[axis] && high + step + by > -1.0;
            turns.into_iter().any(is_on)
        })
    }

    /// Hands on each piece of a rectangle with its heights.
    fn each(&self, rect: Rect, visit: &mut dyn FnMut(Rect, &[f64])) -> Result<()> {
        let mut buffers = WarpBuffers::default();
        // Low rectangles are cut less often.
        let wide = if self.is_parallel { self.side * self.side / rect.height.max(1) } else { 0 };
        let wide = wide.max(self.side);
        for row in (rect.row..rect.end_row()).step_by(self.side as usize) {
            for col in (rect.col..rect.end_col()).step_by(wide as usize) {
                let piece = Rect::new(col, row, wide, self.side).intersect(&rect);
                self.piece(piece, &mut buffers, visit)?;
            }
        }
        Ok(())
    }

    /// Resamples a piece, in halves if it needs too many samples of the grid.
    fn piece(
        &self,
        piece: Rect,
        buffers: &mut WarpBuffers,
        visit: &mut dyn FnMut(Rect, &[f64]),
    ) -> Result<()> {
        let mut left = vec![piece];
        while let Some(piece) = left.pop() {
            let grid = [self.inner.info().width, self.inner.info().height];
            let (nowhere, needed) = if self.is_parallel {
                self.place_axes(piece, &mut buffers.axes);
                let axes = buffers.axes.each_ref().map(|axis| &axis[..]);
                (0, self.resampling.needed_on_axes(grid, axes, self.scale))
            } else {
                let nowhere = self.place(piece, &mut buffers.places);
                (nowhere, self.resampling.needed(grid, &buffers.places, self.scale))
            };
            if needed.len() > MAX_SAMPLES && piece.len() > 1 {
                left.extend(halves(piece));
                continue;
            }
            // Not before this point: pieces that are halved are placed again.
            self.nowhere.fetch_add(nowhere, Ordering::Relaxed);
            self.fill(piece.len(), needed, grid, buffers)?;
            visit(piece, &buffers.heights);
        }
        Ok(())
    }

    /// Positions of the samples of a piece in the grid; returns the number that cannot be transformed.
    fn place(&self, piece: Rect, places: &mut Vec<Place>) -> u64 {
        let map = &self.inner.info().transform;
        places.clear();
        for row in piece.row..piece.end_row() {
            let first = places.len();
            let line = piece.col..piece.end_col();
            places
                .extend(line.map(|col| self.info.transform.apply(f64::from(col), f64::from(row))));
            self.transform.inverse_line(&mut places[first..]);
        }
        // Positions that cannot be transformed stay NaN.
        for at in places.iter_mut() {
            let [col, row] = map.invert(at[0], at[1]);
            *at = [self.turned(col), row];
        }
        places.iter().filter(|at| at[0].is_nan()).count() as u64
    }

    /// Columns and rows of a piece in the grid, as [`place`](Self::place) computes them.
    fn place_axes(&self, piece: Rect, [columns, rows]: &mut [Vec<f64>; 2]) {
        let (own, map) = (&self.info.transform, &self.inner.info().transform);
        let place = |col: u32, row: u32| {
            let [x, y] = own.apply(f64::from(col), f64::from(row));
            map.invert(x, y)
        };
        columns.clear();
        columns
            .extend((piece.col..piece.end_col()).map(|col| self.turned(place(col, piece.row)[0])));
        rows.clear();
        rows.extend((piece.row..piece.end_row()).map(|row| place(piece.col, row)[1]));
    }

    /// A column, or that a turn away if only it is in the grid.
    #[inline]
    fn turned(&self, col: f64) -> f64 {
        let end = f64::from(self.inner.info().width) - 0.5;
        match self.turn {
            Some(turn) if col < -0.5 && col + turn <= end => col + turn,
            Some(turn) if col > end && col - turn >= -0.5 => col - turn,
            _ => col,
        }
    }

    /// Finds the heights of a piece.
    fn fill(
        &self,
        count: usize,
        needed: Rect,
        grid: [u32; 2],
        buffers: &mut WarpBuffers,
    ) -> Result<()> {
        let WarpBuffers { places, axes, samples, heights } = buffers;
        heights.clear();
        heights.resize(count, f64::NAN);
        if needed.is_empty() {
            return Ok(());
        }
        samples.clear();
        samples.resize(needed.len(), 0.0);
        self.inner.read_f64(needed, samples)?;
        self.inner.copied(needed);
        let window = SourceWindow { grid, rect: needed, heights: samples };
        if self.is_parallel {
            let axes = axes.each_ref().map(|axis| &axis[..]);
            self.resampling.heights_on_axes(&window, axes, self.scale, heights);
        } else {
            self.resampling.heights(&window, places, self.scale, heights);
        }
        if self.is_made { self.settle(places, heights) } else { Ok(()) }
    }

    /// Heights in the vertical CRS of the output, rounded to its type.
    fn settle(&self, places: &[Place], heights: &mut [f64]) -> Result<()> {
        if !self.transform.keeps_heights() {
            let map = &self.inner.info().transform;
            let valid = places.iter().zip(&mut *heights).filter(|(_, height)| !height.is_nan());
            for (place, height) in valid {
                *height = self.transform.height(map.apply(place[0], place[1]), *height)?;
            }
        }
        if self.info.sample_type == SampleType::F32 {
            heights.iter_mut().for_each(|height| *height = f64::from(*height as f32));
        }
        Ok(())
    }
}

/// Two parts of a rectangle of more than one sample.
fn halves(rect: Rect) -> [Rect; 2] {
    let Rect { col, row, width, height } = rect;
    if width > height {
        let half = width / 2;
        [Rect::new(col, row, half, height), Rect::new(col + half, row, width - half, height)]
    } else {
        let half = height / 2;
        [Rect::new(col, row, width, half), Rect::new(col, row + half, width, height - half)]
    }
}

/// Copies the heights of a piece into those of a rectangle, where they overlap.
pub(super) fn put<H>(
    out: &mut [H],
    rect: Rect,
    piece: Rect,
    heights: &[f64],
    of: impl Fn(f64) -> H,
) {
    let both = piece.intersect(&rect);
    for row in both.row..both.end_row() {
        let first =
            |of: Rect| (row - of.row) as usize * of.width as usize + (both.col - of.col) as usize;
        let heights = &heights[first(piece)..][..both.width as usize];
        for (out, height) in out[first(rect)..].iter_mut().zip(heights) {
            *out = of(*height);
        }
    }
}

impl GridSource for WarpedGrid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.each(rect, &mut |piece, heights| put(out, rect, piece, heights, |z| z as f32))
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.each(rect, &mut |piece, heights| put(out, rect, piece, heights, |z| z))
    }

    fn block_bytes(&self) -> u64 {
        self.inner.block_bytes()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.inner.members()
    }
}
