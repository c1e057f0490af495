//! What is seen from above.

use super::super::extent::CellRequest;
use terrane_base::error::Result;

/// A surface, by one of the methods.
pub(super) trait CanopySurface: Send + Sync {
    /// World heights at the centres of cells, NaN where there is no surface.
    ///
    /// # Errors
    /// What cannot be read.
    fn values(&self, piece: CellRequest<'_>, out: &mut [f64]) -> Result<()>;

    /// True when points were needed that were not read.
    fn is_exceeded(&self) -> bool;

    /// Bytes that went to temporary files.
    fn spilled(&self) -> u64;
}
