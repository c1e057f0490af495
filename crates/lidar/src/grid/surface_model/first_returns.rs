//! Canopy surfaces.

use super::super::extent::CellRequest;
use terrane_base::error::Result;

/// A surface, by one of the methods.
pub(super) trait CanopySurface: Send + Sync {
    /// World heights at the centres of cells, NaN outside the surface.
    ///
    /// # Errors
    /// Read errors.
    fn values(&self, piece: CellRequest<'_>, out: &mut [f64]) -> Result<()>;

    /// True if unread points were needed.
    fn is_exceeded(&self) -> bool;

    /// Bytes that went to temporary files.
    fn spilled(&self) -> u64;
}
