//! Spatial index of points in the plane for triangles and edges.
//!
//! Things are cut by their rows into strips of about equal numbers, and lie by columns within each:
//! where they are dense, strips are thin, so that a search visits few others.

use std::ops::Range;

use crate::ProofPosition;
use crate::sections::floor;
use terrane_base::geom::Point;

/// Things of a strip, as a multiple of the root of their number.
const PER_ROOT: usize = 4;
/// Steps by which a place may be off in `f64`, and more.
const DOUBT: f64 = 1.0;

/// Something with a place: column and row in whole steps, rounded down.
pub(super) trait StripItem: Copy {
    fn place(&self) -> [i64; 2];
}

impl StripItem for Point {
    fn place(&self) -> [i64; 2] {
        [self.x, self.y].map(i64::from)
    }
}

impl StripItem for ProofPosition {
    fn place(&self) -> [i64; 2] {
        [self.col, self.row].map(floor)
    }
}

/// Consecutive things and the rows of the first and the last.
#[derive(Debug)]
struct ProofStrip {
    rows: [i64; 2],
    things: Range<usize>,
}

/// Things in strips.
#[derive(Debug)]
pub(super) struct ProofStrips<T> {
    things: Vec<T>,
    strips: Vec<ProofStrip>,
}

impl<T: StripItem> ProofStrips<T> {
    /// Of things that are sorted by rows. O(n log n).
    pub(super) fn new(mut things: Vec<T>) -> Self {
        let size = PER_ROOT * things.len().isqrt().max(1);
        let mut strips = Vec::new();
        for (number, strip) in things.chunks_mut(size).enumerate() {
            let rows = [0, strip.len() - 1].map(|i| strip[i].place()[1]);
            let first = number * size;
            strips.push(ProofStrip { rows, things: first..first + strip.len() });
            strip.sort_unstable_by_key(|thing| thing.place()[0]);
        }
        Self { things, strips }
    }

    /// All things, in the order that ranges refer to.
    pub(super) fn things(&self) -> &[T] {
        &self.things
    }

    /// Calls `visit` with ranges of things that together hold all that lie in the convex hull of
    /// `corners`.
    pub(super) fn visit(&self, corners: &[ProofPosition], mut visit: impl FnMut(Range<usize>)) {
        let rows = corners.iter().map(|corner| floor(corner.row));
        let (low, high) = rows.fold((i64::MAX, i64::MIN), |(l, h), row| (l.min(row), h.max(row)));
        let first = self.strips.partition_point(|strip| strip.rows[1] < low);
        for ProofStrip { rows, things } in &self.strips[first..] {
            if rows[0] > high {
                break;
            }
            let [left, right] = columns(corners, *rows);
            let from = things.start;
            let things = &self.things[things.clone()];
            let skip = things.partition_point(|thing| (thing.place()[0] as f64) < left);
            let count = things[skip..].partition_point(|thing| thing.place()[0] as f64 <= right);
            if count > 0 {
                visit(from + skip..from + skip + count);
            }
        }
    }
}

/// First and last column of the part of a convex polygon that lies in some rows (their last one to
/// its end), with a column of doubt on each side.
fn columns(corners: &[ProofPosition], [low, high]: [i64; 2]) -> [f64; 2] {
    let (low, high) = (low as f64 - DOUBT, high as f64 + 1.0 + DOUBT);
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    for (i, p) in corners.iter().enumerate() {
        let q = &corners[(i + 1) % corners.len()];
        let (p, q) = ([p.cols(), p.rows()], [q.cols(), q.rows()]);
        if p[1].max(q[1]) < low || p[1].min(q[1]) > high {
            continue;
        }
        for col in [clipped(p, q, low, high), clipped(q, p, low, high)] {
            (left, right) = (left.min(col), right.max(col));
        }
    }
    [left.floor() - DOUBT, right + DOUBT]
}

/// The column where the edge from `p` to `q` is in the rows first, seen from `p`.
fn clipped(p: [f64; 2], q: [f64; 2], low: f64, high: f64) -> f64 {
    let row = p[1].clamp(low, high);
    if row == p[1] { p[0] } else { p[0] + (row - p[1]) / (q[1] - p[1]) * (q[0] - p[0]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::double_area;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn everything_inside_is_visited_once(
            mut points in prop::collection::vec([0..60i32, 0..60i32], 0..400),
            corners in prop::array::uniform3([-20.0..80.0f64, -20.0..80.0]),
            narrow in 1..60i32,
        ) {
            points.iter_mut().for_each(|p| p[1] %= narrow);
            let mut points: Vec<Point> = points.iter().map(|p| Point::new(p[0], p[1], 0)).collect();
            points.sort_unstable_by_key(|p| (p.y, p.x));
            let corners = corners.map(|[c, r]| ProofPosition::nearest(c, r));
            let strips = ProofStrips::new(points);
            let mut seen = vec![0; strips.things().len()];
            strips.visit(&corners, |range| range.for_each(|i| seen[i] += 1));
            let [a, b, c] = corners;
            for (point, seen) in strips.things().iter().zip(seen) {
                let at = ProofPosition::sample(i64::from(point.x), i64::from(point.y));
                let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| double_area(p, q, at));
                let inside = sides.iter().all(|&s| s >= 0) || sides.iter().all(|&s| s <= 0);
                prop_assert!(seen == 1 || seen == 0 && !inside);
            }
        }
    }

    #[test]
    fn few_others_are_visited() {
        // A square of points, crowded a thousandfold in one corner.
        let spread = (0..10_000).map(|i| Point::new(i % 100 * 1000, i / 100 * 1000, 0));
        let crowd = (0..10_000).map(|i| Point::new(i % 100, i / 100, 0));
        let mut points: Vec<Point> = spread.chain(crowd).collect();
        points.sort_unstable_by_key(|p| (p.y, p.x));
        let strips = ProofStrips::new(points);
        let mut visited = 0;
        for (col, row) in (0..99).flat_map(|c| (0..99).map(move |r| (c, r))) {
            let corners =
                [[0, 0], [1, 0], [0, 1]].map(|[c, r]| ProofPosition::sample(col + c, row + r));
            strips.visit(&corners, |range| visited += range.len());
        }
        assert!(visited / (99 * 99) < 400, "{}", visited / (99 * 99));
    }
}
