//! All points of a cloud, sorted into squares of the plane: in memory while it lasts, else on disk.
//!
//! Methods that need a point's neighbours read the squares they touch. A square's points are handed
//! out in canonical order, so that nothing depends on the order in which they came.
//!
//! Squares hold about 4,096 points. What is known of each (its count, the box around its points, its
//! lowest point) stays in memory and answers most questions about squares far away without reading them.

mod around;
mod interpolated;
mod limits;
mod shelf;
mod store;
mod summary;
mod tiling;

pub(crate) use around::SurroundingPoints;
pub(crate) use interpolated::{
    ColumnRowPositions, ColumnRowRange, InterpolatedSurface, MOST_POINTS, reach,
};
pub(crate) use limits::{PointStoreLimits, parts_in};
pub(crate) use shelf::{ENTRY, POINT, ShelfWriter, SquareIndexes};
pub(crate) use store::{PointStore, PointStoreSetup};
pub(crate) use summary::SquareSummary;
pub(crate) use tiling::Tiling;
