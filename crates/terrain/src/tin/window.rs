//! Reading a rectangle of a grid into buffers that a worker keeps.

use terrane_base::error::{Error, Result};
use terrane_base::geom::{HeightQuantization, Rect};
use terrane_base::limits::MAX_HEIGHT;
use terrane_raster::{GridInfo, GridSource, looks_like_nodata};
use terrane_tin::{HeightWindow, TinSpec};

/// Usual range of heights of land. Common nodata values lie below it; only windows with heights outside of it
/// are searched for their range.
const LAND: [f32; 2] = [-900.0, 8800.0];

/// The buffers of one worker. They never shrink, to avoid refilling; only the part that `rect` covers is valid.
#[derive(Default)]
pub(super) struct HeightBuffers {
    rect: Option<Rect>,
    f32: Vec<f32>,
    f64: Vec<f64>,
    /// Largest difference of the f32 heights of the rectangle from the exact ones.
    rounding: f64,
    /// Lowest and highest of the f32 heights, where some are beyond [`LAND`].
    range: Option<[f32; 2]>,
}

impl HeightBuffers {
    /// Most bytes for a rectangle of `samples` samples.
    pub(super) fn bytes(samples: u64) -> u64 {
        samples * 12
    }

    /// Reads `rect` of `source`. Fails where a height is beyond [`MAX_HEIGHT`].
    pub(super) fn read(&mut self, source: &dyn GridSource, rect: Rect) -> Result<()> {
        self.rect = Some(rect);
        self.rounding = 0.0;
        let samples = rect.len();
        grow(&mut self.f32, samples);
        if source.info().exact_in_f32() {
            source.read_f32(rect, &mut self.f32[..samples])?;
        } else {
            grow(&mut self.f64, samples);
            source.read_f64(rect, &mut self.f64[..samples])?;
            self.rounding = narrow(&self.f64[..samples], &mut self.f32[..samples]);
        }
        self.refuse_extremes(rect)
    }

    /// Fails where the output's rounding of heights alone would break the tolerance.
    pub(super) fn check_rounding(&self, spec: &TinSpec) -> Result<()> {
        let Some(stored) = spec.single_precision else { return Ok(()) };
        let heights = self.heights();
        let rounding = match (heights.f64, stored == HeightQuantization::about(0.0)) {
            (_, true) => self.rounding,
            (Some(exact), _) => largest_change(stored, exact.iter().copied()),
            (None, _) => largest_change(stored, heights.f32.iter().map(|&z| z.into())),
        };
        if rounding > spec.tolerance { Err(too_coarse(rounding, spec.tolerance)) } else { Ok(()) }
    }

    /// Beyond [`MAX_HEIGHT`] differences of heights overflow; no terrain is there, but undeclared
    /// nodata often is.
    fn refuse_extremes(&mut self, rect: Rect) -> Result<()> {
        let samples = &self.f32[..rect.len()];
        self.range = None;
        // Whole chunks without a branch, so that the search is vectorised.
        let mut chunks = samples.chunks(1024);
        let is_odd = chunks
            .any(|chunk| chunk.iter().fold(false, |any, z| any | (*z < LAND[0]) | (*z > LAND[1])));
        if !is_odd {
            return Ok(());
        }
        let none = [f32::INFINITY, f32::NEG_INFINITY];
        self.range = Some(samples.iter().fold(none, |[low, high], &z| [low.min(z), high.max(z)]));
        let extreme = samples.iter().position(|z| z.abs() > MAX_HEIGHT);
        let Some(index) = extreme else { return Ok(()) };
        let (row, col) = (index / rect.width as usize, index % rect.width as usize);
        let (row, col) = (row + rect.row as usize, col + rect.col as usize);
        let height = match self.heights().f64 {
            Some(exact) => format!("{:e}", exact[index]),
            None => format!("{:e}", samples[index]),
        };
        Err(Error::bad_input(format!(
            "the height {height} at column {col}, row {row} is out of range"
        ))
        .remedy(format!("pass ‹nodata› {height} if it is nodata")))
    }

    /// The number of samples of `tile` with the lowest height of the last rectangle, if that looks like an
    /// undeclared nodata value; with the stored value.
    pub(super) fn suspects(&self, tile: Rect, info: &GridInfo) -> Option<(f64, u64)> {
        let (rect, [lowest, _]) = (self.rect?, self.range?);
        let stored = looks_like_nodata(f64::from(lowest), info)?;
        let rows = tile.row - rect.row..tile.end_row() - rect.row;
        let cols = (tile.col - rect.col) as usize..(tile.end_col() - rect.col) as usize;
        let rows = rows.map(|row| &self.f32[row as usize * rect.width as usize..][cols.clone()]);
        let count = rows.flatten().filter(|&&z| z == lowest).count();
        Some((stored, count as u64))
    }

