//! Summary of a tile of points, known without reading it.

use terrane_base::geom::Point;
use terrane_delaunay::SiteWindow;

/// Summary of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TileSummary {
    /// Number of points.
    pub(crate) count: u64,
    /// Bounding window of the points.
    pub(crate) window: SiteWindow,
    /// The lowest point.
    pub(crate) lowest: Point,
}

impl TileSummary {
    pub(super) const EMPTY: Self = Self {
        count: 0,
        window: SiteWindow { low: [i32::MAX; 2], high: [i32::MIN; 2] },
        lowest: Point::new(i32::MAX, i32::MAX, i32::MAX),
    };

    pub(super) fn add(&mut self, run: &[Point]) {
        self.count += run.len() as u64;
        let SiteWindow { low, high } = &mut self.window;
        for &point in run {
            *low = [low[0].min(point.x), low[1].min(point.y)];
            *high = [high[0].max(point.x), high[1].max(point.y)];
            self.lowest = self.lowest.min(point);
        }
    }

    /// The summary of both.
    pub(crate) fn merged(mut self, other: Self) -> Self {
        self.merge(&other);
        self
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.window = self.window.union(&other.window);
        self.lowest = self.lowest.min(other.lowest);
    }
}
