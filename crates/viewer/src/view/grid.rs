//! A grid as a field of heights: read in windows, averaged down, and laid under the picture.

use std::sync::Mutex;

use rayon::prelude::*;

use crate::render::{PictureFrame, PictureHeights, average_rows};
use crate::view::drawn::{DrawnSurface, FINENESS, frame};
use crate::view::options::ViewJob;
use terrane_base::error::Result;
use terrane_base::geom::{Affine, Rect};
use terrane_engine::input::{window_samples, workers};
use terrane_engine::{Cancel, Progress, Resources};
use terrane_raster::{GridInfo, GridSource};

pub(super) fn draw(
    grid: &dyn GridSource,
    job: &ViewJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<DrawnSurface> {
    let info = grid.info();
    let cell = info.transform.a.hypot(info.transform.b);
    let frame = frame(job, grid_bounds(info, 0.5), Some(cell), info.crs.geographic == Some(true))?;
    let fine = frame.finer(FINENESS);
    let plan = GridReadPlan::new(info, &frame);
    let coarse = plan.read(grid, &job.options.resources, progress, cancel)?;
    let field =
        workers(&job.options.resources)?.install(|| plan.lay(&coarse, &fine, &info.transform));
    Ok(DrawnSurface { frame, field, edges: None, colours: None })
}

/// World rectangle around the samples, widened by `margin` cells: west, south, east, north.
pub(crate) fn grid_bounds(info: &GridInfo, margin: f64) -> [f64; 4] {
    let (right, bottom) =
        (f64::from(info.width) - 1.0 + margin, f64::from(info.height) - 1.0 + margin);
    let corners = [(-margin, -margin), (right, -margin), (-margin, bottom), (right, bottom)];
    let world = corners.map(|(col, row)| info.transform.apply(col, row));
    corner_bounds(world)
}

/// The box around four corners: lowest x and y, highest x and y.
pub(crate) fn corner_bounds(corners: [[f64; 2]; 4]) -> [f64; 4] {
    let [xs, ys] = [0, 1].map(|axis| corners.map(|corner| corner[axis]));
    let [west, south] = [xs, ys].map(|all| all.into_iter().fold(f64::INFINITY, f64::min));
    let [east, north] = [xs, ys].map(|all| all.into_iter().fold(f64::NEG_INFINITY, f64::max));
    [west, south, east, north]
}

/// Maximum number of samples under a picture that are all read.
const EXACT_SAMPLES: u64 = 1 << 26;
/// Maximum number of samples read of larger grids, unless the picture has more pixels.
const SPARSE_SAMPLES: u64 = 1 << 22;

/// The samples to read, and the stride of the coarser field made from them.
struct GridReadPlan {
    /// Samples under the picture, with a margin.
    crop: Rect,
    /// Samples per height of the coarse field, along each side.
    stride: u32,
    /// Samples read for a height, along each side: all of them, or a few in their middle.
    patch: u32,
    /// Natural block of the source.
    block: (u32, u32),
}

impl GridReadPlan {
    /// Averages all samples, at twice the fineness of the picture, as long as they are at most
    /// [`EXACT_SAMPLES`]; of more it samples a few for each pixel.
    fn new(info: &GridInfo, frame: &PictureFrame) -> Self {
        let exact = Self::averaging(info, &frame.finer(FINENESS));
        if exact.crop.len() as u64 <= EXACT_SAMPLES || exact.stride == 1 {
            return exact;
        }
        let sparse = Self::averaging(info, frame);
        let (width, height) = sparse.coarse_size();
        let each = SPARSE_SAMPLES / (u64::from(width) * u64::from(height));
        let patch = each.isqrt().clamp(1, u64::from(sparse.stride)) as u32;
        Self { patch, ..sparse }
    }

    fn averaging(info: &GridInfo, lattice: &PictureFrame) -> Self {
        let [px, py] = lattice.pixel();
        let samples_per_pixel = (px * py / info.transform.determinant().abs()).sqrt();
        let longest = info.width.max(info.height);
        let stride = (samples_per_pixel as u32).clamp(1, longest);
        Self { crop: crop(info, lattice, stride), stride, patch: stride, block: info.block }
    }

    fn coarse_size(&self) -> (u32, u32) {
        (self.crop.width.div_ceil(self.stride), self.crop.height.div_ceil(self.stride))
    }

    /// Reads and averages the crop, chunk by chunk.
    fn read(
        &self,
        grid: &dyn GridSource,
        resources: &Resources,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<PictureHeights> {
        let (width, height) = self.coarse_size();
        let coarse = Mutex::new(PictureHeights::void(width as usize, height as usize));
        progress.begin("read", self.crop.len() as u64);
        let chunks = self.chunks(window_samples(resources));
        workers(resources)?.install(|| {
            chunks.par_iter().try_for_each(|&chunk| {
                cancel.check()?;
                let means = match self.patch == self.stride {
                    true => self.average(grid, chunk, window_samples(resources))?,
                    false => self.sample(grid, chunk)?,
                };
                place(&mut coarse.lock().unwrap_or_else(|e| e.into_inner()), chunk, &means);
                progress.advance(self.samples_of(chunk).len() as u64);
                Ok(())
            })
        })?;
        progress.end();
        Ok(coarse.into_inner().unwrap_or_else(|e| e.into_inner()))
    }

    /// Rectangles of the coarse field, each about a row of source blocks high, and wide enough to
    /// hold about `max_samples` samples.
    fn chunks(&self, max_samples: u64) -> Vec<Rect> {
        let (width, height) = self.coarse_size();
        let (stride, patch) = (u64::from(self.stride), u64::from(self.patch));
        let block_rows = u64::from(self.block.1).min(max_samples / patch / patch).max(1);
        let rows = block_rows.div_ceil(stride).min(u64::from(height)) as u32;
        let cols = max_samples / (u64::from(rows) * patch * patch);
        let cols = cols.clamp(1, u64::from(width)) as u32;
        let field = Rect::new(0, 0, width, height);
        let columns = (0..width).step_by(cols as usize);
        (0..height)
            .step_by(rows as usize)
            .flat_map(|row| columns.clone().map(move |col| Rect::new(col, row, cols, rows)))
            .map(|chunk| chunk.intersect(&field))
            .collect()
    }

    /// The samples behind a rectangle of the coarse field.
    fn samples_of(&self, chunk: Rect) -> Rect {
        let n = self.stride;
        let (col, row) = (self.crop.col + chunk.col * n, self.crop.row + chunk.row * n);
        Rect::new(col, row, chunk.width * n, chunk.height * n).intersect(&self.crop)
    }

    /// Heights of a rectangle of the coarse field. Where a row of them covers more than `max_samples`
    /// samples, only its middle rows of samples are averaged.
    fn average(&self, grid: &dyn GridSource, chunk: Rect, max_samples: u64) -> Result<Vec<f32>> {
        let mut means = vec![0.0; chunk.len()];
        let rows_at_once = (max_samples / u64::from(self.samples_of(chunk).width)).max(1);
        let mut samples = Vec::new();
        for (row, line) in means.chunks_exact_mut(chunk.width as usize).enumerate() {
            let line_of_chunk = Rect::new(chunk.col, chunk.row + row as u32, chunk.width, 1);
            let mut rect = self.samples_of(line_of_chunk);
            let rows = rect.height.min(u32::try_from(rows_at_once).unwrap_or(u32::MAX));
            (rect.row, rect.height) = (rect.row + (rect.height - rows) / 2, rows);
            samples.resize(rect.len(), 0.0);
            grid.read_f32(rect, &mut samples)?;
            average_rows(&samples, rect.width as usize, self.stride as usize, line);
        }
        grid.release(self.samples_of(chunk));
        Ok(means)
    }

    /// Heights of a rectangle of the coarse field, each from a few samples in its middle.
    fn sample(&self, grid: &dyn GridSource, chunk: Rect) -> Result<Vec<f32>> {
        let mut means = vec![0.0; chunk.len()];
        let mut samples = Vec::new();
        for (i, mean) in (0..).zip(&mut means) {
            let (col, row) = (chunk.col + i % chunk.width, chunk.row + i / chunk.width);
            let rect = middle(self.samples_of(Rect::new(col, row, 1, 1)), self.patch);
            samples.resize(rect.len(), 0.0);
            grid.read_f32(rect, &mut samples)?;
            let width = rect.width as usize;
            average_rows(&samples, width, width, std::slice::from_mut(mean));
        }
        grid.release(self.samples_of(chunk));
        Ok(means)
    }

    /// Heights at the pixels of a frame, from the coarse field.
    fn lay(
        &self,
        coarse: &PictureHeights,
        fine: &PictureFrame,
        transform: &Affine,
    ) -> PictureHeights {
        let mut field = PictureHeights::void(fine.width as usize, fine.height as usize);
        let n = f64::from(self.stride);
        // The centre of a pixel in the coarse field: an affine function of its column.
        let place = |col: f64, row: usize| {
            let [x, y] = fine.to_world(col + 0.5, row as f64 + 0.5);
            let [c, r] = transform.invert(x, y);
            let to_coarse = |at: f64, first: u32| (at - f64::from(first) + 0.5) / n - 0.5;
            [to_coarse(c, self.crop.col), to_coarse(r, self.crop.row)]
        };
        let last = f64::from(fine.width.max(2) - 1);
        field.z.par_chunks_mut(fine.width as usize).enumerate().for_each(|(row, line)| {
            let (from, to) = (place(0.0, row), place(last, row));
            let step = [0, 1].map(|axis| (to[axis] - from[axis]) / last);
            for (col, z) in line.iter_mut().enumerate() {
                let col = col as f64;
                *z = coarse.bilinear(from[0] + col * step[0], from[1] + col * step[1]);
            }
        });
        field
    }
}

/// The samples a frame needs, with a margin for interpolation, starting at a multiple of `stride`
/// so that a part of a picture shows the same averages as the whole.
fn crop(info: &GridInfo, fine: &PictureFrame, stride: u32) -> Rect {
    let [west, south, east, north] = fine.bounds;
    let corners = [(west, north), (east, north), (west, south), (east, south)];
    let lattice = corners.map(|(x, y)| info.transform.invert(x, y));
    let [left, top, right, bottom] = corner_bounds(lattice);
    let (col, width) = crop_along(left, right, stride, info.width);
    let (row, height) = crop_along(top, bottom, stride, info.height);
    Rect::new(col, row, width, height)
}

/// First and number of samples along an axis of `count`, from `low` to `high` with two strides of margin.
fn crop_along(low: f64, high: f64, stride: u32, count: u32) -> (u32, u32) {
    let margin = 2.0 * f64::from(stride);
    let first = (low - margin).clamp(0.0, f64::from(count - 1)) as u32 / stride * stride;
    let last = (high + margin).clamp(f64::from(first), f64::from(count - 1)) as u32;
    (first, last - first + 1)
}

/// The middle of a rectangle, at most `side` samples along each side.
fn middle(rect: Rect, side: u32) -> Rect {
    let (width, height) = (rect.width.min(side), rect.height.min(side));
    let (col, row) = ((rect.width - width) / 2, (rect.height - height) / 2);
    Rect::new(rect.col + col, rect.row + row, width, height)
}

fn place(field: &mut PictureHeights, chunk: Rect, means: &[f32]) {
    for (row, line) in means.chunks_exact(chunk.width as usize).enumerate() {
        let start = (chunk.row as usize + row) * field.width + chunk.col as usize;
        field.z[start..start + line.len()].copy_from_slice(line);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;
    use terrane_engine::Silent;
    use terrane_raster::SampleType;

    /// A plane of any size that counts the samples read of it.
    struct Plane {
        info: GridInfo,
        read: AtomicU64,
    }

    impl Plane {
        fn new(side: u32) -> Self {
            let info = GridInfo {
                block: (512, 512),
                ..GridInfo::plain("test", side, side, SampleType::F32)
            };
            Self { info, read: AtomicU64::new(0) }
        }

        /// Heights under a picture `width` pixels wide, and how many samples that took.
        fn picture(&self, width: u32) -> (PictureHeights, u64) {
            let frame = PictureFrame::fit(grid_bounds(&self.info, 0.5), width, [1.0, 1.0]);
            let plan = GridReadPlan::new(&self.info, &frame);
            let resources = Resources::default();
            let coarse = plan.read(self, &resources, &Silent, &Cancel::default()).unwrap();
            let field = plan.lay(&coarse, &frame.finer(FINENESS), &self.info.transform);
            (field, self.read.load(Ordering::Relaxed))
        }
    }

    impl GridSource for Plane {
        fn info(&self) -> &GridInfo {
            &self.info
        }

        fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
            self.read.fetch_add(rect.len() as u64, Ordering::Relaxed);
            for (i, z) in (0..).zip(out) {
                *z = (rect.col + i % rect.width) as f32 + (rect.row + i / rect.width) as f32;
            }
            Ok(())
        }

        fn read_f64(&self, _: Rect, _: &mut [f64]) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn of_enormous_grids_few_samples_are_read() {
        for (side, width) in [(1 << 30, 100), (1_000_000, 300), (8200, 16), (100_000, 1)] {
            let (field, read) = Plane::new(side).picture(width);
            assert!(read <= SPARSE_SAMPLES, "{side}, {width}: {read}");
            let slope = f64::from(side) / field.width as f64;
            for (i, &z) in field.z.iter().enumerate().filter(|_| width > 1) {
                let (col, row) = (i % field.width, i / field.width);
                let inner = |at: usize| (2..field.width - 2).contains(&at);
                let expected = (col + row + 1) as f64 * slope;
                let near = (f64::from(z) - expected).abs() <= 2.0 * slope;
                assert!(near || !inner(col) || !inner(row), "{side}: {z} at {col}, {row}");
            }
        }
    }

    #[test]
    fn of_grids_up_to_the_limit_every_sample_is_read_once() {
        let (_, read) = Plane::new(8192).picture(16);
        assert_eq!(read, EXACT_SAMPLES);
    }
}
