//! Reading a rectangle of a grid into buffers that a worker keeps.

use crate::error::Result;
use crate::geom::Rect;
use crate::raster::GridSource;
use crate::tin::Heights;

/// The buffers of one worker.
#[derive(Default)]
pub(super) struct Window {
    rect: Option<Rect>,
    f32: Vec<f32>,
    f64: Vec<f64>,
    /// True when some height of the rectangle is not exactly an f32.
    wide: bool,
}

impl Window {
    /// Most bytes for a rectangle of `samples` samples.
    pub(super) fn bytes(samples: u64) -> u64 {
        samples * 12
    }

    /// Reads `rect` of `source`.
    pub(super) fn read(&mut self, source: &dyn GridSource, rect: Rect) -> Result<()> {
        self.rect = Some(rect);
        self.f32.resize(rect.len(), 0.0);
        if source.info().exact_in_f32() {
            self.wide = false;
            return source.read_f32(rect, &mut self.f32);
        }
        self.f64.resize(rect.len(), 0.0);
        source.read_f64(rect, &mut self.f64)?;
        self.wide = narrow(&self.f64, &mut self.f32);
        Ok(())
    }

    /// The heights of the last rectangle read (none before the first).
    pub(super) fn heights(&self) -> Heights<'_> {
        let (width, height) = self.rect.map_or((0, 0), |rect| (rect.width, rect.height));
        Heights { width, height, f32: &self.f32, f64: self.wide.then_some(&self.f64) }
    }
}

/// Rounds to f32; true when that changed a value.
fn narrow(from: &[f64], to: &mut [f32]) -> bool {
    let mut changed = false;
    for (&height, rounded) in from.iter().zip(to) {
        *rounded = height as f32;
        changed |= f64::from(*rounded) != height && !height.is_nan();
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_values_need_no_f64() {
        let mut out = [0.0; 3];
        assert!(!narrow(&[1.5, f64::NAN, -7.0], &mut out));
        assert!(out[1].is_nan() && out[2] == -7.0);
        assert!(narrow(&[0.1], &mut out[..1]));
    }
}
