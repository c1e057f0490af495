//! The points nearest to positions, among points that come in chunks.

use terrane_base::geom::Point;

/// A position and the nearest point found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NearestQuery {
    /// Column and row.
    pub at: [i32; 2],
    /// The squared distance and the point; of equal distances the lowest point by x, y and z.
    pub found: Option<(i64, Point)>,
}

/// Points sorted by x for nearest-point queries.
#[derive(Debug)]
pub struct ProofNearestPoints(Vec<Point>);

impl ProofNearestPoints {
    /// Among these.
    pub fn of(mut points: Vec<Point>) -> Self {
        points.sort_unstable();
        Self(points)
    }

    /// Replaces the point found by a nearer one: goes east and west until all others are further away.
    pub fn improve(&self, sought: &mut NearestQuery) {
        let x = sought.at[0];
        let (west, east) = self.0.split_at(self.0.partition_point(|point| point.x < x));
        east.iter().all(|point| sought.improve(*point));
        west.iter().rev().all(|point| sought.improve(*point));
    }
}

impl NearestQuery {
    /// Takes note of a point; false when the difference in x alone is larger than the distance found.
    fn improve(&mut self, point: Point) -> bool {
        // In 64 bits, as differences may overflow 32.
        let dx = i64::from(point.x) - i64::from(self.at[0]);
        let dy = i64::from(point.y) - i64::from(self.at[1]);
        if self.found.is_some_and(|(nearest, _)| dx * dx > nearest) {
            return false;
        }
        let candidate = (dx * dx + dy * dy, point);
        self.found = Some(self.found.map_or(candidate, |found| found.min(candidate)));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_nearest_is_found_in_any_heaps(
            points in prop::collection::vec((0..30i32, 0..30i32, 0..3i32), 1..60),
            at in [0..30i32, 0..30i32], cut in 0..60usize
        ) {
            let points: Vec<Point> = points.iter().map(|&(x, y, z)| Point::new(x, y, z)).collect();
            let (a, b) = points.split_at(cut.min(points.len()));
            let mut sought = NearestQuery { at, found: None };
            [b, a].iter().for_each(|heap| ProofNearestPoints::of(heap.to_vec()).improve(&mut sought));
            let far = |p: &Point| i64::from((p.x - at[0]).pow(2) + (p.y - at[1]).pow(2));
            prop_assert_eq!(sought.found, points.iter().map(|p| (far(p), *p)).min());
        }
    }
}
