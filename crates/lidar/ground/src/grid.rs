//! Operations on the cells of a window.

use std::ops::Range;

/// The cells within `reach` of one along a row or a column of `count` cells.
#[inline]
pub(crate) fn within(at: usize, reach: usize, count: usize) -> Range<usize> {
    at.saturating_sub(reach)..(at + reach + 1).min(count)
}

/// The existing cells north, south, west and east of one.
pub(crate) fn neighbours(at: usize, width: usize, cells: usize) -> impl Iterator<Item = usize> {
    let col = at % width;
    let beside = [
        (at + width < cells).then_some(at + width),
        at.checked_sub(width),
        (col > 0).then(|| at - 1),
        (col + 1 < width).then_some(at + 1),
    ];
    beside.into_iter().flatten()
}

/// Fills unknown heights from the nearest known cells, by steps along rows and columns; of several neighbours
/// with their mean. All stay unknown if none is known.
pub(crate) fn nearest_filled(heights: &[f64], width: usize) -> Vec<f64> {
    let (mut filled, cells) = (heights.to_vec(), heights.len());
    let rim = (0..cells).filter(|&at| {
        heights[at].is_nan() && neighbours(at, width, cells).any(|k| !heights[k].is_nan())
    });
    let mut rim: Vec<usize> = rim.collect();
    while !rim.is_empty() {
        // All of a rim before any is set: a cell depends on those known before it.
        let values: Vec<f64> = rim.iter().map(|&at| mean_beside(&filled, width, at)).collect();
        for (at, value) in rim.iter().zip(values) {
            filled[*at] = value;
        }
        let next = rim.iter().flat_map(|&at| neighbours(at, width, cells));
        let mut next: Vec<usize> = next.filter(|&k| filled[k].is_nan()).collect();
        next.sort_unstable();
        next.dedup();
        rim = next;
    }
    filled
}

/// The mean of the known heights of neighbours.
fn mean_beside(heights: &[f64], width: usize, at: usize) -> f64 {
    let known = || neighbours(at, width, heights.len()).map(|k| heights[k]).filter(|z| !z.is_nan());
    known().sum::<f64>() / known().count() as f64
}

/// Heights with a margin of one cell, copied from the border.
pub(crate) fn widened(heights: &[f64], width: usize) -> Vec<f64> {
    let rows = heights.len() / width;
    let cells = (0..rows + 2).flat_map(|row| (0..width + 2).map(move |col| (col, row)));
    let heights = cells.map(|(col, row)| {
        let [col, row] = [(col, width), (row, rows)]
            .map(|(at, count)| at.saturating_sub(1).min(count.saturating_sub(1)));
        heights.get(row * width + col).copied().unwrap_or(f64::NAN)
    });
    heights.collect()
}

/// At each cell, the best of the square of `side` cells that starts there, towards higher columns and rows;
/// cells beyond the end are ignored.
pub(crate) fn slid<T: Copy>(
    mut from: Vec<T>,
    width: usize,
    side: usize,
    better: impl Fn(T, T) -> T + Copy,
) -> Vec<T> {
    let mut to = from.clone();
    for shift in shifts(side) {
        for (line, to) in from.chunks_exact(width).zip(to.chunks_exact_mut(width)) {
            join(line, to, shift, better);
        }
        std::mem::swap(&mut from, &mut to);
    }
    for shift in shifts(side) {
        join(&from, &mut to, shift * width, better);
        std::mem::swap(&mut from, &mut to);
    }
    from
}

/// Makes of each value the better of itself and the one `shift` after it.
fn join<T: Copy>(from: &[T], to: &mut [T], shift: usize, better: impl Fn(T, T) -> T) {
    let pairs = from.len().saturating_sub(shift);
    let after = &from[from.len() - pairs..];
    for ((to, a), b) in to.iter_mut().zip(from).zip(after) {
        *to = better(*a, *b);
    }
    to[pairs..].copy_from_slice(&from[pairs..]);
}

/// Shifts that build a window of `side`: doubled while smaller, then two overlapping windows.
pub(crate) fn shifts(side: usize) -> impl Iterator<Item = usize> {
    let doubled = std::iter::successors(Some(1), |span| Some(span * 2));
    let doubled = doubled.take_while(move |span| span * 2 <= side);
    let covered = 1 << side.ilog2();
    doubled.chain((covered < side).then_some(side - covered))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_make_a_square() {
        for side in 1..40 {
            assert_eq!(1 + shifts(side).sum::<usize>(), side);
        }
    }
}
