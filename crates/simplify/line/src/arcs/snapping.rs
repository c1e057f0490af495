//! Snapping of almost identical positions.

use std::collections::HashMap;

use super::bins::{PositionBins, within};
use terrane_base::geom::plane::Xy;

/// Width of a cell relative to the distance: rounding cannot place two positions within the distance two cells
/// apart.
const SLACK: f64 = 1.0 + 1.0 / 1_048_576.0;

/// Moves positions onto others no farther than `distance`.
///
/// Positions are processed in order of x, then y. A position within the distance of `stayed`, or of fixed
/// positions before it, moves to the lowest of them; otherwise it is fixed. So fixed positions are farther
/// apart than the distance, no position moves farther, and the input order does not matter.
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

/// Lowest anchor within the distance of `p`, which lies in `cell`.
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
