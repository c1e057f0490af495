//! Positions that are nearly the same made the same.

use std::collections::HashMap;

use super::bins::{PositionBins, within};
use terrane_base::geom::plane::Xy;

/// Cells of anchors are so much wider than the distance, that rounding cannot put two positions within
/// it two cells apart.
const SLACK: f64 = 1.0 + 1.0 / 1_048_576.0;

/// Moves positions onto others no farther than `distance`.
///
/// The positions are taken from the lowest on, by x, then y. One that is within the distance of
/// `stayed`, or of positions before it that have stayed, moves to the lowest of them; otherwise it stays.
/// So those that stay are farther than the distance from each other, none moves farther than it, and
/// the order of the positions makes no difference.
pub(super) fn snap(points: &mut [Xy], stayed: &[Xy], distance: f64) {
    let all = [stayed, points].concat();
    let mut order = PositionBins::new(&all, distance * SLACK).close(&all, distance);
    let is_free = |v: u32| v as usize >= stayed.len();
    order.sort_unstable_by(|&a, &b| {
        let [p, q] = [a, b].map(|v| all[v as usize].map(|c| c + 0.0));
        let by_place = p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1]));
        is_free(a).cmp(&is_free(b)).then(by_place)
    });
    let mut anchors: HashMap<[i64; 2], Vec<Xy>> = HashMap::new();
    for v in order {
        let p = all[v as usize];
        let cell = p.map(|c| (c / (distance * SLACK)).floor() as i64);
        match lowest(&anchors, cell, p, distance).filter(|_| is_free(v)) {
            Some(anchor) => points[v as usize - stayed.len()] = anchor,
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
