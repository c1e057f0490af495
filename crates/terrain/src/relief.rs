//! Derivatives of a grid (slope, aspect, hillshade and others), written like any other grid: any size, format
//! and number of threads, with the same bytes. A PNG is a grayscale picture.

mod derivatives;
mod gray_scale;

use std::sync::Arc;

use crate::colours::range;
use crate::convert::copy::{DerivedBands, run_of};
use crate::convert::job::{ConvertJob, ConvertReport, DerivedGridOptions};
use crate::halo::SampleHalo;
use gray_scale::TonedGrid;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::ground_units::GroundScale;
use terrane_engine::operation::RunRequest;
use terrane_options::Options;
use terrane_raster::{GridInfo, GridSource, SampleType};
use terrane_window::relief::{Derivative, Turn};

pub use derivatives::{
    AspectOptions, AspectSetters, CurvatureOptions, CurvatureSetters, HillshadeOptions,
    HillshadeSetters, RoughnessOptions, RoughnessSetters, SlopeOptions, SlopeSetters, TpiOptions,
    TpiSetters, TriOptions, TriSetters,
};

/// Columns and rows of a piece.
const PIECE: [u32; 2] = [512, 64];
/// Samples that a derivative needs on each side.
const HALO: SampleHalo = SampleHalo(1);
/// Nodata value of floating-point derivatives, and of differences.
pub(crate) const NODATA: f64 = -9999.0;

/// The option of a PNG that says how heights are held, and its value for a picture.
const ENCODING: &str = "ENCODING";
const GRAY: &str = "GRAY";

/// Options of all derivatives of a grid
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = group)]
pub struct DerivativeOptions {
    /// Compute values at the grid border and beside voids as well: the border is extrapolated linearly, voids take the
    /// height of the sample
    pub compute_edges: bool,
    /// Input and output.
    #[option(flatten)]
    pub common: DerivedGridOptions,
}

/// A derivative, with the ratio of the vertical to the horizontal unit.
struct DerivativeRequest<'a> {
    derivative: Arc<dyn Derivative>,
    scale: Option<f64>,
    common: &'a DerivativeOptions,
}

/// Writes a derivative of a grid on its lattice and in its CRS, as 32-bit floats or bytes. Samples with fewer
/// than eight valid neighbours are void, unless `compute_edges` is set: then heights beyond the grid are extrapolated
/// linearly from the two samples inside, and voids get the height of the sample.
///
/// A PNG is a picture unless a creation option sets the encoding of heights: bytes are gray values, other
/// numbers are scaled to 16-bit grays over the range of the derivative, or else over the range of the values,
/// which reads the grid twice.
///
/// # Errors
/// Those of [`crate::convert::run`]; unknown vertical units or ellipsoids; latitudes beyond a pole.
fn run(options: &DerivativeRequest<'_>, request: RunRequest<'_>) -> Result<ConvertReport> {
    let RunRequest { inputs, output, progress, cancel, .. } = request;
    let DerivativeRequest { derivative, scale, common } = options;
    let copy = common.common.job(inputs, output);
    let picture = picture(&copy)?;
    let copy = picture.as_ref().unwrap_or(&copy);
    let is_toned = picture.is_some() && !derivative.is_byte();
    let report = run_of(copy, 0, progress, cancel, |inner| {
        let info = inner.info();
        let ground = match scale {
            Some(scale) => GroundScale::scaled(info, *scale),
            None if !derivative.is_of_slopes() => GroundScale::scaled(info, 1.0),
            None => GroundScale::of(info)?,
        };
        let (sample_type, nodata) = match derivative.is_byte() {
            true => (SampleType::U8, 0.0),
            false => (SampleType::F32, NODATA),
        };
        let nodata = Some(nodata);
        // Degrees and the like are in no unit of heights.
        let crs = match derivative.is_of_slopes() {
            true => info.crs.without_heights(),
            false => info.crs.clone(),
        };
        let info = GridInfo { sample_type, nodata, crs, scale: 1.0, offset: 0.0, ..info.clone() };
        let (known, mut notes) = (derivative.range(), ground.notes());
        let (derivative, edges) = (Arc::clone(derivative), common.compute_edges);
        let derived = Box::new(DerivativeGrid { info, inner, derivative, ground, edges });
        if !is_toned {
            return Ok(DerivedBands::of(derived, notes));
        }
        let range = known.map_or_else(|| range(derived.as_ref(), progress, cancel), Ok)?;
        let toned = TonedGrid::new(derived, range);
        notes.push(toned.note());
        Ok(DerivedBands::of(Box::new(toned), notes))
    })?;
    // The range of the grays is not that of the derivative.
    let [lowest, highest] =
        [report.lowest, report.highest].map(|value| value.filter(|_| !is_toned));
    Ok(ConvertReport { lowest, highest, ..report })
}

/// The job for a picture format without an encoding of heights.
fn picture(copy: &ConvertJob) -> Result<Option<ConvertJob>> {
    let format = copy.options.format(&copy.output)?;
    let given = copy.options.written.co.iter().find(|(key, _)| key.eq_ignore_ascii_case(ENCODING));
    if !format.is_picture() || given.is_some_and(|(_, value)| !value.eq_ignore_ascii_case(GRAY)) {
        return Ok(None);
    }
    let mut picture = copy.clone();
    if given.is_none() {
        picture.options.written.co.push((ENCODING.to_owned(), GRAY.to_owned()));
    }
    Ok(Some(picture))
}

/// A grid of derivatives.
struct DerivativeGrid {
    info: GridInfo,
    inner: Box<dyn GridSource>,
    derivative: Arc<dyn Derivative>,
    ground: GroundScale,
    edges: bool,
}

