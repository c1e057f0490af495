//! The slow, obvious way: each level by itself, each cell by itself, segments joined by search.

use std::collections::BTreeMap;

use super::{ContourLevels, ContourVertex, CrossedEdge, NEAREST};

/// A line: its level's height, its vertices (a ring's first is repeated), whether it is a ring.
pub(super) type Line = (f64, Vec<ContourVertex>, bool);

/// All lines of a grid of `width` columns at a level, rings beginning at their lowest edge.
pub(super) fn lines(heights: &[f64], width: usize, level: f64) -> Vec<Line> {
    let mut segments = BTreeMap::new();
    for row in 1..heights.len() / width {
        for col in 1..width {
            for (from, to) in cell(heights, width, col - 1, row - 1, level) {
                assert!(
                    segments.insert(from.edge, (from, to)).is_none(),
                    "two lines leave an edge"
                );
            }
        }
    }
    join(segments).into_iter().map(|(vertices, closed)| (level, vertices, closed)).collect()
}

/// Levels between the lowest and the highest height, as `levels` numbers them.
pub(super) fn levels_of(
    heights: &[f64],
    levels: &ContourLevels,
    numbers: std::ops::Range<i32>,
) -> Vec<f64> {
    let valid = || heights.iter().copied().filter(|z| !z.is_nan());
    let (low, high) = (valid().fold(f64::MAX, f64::min), valid().fold(f64::MIN, f64::max));
    numbers.map(|k| levels.height(k)).filter(|level| (low..=high).contains(level)).collect()
}

/// The directed segments of the cell whose first sample is (`col`, `row`).
fn cell(
    heights: &[f64],
    width: usize,
    col: usize,
    row: usize,
    level: f64,
) -> Vec<(ContourVertex, ContourVertex)> {
    let z = |c: usize, r: usize| heights[(row + r) * width + col + c];
    let corners = [(0, 0), (1, 0), (1, 1), (0, 1)];
    if corners.iter().any(|&(c, r)| z(c, r).is_nan()) {
        return Vec::new();
    }
    let above = |i: usize| z(corners[i % 4].0, corners[i % 4].1) >= level;
    // Crossings in the order in which they are met on the way around the cell.
    let met: Vec<usize> = (0..4).filter(|&i| above(i) != above(i + 1)).collect();
    let vertices: [ContourVertex; 4] = std::array::from_fn(|i| {
        let [a, b] = [corners[i], corners[(i + 1) % 4]];
        let (first, second) = if a < b { (a, b) } else { (b, a) };
        let (za, zb) = (z(first.0, first.1), z(second.0, second.1));
        let at = ((level - za) / (zb - za)).clamp(NEAREST, 1.0 - NEAREST);
        let (x, y) = ((col + first.0) as u32, (row + first.1) as u32);
        ContourVertex { edge: CrossedEdge::new(x, y, first.0 == second.0, width as u32), at }
    });
    let pairs = match met[..] {
        [a, b] => vec![(a, b)],
        [a, b, c, d] => {
            let middle = (z(0, 0) + z(1, 0) + (z(0, 1) + z(1, 1))) / 4.0 >= level;
            // The corner after crossing a belongs with the middle, or is cut off from it.
            if above(a + 1) == middle { vec![(d, a), (b, c)] } else { vec![(a, b), (c, d)] }
        }
        _ => vec![],
    };
    let segments =
        pairs.into_iter().map(|(a, b)| directed(vertices[a], vertices[b], above(a), a, width));
    segments.collect()
}

/// The segment between two crossings with the higher corner of the first one's side on its right.
fn directed(
    a: ContourVertex,
    b: ContourVertex,
    first_is_above: bool,
    side: usize,
    width: usize,
) -> (ContourVertex, ContourVertex) {
    let ([ax, ay], [bx, by]) = (a.place(width as u32), b.place(width as u32));
    // The corner before the crossing on the way around, a little way back along the side.
    let back = [[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0]][side];
    // Rows go south, so a positive product is on the right.
    let product = (bx - ax) * back[1] - (by - ay) * back[0];
    if (product > 0.0) == first_is_above { (a, b) } else { (b, a) }
}

fn join(
    mut segments: BTreeMap<CrossedEdge, (ContourVertex, ContourVertex)>,
) -> Vec<(Vec<ContourVertex>, bool)> {
    let mut all = Vec::new();
    while !segments.is_empty() {
        let entered: Vec<CrossedEdge> = segments.values().map(|(_, to)| to.edge).collect();
        let open = segments.keys().find(|edge| !entered.contains(edge)).copied();
        let lowest = segments.keys().next().copied();
        let mut line = Vec::new();
        let mut at = open.or(lowest).unwrap();
        while let Some((from, to)) = segments.remove(&at) {
            if line.is_empty() {
                line.push(from);
            }
            line.push(to);
            at = to.edge;
        }
        all.push((line, open.is_none()));
    }
    all
}
