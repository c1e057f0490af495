//! The points that count for a cell, and the defaults of statistics.

/// Which points a cell takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellNeighborhood {
    /// Points inside the cell.
    Cell,
    /// Points within this distance of its centre, in world units.
    Disc(f64),
}

/// Default parameters of statistics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatisticDefaults {
    /// Radius of idw and nearest, in world units.
    pub radius: f64,
    /// Power of distance for idw.
    pub power: f64,
    /// Every statistic uses all points within the radius, not only those in the cell.
    pub around: bool,
}

impl StatisticDefaults {
    /// The points of a statistic that has no radius of its own.
    pub(super) fn own(&self) -> CellNeighborhood {
        if self.around { CellNeighborhood::Disc(self.radius) } else { CellNeighborhood::Cell }
    }
}
