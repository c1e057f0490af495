//! The plane in squares, numbered row by row from the south-west.

use crate::geom::Point;

/// Points that a square should hold on average: enough that a read from disk pays, few enough that
/// the squares around a place are a small detour.
const AVERAGE: u64 = 4096;
/// Most squares: what is known of each stays in memory.
const MOST: u64 = 1 << 18;

/// Squares of the plane, in steps of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::pipeline) struct Tiling {
    /// South-west corner.
    low: [i32; 2],
    /// Steps along a side.
    side: u32,
    /// Squares along x and y.
    counts: [u32; 2],
}

impl Tiling {
    /// Squares that cover `bounds` (lowest and highest point) for about `points` points.
    pub(in crate::pipeline) fn new(bounds: [Point; 2], points: u64) -> Self {
        let [low, high] = bounds.map(|p| [p.x, p.y]);
        let extent = [0, 1].map(|axis| u64::from(high[axis].abs_diff(low[axis])) + 1);
        let wanted = (points / AVERAGE).clamp(1, MOST);
        let counts = |side: u64| extent.map(|e| e.div_ceil(side));
        let mut side = (extent[0] * extent[1] / wanted).isqrt().max(1);
        while counts(side).iter().product::<u64>() > MOST {
            side += side.div_ceil(8);
        }
        Self { low, side: side as u32, counts: counts(side).map(|n| n as u32) }
    }

    /// Number of squares.
    pub(in crate::pipeline) fn count(&self) -> usize {
        self.counts[0] as usize * self.counts[1] as usize
    }

    /// Steps along a side.
    pub(in crate::pipeline) fn side(&self) -> u32 {
        self.side
    }

    /// Squares along x and y.
    pub(in crate::pipeline) fn counts(&self) -> [u32; 2] {
        self.counts
    }

    /// The number of the square in a column and row.
    pub(in crate::pipeline) fn square(&self, [col, row]: [u32; 2]) -> usize {
        row as usize * self.counts[0] as usize + col as usize
    }

    /// The square of a point; one beyond the bounds belongs to the nearest square.
    pub(in crate::pipeline) fn square_of(&self, point: Point) -> usize {
        self.square(self.place([i64::from(point.x), i64::from(point.y)]))
    }

    /// Column and row of the square nearest to a position.
    pub(in crate::pipeline) fn place(&self, at: [i64; 2]) -> [u32; 2] {
        [0, 1].map(|axis| {
            let steps = at[axis] - i64::from(self.low[axis]);
            let last = i64::from(self.counts[axis]) - 1;
            steps.div_euclid(i64::from(self.side)).clamp(0, last) as u32
        })
    }

    /// The squares that a box (lowest and highest corner) touches, row by row; those at the rim also
    /// stand for what lies beyond them.
    pub(in crate::pipeline) fn touching(
        &self,
        [low, high]: [[i64; 2]; 2],
    ) -> impl Iterator<Item = usize> + use<> {
        let (across, low, high) = (self.counts[0] as usize, self.place(low), self.place(high));
        let row = move |row: u32| (low[0]..=high[0]).map(move |col| (row, col));
        (low[1]..=high[1]).flat_map(row).map(move |(row, col)| row as usize * across + col as usize)
    }

    /// Lowest and highest corner of a square's box, both in it.
    pub(in crate::pipeline) fn corners(&self, square: usize) -> [[i64; 2]; 2] {
        let across = self.counts[0] as usize;
        let place = [square % across, square / across];
        let side = i64::from(self.side);
        let low = [0, 1].map(|axis| i64::from(self.low[axis]) + place[axis] as i64 * side);
        [low, low.map(|c| c + side - 1)]
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
        fn a_point_lies_in_its_square_and_a_box_touches_it(
            x in -1000..1000i32, y in -300..300i32, reach in 0..100i64, points in 0..1_000_000u64
        ) {
            let tiling = Tiling::new([Point::new(-1000, -300, 0), Point::new(999, 299, 0)], points);
            let square = tiling.square_of(Point::new(x, y, 0));
            let at = [i64::from(x), i64::from(y)];
            let [low, high] = tiling.corners(square);
            prop_assert!((0..2).all(|i| low[i] <= at[i] && at[i] <= high[i]));
            let corners = [at.map(|c| c - reach), at.map(|c| c + reach)];
            prop_assert!(tiling.touching(corners).any(|touched| touched == square));
            let all = [[-5000; 2], [5000; 2]];
            prop_assert_eq!(tiling.touching(all).count(), tiling.count());
        }
    }
}
