//! The interface of methods that find ground, and the squares of cells that they work in.

use super::asked;
use super::lows::LowestPoints;
use super::surface::GroundSurface;

/// One method of the registry.
pub type Method = asked::FinderMethod<GroundFinder>;
/// A method with its parameters.
pub type Asked = asked::FinderRequest<GroundFinder>;

/// How a method finds the ground.
#[derive(Clone, Copy, Debug)]
pub struct GroundFinder {
    /// How the plane is divided for it, points being so many metres apart.
    pub(crate) lattice: fn(&Asked, f64) -> GroundTiling,
    pub(crate) find: fn(&Asked, &LowestPoints<'_>) -> GroundSurface,
}

/// The squares of cells that a method works in, and what each has to see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundTiling {
    /// Side of a cell in metres.
    pub cell: f64,
    /// Cells that a square sees beyond its own.
    pub halo: usize,
    /// Cells along a square, where the result depends on that; else any number gives the same.
    pub core: Option<usize>,
}

/// Metres along a square of a fixed lattice and its halo, and most cells of both.
const CORE: (f64, usize) = (512.0, 768);
const HALO: (f64, usize) = (128.0, 192);
/// Fewest cells of both.
const FEWEST: usize = 16;

impl GroundTiling {
    /// Squares of a size that depends on that of the cells alone: for methods whose cells depend on
    /// others however far away, and which are therefore defined on these squares.
    pub(crate) fn fixed(cell: f64) -> Self {
        let cells =
            |(metres, most): (f64, usize)| ((metres / cell).ceil() as usize).clamp(FEWEST, most);
        Self { cell, halo: cells(HALO), core: Some(cells(CORE)) }
    }
}
