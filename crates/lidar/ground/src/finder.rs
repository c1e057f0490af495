//! The interface of ground methods, and their tiling.

use super::lowest_points::LowestPoints;
use super::method_call;
use super::surface::GroundSurface;

/// One method of the registry.
pub type Method = method_call::FinderMethod<GroundFinder>;
/// A method with its parameters.
pub type Request = method_call::FinderRequest<GroundFinder>;

/// How a method finds the ground.
#[derive(Clone, Copy, Debug)]
pub struct GroundFinder {
    /// Tiling of the plane, for points with a spacing in metres.
    pub(crate) lattice: fn(&Request, f64) -> GroundTiling,
    pub(crate) find: fn(&Request, &LowestPoints<'_>) -> GroundSurface,
}

/// The tiles of cells that a method works in, with their halo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundTiling {
    /// Side of a cell in metres.
    pub cell: f64,
    /// Width of the halo, in cells.
    pub halo: usize,
    /// Cells along a tile, if the result depends on it.
    pub core: Option<usize>,
}

/// Metres along a tile of a fixed tiling and its halo, and most cells of both.
const CORE: (f64, usize) = (512.0, 768);
const HALO: (f64, usize) = (128.0, 192);
/// Fewest cells of a tile and its halo.
const FEWEST: usize = 16;

impl GroundTiling {
    /// Tiles of a fixed size, which depends on the cell size only: for methods without a bounded reach, which
    /// are defined on these tiles.
    pub(crate) fn fixed(cell: f64) -> Self {
        let cells =
            |(metres, most): (f64, usize)| ((metres / cell).ceil() as usize).clamp(FEWEST, most);
        Self { cell, halo: cells(HALO), core: Some(cells(CORE)) }
    }
}