/// Heights of a piece and of one sample around it.
#[derive(Default)]
struct ReliefPiece {
    heights: Vec<f64>,
    /// The heights inside the grid, where some are outside.
    inner: Vec<f64>,
}

impl DerivativeGrid {
    /// Hands on each row of a rectangle, piece by piece, with its first column and its row.
    fn each(&self, rect: Rect, visit: &mut dyn FnMut([u32; 2], &[f64])) -> Result<()> {
        let (mut out, mut heights) = (vec![0.0; PIECE[0] as usize], ReliefPiece::default());
        for row in (rect.row..rect.end_row()).step_by(PIECE[1] as usize) {
            for col in (rect.col..rect.end_col()).step_by(PIECE[0] as usize) {
                let piece = Rect::new(col, row, PIECE[0], PIECE[1]).intersect(&rect);
                self.heights(piece, &mut heights)?;
                for row in piece.row..piece.end_row() {
                    let out = &mut out[..piece.width as usize];
                    self.row(piece, &heights.heights, row, out);
                    visit([piece.col, row], out);
                }
            }
        }
        self.inner.copied(HALO.around(rect, self.info.bounds()));
        Ok(())
    }

    /// Reads heights with one more sample on each side.
    fn heights(&self, rect: Rect, piece: &mut ReliefPiece) -> Result<()> {
        let ReliefPiece { heights, inner } = piece;
        let read = HALO.around(rect, self.info.bounds());
        let [width, height] = [rect.width as usize + 2, rect.height as usize + 2];
        heights.resize(width * height, f64::NAN);
        if read.len() == heights.len() {
            return self.inner.read_f64(read, heights);
        }
        heights.fill(f64::NAN);
        inner.resize(read.len(), 0.0);
        self.inner.read_f64(read, inner)?;
        // Rows and columns beyond the grid stay void.
        let [right, down] = [usize::from(rect.col == 0), usize::from(rect.row == 0)];
        for (row, inner) in inner.chunks(read.width as usize).enumerate() {
            heights[(row + down) * width + right..][..inner.len()].copy_from_slice(inner);
        }
        if self.edges {
            let at = [right, down, right + read.width as usize, down + read.height as usize];
            extend(heights, width, at);
        }
        Ok(())
    }

    fn row(&self, rect: Rect, heights: &[f64], row: u32, out: &mut [f64]) {
        let width = rect.width as usize + 2;
        let first = (row - rect.row) as usize * width;
        let rows = [0, 1, 2].map(|down: usize| &heights[first + down * width..][..width]);
        if self.ground.is_by_row() && !self.edges {
            self.derivative.row(rows, &self.turn(rect.col, row), out);
            return;
        }
        for (i, out) in out.iter_mut().enumerate() {
            let here = rows[1][i + 1];
            let filled = rows.map(|row| {
                [0, 1, 2].map(|k: usize| {
                    let height = row[i + k];
                    if self.edges && height.is_nan() { here } else { height }
                })
            });
            let rows = filled.each_ref().map(|row| &row[..]);
            let turn = self.turn(rect.col + i as u32, row);
            self.derivative.row(rows, &turn, std::slice::from_mut(out));
        }
    }

    /// To metres by metre, where heights count in slopes.
    fn turn(&self, col: u32, row: u32) -> Turn {
        let col = if self.ground.is_by_row() { 0 } else { col };
        self.ground.turn(f64::from(col), f64::from(row))
    }
}

/// The step along an axis from an index into a range: 0 within it.
fn inward(at: usize, first: usize, end: usize) -> isize {
    match at {
        at if at < first => 1,
        at if at >= end => -1,
        _ => 0,
    }
}

/// Extrapolates heights beyond the grid linearly from the two samples inside: the grid covers columns and rows
/// from the first two numbers up to the last two (exclusive).
fn extend(heights: &mut [f64], width: usize, [left, top, right, bottom]: [usize; 4]) {
    for row in 0..heights.len() / width {
        for col in 0..width {
            let [x, y] = [inward(col, left, right), inward(row, top, bottom)];
            if x == 0 && y == 0 {
                continue;
            }
            let [next, after] = [1, 2].map(|steps| {
                let col = col.checked_add_signed(steps * x).filter(|c| (left..right).contains(c));
                let row = row.checked_add_signed(steps * y).filter(|r| (top..bottom).contains(r));
                col.zip(row).map_or(f64::NAN, |(col, row)| heights[row * width + col])
            });
            heights[row * width + col] = if after.is_nan() { next } else { 2.0 * next - after };
        }
    }
}

impl GridSource for DerivativeGrid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.each(rect, &mut |[col, row], values| {
            let from = (row - rect.row) as usize * rect.width as usize + (col - rect.col) as usize;
            out[from..].iter_mut().zip(values).for_each(|(out, value)| *out = *value as f32);
        })
    }

    /// In single precision, as written.
    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.each(rect, &mut |[col, row], values| {
            let from = (row - rect.row) as usize * rect.width as usize + (col - rect.col) as usize;
            out[from..]
                .iter_mut()
                .zip(values)
                .for_each(|(out, value)| *out = f64::from(*value as f32));
        })
    }

    fn block_bytes(&self) -> u64 {
        let [cols, rows] = PIECE.map(|side| u64::from(side) + 4);
        self.inner.block_bytes() + 2 * cols * rows * 8
    }

    fn members(&self) -> Vec<std::path::PathBuf> {
        self.inner.members()
    }

    fn release(&self, rect: Rect) {
        self.inner.release(HALO.last_read_for(rect, self.info.bounds()));
    }

    fn copied(&self, rect: Rect) {
        self.inner.copied(rect);
    }
}
