//! Positions that are nearly the same made the same.

use std::collections::HashMap;

use super::bins::{Bins, within};
use crate::geom::plane::Xy;

/// Cells of anchors are so much wider than the distance, that rounding cannot put two positions within
/// it two cells apart.
const SLACK: f64 = 1.0 + 1.0 / 1_048_576.0;

/// Moves positions onto others no farther than `distance`.
///
/// The positions are taken from the lowest on, by x, then y. One that is within the distance of
/// positions before it that have stayed moves to the lowest of them; otherwise it stays. So those that
/// stay are farther than the distance from each other, none moves farther than it, and the order of
/// the positions makes no difference.
pub(super) fn snap(points: &mut [Xy], distance: f64) {
    let mut order = Bins::new(points, distance * SLACK).close(points, distance);
    let order_of = |v: u32| points[v as usize].map(|c| c + 0.0);
    order.sort_unstable_by(|&a, &b| {
        let (p, q) = (order_of(a), order_of(b));
        p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1]))
    });
    let mut anchors: HashMap<[i64; 2], Vec<Xy>> = HashMap::new();
    for v in order {
        let p = points[v as usize];
        let cell = p.map(|c| (c / (distance * SLACK)).floor() as i64);
        match lowest(&anchors, cell, p, distance) {
            Some(anchor) => points[v as usize] = anchor,
            None => anchors.entry(cell).or_default().push(p),
        }
    }
}

/// The lowest anchor within the distance of `p`, which lies in `cell`.
fn lowest(
    anchors: &HashMap<[i64; 2], Vec<Xy>>,
    cell: [i64; 2],
    p: Xy,
    distance: f64,
) -> Option<Xy> {
    let around =
        (0..9).map(|k| [cell[0].saturating_add(k % 3 - 1), cell[1].saturating_add(k / 3 - 1)]);
    around
        .filter_map(|cell| anchors.get(&cell))
        .flatten()
        .filter(|&&anchor| within(anchor, p, distance))
        .min_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])))
        .copied()
}
