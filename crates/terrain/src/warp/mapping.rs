//! Transforms positions of the grid to those of the output, and back.

use terrane_base::error::Result;
use terrane_crs::CoordinateOperation;

/// The operations between two CRS; none if both are the same.
pub(super) struct CrsTransform {
    /// Forward, and inverse.
    operations: Option<[CoordinateOperation; 2]>,
}

impl CrsTransform {
    pub(super) fn new(forward: Option<CoordinateOperation>) -> Self {
        let operations = forward.filter(|forward| !forward.is_null()).map(|forward| {
            let inverse = forward.inverse();
            [forward, inverse]
        });
        Self { operations }
    }

    pub(super) fn forward(&self, at: [f64; 2]) -> Result<[f64; 2]> {
        self.operations.as_ref().map_or(Ok(at), |[forward, _]| forward.position(at))
    }

    /// `None` if the position cannot be transformed.
    pub(super) fn inverse(&self, at: [f64; 2]) -> Option<[f64; 2]> {
        let Some([_, inverse]) = &self.operations else { return Some(at) };
        inverse.position(at).ok()
    }

    /// As [`inverse`](Self::inverse) for neighbouring positions; NaN where there is none.
    pub(super) fn inverse_line(&self, line: &mut [[f64; 2]]) {
        if let Some([_, inverse]) = &self.operations {
            inverse.transform_line(line);
        }
    }

    /// The height of the output, from that at a place of the grid.
    pub(super) fn height(&self, [x, y]: [f64; 2], z: f64) -> Result<f64> {
        let Some([forward, _]) = &self.operations else { return Ok(z) };
        forward.point([x, y, z]).map(|[_, _, z]| z)
    }

    pub(super) fn keeps_heights(&self) -> bool {
        self.operations.as_ref().is_none_or(|[forward, _]| forward.keeps_heights())
    }

    pub(super) fn is_none(&self) -> bool {
        self.operations.is_none()
    }
}
