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
    pub(crate) tiling: fn(&Request, f64) -> GroundTiling,
    /// Most memory of a search for each cell of its window, with the lowest points, in bytes.
    pub(crate) bytes_per_cell: u64,
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

/// Metres along a tile of a fixed tiling, and along its halo.
const CORE: f64 = 512.0;
const HALO: f64 = 128.0;
/// Most cells along both.
const MAX_CORE: usize = 768;
const MAX_HALO: usize = 192;
/// Fewest cells along either.
const MIN_CELLS: usize = 16;

impl GroundTiling {
    /// Tiles of a fixed size, which depends on the cell size only: for methods without a bounded reach, which
    /// are defined on these tiles.
    pub(crate) fn fixed(cell: f64) -> Self {
        let core = cells_along(CORE, cell, MAX_CORE);
        Self { cell, halo: cells_along(HALO, cell, MAX_HALO), core: Some(core) }
    }
}

fn cells_along(metres: f64, cell: f64, max: usize) -> usize {
    ((metres / cell).ceil() as usize).clamp(MIN_CELLS, max)
}
