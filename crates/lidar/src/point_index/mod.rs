//! All points of a point cloud, sorted into tiles: in memory if they fit, else on disk.
//!
//! Methods that need the neighbours of a point read the tiles they touch. The points of a tile are returned in
//! canonical order, so that results do not depend on the order of input.
//!
//! Tiles hold about 4,096 points. The summary of each (its count, bounding box and lowest point) stays in
//! memory and answers most queries about distant tiles without reading them.

mod coverage;
mod interpolated;
mod neighbourhood;
mod summary;
mod tile_files;
mod tile_store;
mod tiling;

pub(crate) use coverage::{PointStoreCoverage, parts_in};
pub(crate) use interpolated::{
    ColumnRowPositions, ColumnRowRange, InterpolatedSurface, MAX_POINTS, has_short_edges, reach,
};
pub(crate) use neighbourhood::SurroundingPoints;
pub(crate) use summary::TileSummary;
pub(crate) use tile_files::{ENTRY, POINT, PointTileIndexes, TileFileWriter};
pub(crate) use tile_store::{PointStore, PointStoreSetup};
pub(crate) use tiling::Tiling;
