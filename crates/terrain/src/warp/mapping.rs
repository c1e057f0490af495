//! Transforms positions of the grid to those of the output, and back.

use terrane_base::error::Result;
use terrane_crs::CoordinateOperation;

/// The operations between two CRS; none if both are the same.
pub(super) struct CrsTransform {
    /// There, and back.
    operations: Option<[CoordinateOperation; 2]>,
}

impl CrsTransform {
    pub(super) fn new(there: Option<CoordinateOperation>) -> Self {
        let operations = there.filter(|there| !there.is_null()).map(|there| {
            let back = there.inverse();
            [there, back]
        });
        Self { operations }
    }

    pub(super) fn there(&self, at: [f64; 2]) -> Result<[f64; 2]> {
        self.operations.as_ref().map_or(Ok(at), |[there, _]| there.position(at))
    }

    /// `None` if the position cannot be transformed.
    pub(super) fn back(&self, at: [f64; 2]) -> Option<[f64; 2]> {
        let Some([_, back]) = &self.operations else { return Some(at) };
        back.position(at).ok()
    }

    /// The height of the output, from that at a place of the grid.
    pub(super) fn height(&self, [x, y]: [f64; 2], z: f64) -> Result<f64> {
        let Some([there, _]) = &self.operations else { return Ok(z) };
        there.point([x, y, z]).map(|[_, _, z]| z)
    }

    pub(super) fn keeps_heights(&self) -> bool {
        self.operations.as_ref().is_none_or(|[there, _]| there.keeps_heights())
    }

    pub(super) fn is_none(&self) -> bool {
        self.operations.is_none()
    }
}
