//! The points that count for a cell, and the defaults of statistics.

/// Which points a cell takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellNeighborhood {
    /// Those in it.
    Cell,
    /// Those nearer to its centre than this, in world units.
    Disc(f64),
}

/// What holds for all statistics that do not say otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatisticDefaults {
    /// Radius of idw and nearest, in world units.
    pub radius: f64,
    /// Power of distance for idw.
    pub power: f64,
    /// Every statistic is of the points within the radius, not only of those in the cell.
    pub around: bool,
}

impl StatisticDefaults {
    /// The points of a statistic that has no radius of its own.
    pub(super) fn own(&self) -> CellNeighborhood {
        if self.around { CellNeighborhood::Disc(self.radius) } else { CellNeighborhood::Cell }
    }
}
