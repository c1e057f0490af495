//! Values scaled to 16-bit gray, for pictures.

use std::path::PathBuf;

use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_raster::{GridInfo, GridSource, SampleType};

/// Gray value of nodata.
const NONE: f64 = 0.0;
/// Gray values of the lowest and the highest value.
const GRAYS: [f64; 2] = [1.0, 65_535.0];

/// A grid of grays in front of one of values.
pub(super) struct TonedGrid {
    info: GridInfo,
    inner: Box<dyn GridSource>,
    range: [f64; 2],
}

impl TonedGrid {
    /// Grays of values within `range`, which has the lowest first.
    pub(super) fn new(inner: Box<dyn GridSource>, range: [f64; 2]) -> Self {
        let info = inner.info().clone();
        let (sample_type, crs) = (SampleType::U16, info.crs.without_heights());
        let info = GridInfo { sample_type, nodata: Some(NONE), crs, ..info };
        Self { info, inner, range }
    }

    /// The note on the scale of gray values.
    pub(super) fn note(&self) -> String {
        let ([black, white], [low, high]) = (GRAYS, self.range);
        format!(
            "gray values {black} to {white} stand for {low} to {high}; {NONE} is nodata (transparent)"
        )
    }

    fn gray(&self, value: f64) -> f64 {
        let ([black, white], [low, high]) = (GRAYS, self.range);
        if value.is_nan() {
            return value;
        }
        let share = if high > low { (value - low) / (high - low) } else { 0.0 };
        (black + share.clamp(0.0, 1.0) * (white - black)).round()
    }
}

impl GridSource for TonedGrid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.inner.read_f32(rect, out)?;
        // Whole numbers below 2^24 are exact.
        out.iter_mut().for_each(|value| *value = self.gray((*value).into()) as f32);
        Ok(())
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.inner.read_f64(rect, out)?;
        out.iter_mut().for_each(|value| *value = self.gray(*value));
        Ok(())
    }

    fn block_bytes(&self) -> u64 {
        self.inner.block_bytes()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.inner.members()
    }

    fn release(&self, rect: Rect) {
        self.inner.release(rect);
    }

    fn copied(&self, rect: Rect) {
        self.inner.copied(rect);
    }

    fn advise_read(&self, rect: Rect) {
        self.inner.advise_read(rect);
    }
}
