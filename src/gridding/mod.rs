//! Point clouds to grids: the statistics of cells, order-independent and exact. Pure.

pub mod ground;
pub mod pitfree;
