//! Square tiles, numbered row by row from the south-west.

use terrane_base::geom::Point;
use terrane_delaunay::{Site, SiteWindow};

/// Average number of points of a tile: enough to make a read from disk efficient, few enough to load the tiles
/// around a position quickly.
const AVERAGE: u64 = 4096;
/// Most tiles: the summary of each stays in memory.
const MOST: u64 = 1 << 18;

/// Square tiles of the plane, in steps of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tiling {
    /// Window of all tiles.
    window: SiteWindow,
    /// Steps along a side.
    side: u32,
    /// Number of tiles along x and y.
    counts: [u32; 2],
}

impl Tiling {
    /// Tiles that cover `bounds` (lowest and highest point) for about `points` points.
    pub(crate) fn new([low, high]: [Point; 2], points: u64) -> Self {
        let window = SiteWindow { low: [low.x, low.y], high: [high.x, high.y] };
        let extent = [0, 1].map(|i| u64::from(window.high[i].abs_diff(window.low[i])) + 1);
        let count = (points / AVERAGE).clamp(1, MOST);
        let mut side = (extent[0] * extent[1] / count).isqrt().max(1);
        let mut counts = extent.map(|e| e.div_ceil(side));
        while counts.iter().product::<u64>() > MOST {
            side += side.div_ceil(8);
            counts = extent.map(|e| e.div_ceil(side));
        }
        Self { window, side: side as u32, counts: counts.map(|n| n as u32) }
    }

    /// Number of tiles.
    pub(crate) fn count(&self) -> usize {
        self.counts[0] as usize * self.counts[1] as usize
    }

    /// Steps along a side.
    pub(crate) fn side(&self) -> i32 {
        i32::try_from(self.side).unwrap_or(i32::MAX)
    }

    /// Number of tiles along x and y.
    pub(crate) fn counts(&self) -> [u32; 2] {
        self.counts
    }

    /// Window of all tiles.
    pub(crate) fn window(&self) -> SiteWindow {
        self.window
    }

    /// The number of the tile in a column and row.
    pub(crate) fn square(&self, [col, row]: [u32; 2]) -> usize {
        row as usize * self.counts[0] as usize + col as usize
    }

    /// The tile of a point; one beyond the window belongs to the nearest tile.
    pub(crate) fn square_of(&self, point: Point) -> usize {
        self.square(self.tile_of([point.x, point.y]))
    }

    /// Column and row of the tile nearest to a position.
    pub(crate) fn tile_of(&self, at: Site) -> [u32; 2] {
        [0, 1].map(|axis| {
            let steps = i64::from(at[axis]) - i64::from(self.window.low[axis]);
            let last = i64::from(self.counts[axis]) - 1;
            steps.div_euclid(i64::from(self.side)).clamp(0, last) as u32
        })
    }

    /// The tiles that a window touches, row by row; border tiles also cover everything beyond them.
    pub(crate) fn touching(
        &self,
        SiteWindow { low, high }: SiteWindow,
    ) -> impl Iterator<Item = usize> + use<> {
        let (tiling, low, high) = (*self, self.tile_of(low), self.tile_of(high));
        (low[1]..=high[1])
            .flat_map(move |row| (low[0]..=high[0]).map(move |col| [col, row]))
            .map(move |tile| tiling.square(tile))
    }

    /// The window of a tile.
    pub(crate) fn window_of(&self, square: usize) -> SiteWindow {
        let across = self.counts[0] as usize;
        let place = [square % across, square / across];
        let (side, all) = (i64::from(self.side), self.window);
        let low = [0, 1].map(|axis| i64::from(all.low[axis]) + place[axis] as i64 * side);
        let high = [0, 1].map(|axis| (low[axis] + side - 1).min(i64::from(all.high[axis])));
        // Within the window, whose ends are i32.
        SiteWindow { low: low.map(|v| v as i32), high: high.map(|v| v as i32) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_cloud_without_extent_has_one_square() {
        let tiling = Tiling::new([Point::new(5, 5, 0); 2], 1 << 40);
        assert_eq!((tiling.count(), tiling.square_of(Point::new(9, 0, 0))), (1, 0));
    }

    #[test]
    fn long_and_thin_clouds_have_no_more_squares_than_wide_ones() {
        let tiling = Tiling::new([Point::new(0, 0, 0), Point::new(1 << 29, 3, 0)], 1 << 40);
        assert!(tiling.count() as u64 <= MOST && tiling.count() as u64 > MOST / 2);
    }

    proptest! {
        #[test]
        fn a_point_lies_in_its_square_and_a_window_touches_it(
            x in -1000..1000i32, y in -300..300i32, reach in 0..100i32, points in 0..1_000_000u64
        ) {
            let tiling = Tiling::new([Point::new(-1000, -300, 0), Point::new(999, 299, 0)], points);
            let square = tiling.square_of(Point::new(x, y, 0));
            prop_assert!(tiling.window_of(square).contains([x, y]));
            let window = SiteWindow { low: [x, y], high: [x, y] }.grown(reach);
            prop_assert!(tiling.touching(window).any(|touched| touched == square));
            prop_assert_eq!(tiling.touching(SiteWindow::ALL).count(), tiling.count());
            let sum: u64 = (0..tiling.count()).map(|square| {
                let SiteWindow { low, high } = tiling.window_of(square);
                u64::from(high[0].abs_diff(low[0]) + 1) * u64::from(high[1].abs_diff(low[1]) + 1)
            }).sum();
            prop_assert_eq!(sum, 2000 * 600);
        }
    }
}
