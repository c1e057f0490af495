//! All points of a point cloud, sorted into tiles: in memory if they fit, else on disk.
//!
//! Methods that need the neighbours of a point read the tiles they touch. The points of a tile are returned in
//! canonical order, so that results do not depend on the order of input.
//!
//! Tiles hold about 4,096 points. The summary of each (its count, bounding box and lowest point) stays in
//! memory and answers most queries about distant tiles without reading them.

mod around;
mod interpolated;
mod limits;
mod shelf;
mod store;
mod summary;
mod tiling;

pub(crate) use around::SurroundingPoints;
pub(crate) use interpolated::{
    ColumnRowPositions, ColumnRowRange, InterpolatedSurface, MAX_POINTS, reach,
};
pub(crate) use limits::{PointStoreLimits, parts_in};
pub(crate) use shelf::{ENTRY, POINT, ShelfWriter, SquareIndexes};
pub(crate) use store::{PointStore, PointStoreSetup};
pub(crate) use summary::SquareSummary;
pub(crate) use tiling::Tiling;
