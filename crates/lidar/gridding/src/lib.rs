//! Point clouds to grids: the statistics of cells, order-independent and exact. Pure.
//!
//! Points are added to the cells of blocks ([`CellBlock`]) in any order and any division: accumulators are
//! integer sums or extremes, so the result does not depend on the order, and blocks of the same cells can be
//! merged. A [`StatisticRecipe`] has the accumulators of the requested statistics ([`METHODS`]), a
//! [`CellLattice`] the position of the cells.

mod block;
pub mod canopy;
mod cell;
mod dimension;
mod disc;
mod fill;
mod grid_frame;
mod parameter;
pub mod pitfree;
mod plane;
mod recipe;
mod region;
mod statistic;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_of_subjects;

pub use block::CellBlock;
pub use canopy::Canopy;
pub use cell::CellUnits;
pub use dimension::{OF_POINTS, SelectedPoints, Subject, SubjectSelector};
pub use disc::{BlockTarget, DiscScatter};
pub use fill::fill;
pub use grid_frame::{CellEdgeRule, CellLattice, DistanceUnit, FAR, LatticeAxis};
pub use parameter::StatisticParameter;
pub use plane::CellHits;
pub use recipe::{StatisticBand, StatisticRecipe};
pub use region::{CellNeighborhood, StatisticDefaults};
pub use statistic::{
    MAX_POWER, METHODS, Statistic, StatisticMethod, StatisticRequest, SurfaceInterpolation,
    check_power, parse_list,
};