    /// The lowest and highest height of the last rectangle, if some are outside the usual range of land.
    pub(super) fn odd_range(&self) -> Option<[f64; 2]> {
        self.range.map(|range| range.map(f64::from))
    }

    /// The heights of the last rectangle read (none before the first).
    pub(super) fn heights(&self) -> HeightWindow<'_> {
        let rect = self.rect.unwrap_or(Rect::new(0, 0, 0, 0));
        let exact = (self.rounding > 0.0).then(|| &self.f64[..rect.len()]);
        HeightWindow {
            width: rect.width,
            height: rect.height,
            f32: &self.f32[..rect.len()],
            f64: exact,
        }
    }
}

/// The largest change of heights by rounding.
fn largest_change(rounding: HeightQuantization, heights: impl Iterator<Item = f64>) -> f64 {
    heights.fold(0.0, |max, height| (rounding.apply(height) - height).abs().max(max))
}

/// Grows a buffer to at least `samples`.
fn grow<T: Copy + Default>(buffer: &mut Vec<T>, samples: usize) {
    buffer.resize(samples.max(buffer.len()), T::default());
}

/// Rounds to f32; returns the largest change.
fn narrow(from: &[f64], to: &mut [f32]) -> f64 {
    let mut largest = 0.0_f64;
    for (&height, rounded) in from.iter().zip(to) {
        *rounded = height as f32;
        largest = largest.max((f64::from(*rounded) - height).abs());
    }
    largest
}

fn too_coarse(rounding: f64, tolerance: f64) -> Error {
    Error::usage(format!(
        "the output format stores heights as 32-bit floats: the rounding error of {rounding:e} exceeds the tolerance of {tolerance:e}"
    ))
    .remedy("write PLY or OBJ, or raise ‹max_error›")
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::bound::ErrorBound;
    use terrane_base::error::ErrorKind;

    #[test]
    fn exact_values_need_no_f64() {
        let mut out = [0.0; 3];
        assert_eq!(narrow(&[1.5, f64::NAN, -7.0], &mut out), 0.0);
        assert!(out[1].is_nan() && out[2] == -7.0);
        assert_eq!(narrow(&[0.1], &mut out[..1]), f64::from(0.1_f32) - 0.1);
    }

    #[test]
    fn a_tolerance_below_the_rounding_of_the_output_is_refused() {
        let window = HeightBuffers { rounding: 0.01, ..HeightBuffers::default() };
        let spec = |tolerance, single: bool| TinSpec {
            tolerance,
            single_precision: single.then_some(HeightQuantization::about(0.0)),
            bound: ErrorBound::Samples,
            strict: false,
            drop: true,
            fit_heights: false,
            data_dependent: false,
            min_angle: None,
            measure: false,
        };
        assert!(window.check_rounding(&spec(0.02, true)).is_ok());
        assert!(window.check_rounding(&spec(0.001, false)).is_ok());
        let error = window.check_rounding(&spec(0.001, true)).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        let far = HeightBuffers {
            rect: Some(Rect::new(0, 0, 2, 1)),
            f32: vec![2e7, f32::NAN],
            f64: vec![2e7 + 0.25, f64::NAN],
            rounding: 0.25,
            ..HeightBuffers::default()
        };
        assert!(far.check_rounding(&spec(0.1, true)).is_err());
        let near =
            TinSpec { single_precision: Some(HeightQuantization::about(2e7)), ..spec(0.0, true) };
        assert!(far.check_rounding(&near).is_ok(), "relative to a height nearby");
    }

    #[test]
    fn what_is_left_of_a_larger_rectangle_does_not_count() {
        let mut window =
            HeightBuffers { f32: vec![1.0, 2.0, 3e38, -2000.0], ..HeightBuffers::default() };
        let rect = Rect::new(5, 6, 2, 1);
        window.rect = Some(rect);
        window.refuse_extremes(rect).unwrap();
        assert_eq!((window.range, window.heights().f32), (None, &[1.0, 2.0][..]));
        grow(&mut window.f32, 1);
        assert_eq!(window.f32.len(), 4);
    }

    #[test]
    fn undeclared_nodata_is_named() {
        let heights = vec![1.0, 2.0, 3.0, 4.0, f32::MIN, 6.0];
        let mut window = HeightBuffers { f32: heights, ..HeightBuffers::default() };
        let error = window.refuse_extremes(Rect::new(10, 20, 3, 2)).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::BadInput);
        let text = error.to_string();
        assert!(text.contains("column 11, row 21") && text.contains("‹nodata› -3.4028235e38"));
    }
}
