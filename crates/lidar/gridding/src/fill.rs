//! Voids filled from the cells around them.

use terrane_base::geom::Rect;

/// Fills the voids of `rect` from the cells with a value that are at most `reach` columns and rows
/// away: their mean, weighted by the inverse of the larger of both distances. Voids without such a cell
/// stay void.
///
/// `values` are those of `around` (row by row, NaN for voids), which holds `rect` and its surroundings; the
/// result is written to `out`, row by row. The sums run row by row over the neighbours, so the value of a cell
/// does not depend on `rect`.
pub fn fill(values: &[f64], around: Rect, rect: Rect, reach: u32, out: &mut [f64]) {
    let stride = around.width as usize;
    let (left, top) = ((rect.col - around.col) as usize, (rect.row - around.row) as usize);
    for (row, line) in (top..).zip(out.chunks_exact_mut(rect.width as usize)) {
        for (col, out) in (left..).zip(line) {
            let value = values[row * stride + col];
            *out =
                if value.is_nan() { from_around(values, stride, [col, row], reach) } else { value };
        }
    }
}

fn from_around(values: &[f64], stride: usize, [col, row]: [usize; 2], reach: u32) -> f64 {
    let (reach, height) = (reach as usize, values.len() / stride);
    let rows = row.saturating_sub(reach)..(row + reach + 1).min(height);
    let cols = col.saturating_sub(reach)..(col + reach + 1).min(stride);
    let (mut sum, mut weights) = (0.0, 0.0);
    for near_row in rows {
        let down = near_row.abs_diff(row);
        let line = &values[near_row * stride..][cols.clone()];
        for (near_col, value) in cols.clone().zip(line).filter(|(_, value)| !value.is_nan()) {
            let weight = 1.0 / down.max(near_col.abs_diff(col)) as f64;
            sum += value * weight;
            weights += weight;
        }
    }
    // Without a known one: 0 / 0, which is void.
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::*;

    const V: f64 = f64::NAN;

    #[test]
    fn known_neighbours_are_weighted_by_the_larger_distance() {
        let values = [1.0, V, V, V, 5.0, V, V, V, V, V, V, V, 9.0, V, V];
        let whole = Rect::new(0, 0, 5, 3);
        let mut out = [0.0; 15];
        fill(&values, whole, whole, 2, &mut out);
        // Cell (1, 1): 1 at distance 1, 9 at distance 1.
        assert_eq!(out[6], (1.0 + 9.0) / 2.0);
        // Cell (3, 0): 5 at distance 1, 9 at distance 2.
        assert_eq!(out[3], (5.0 + 9.0 * 0.5) / 1.5);
        assert_eq!((out[0], out[4], out[12]), (1.0, 5.0, 9.0));
        let mut near = [0.0; 15];
        fill(&values, whole, whole, 1, &mut near);
        assert!(near[2].is_nan() && near[10].is_nan());
    }

    #[test]
    fn cells_are_filled_as_the_definition_says() {
        let (width, height) = (11_i64, 7_i64);
        let known = |i: i64| i * 7919 % 13 == 0;
        let values: Vec<f64> =
            (0..width * height).map(|i| if known(i) { i as f64 } else { V }).collect();
        let whole = Rect::new(0, 0, width as u32, height as u32);
        for reach in 1..5 {
            let mut out = vec![0.0; values.len()];
            fill(&values, whole, whole, reach as u32, &mut out);
            for at in (0..width * height).filter(|at| !known(*at)) {
                let apart =
                    |i: i64| (i % width - at % width).abs().max((i / width - at / width).abs());
                let near: Vec<i64> =
                    (0..width * height).filter(|i| known(*i) && apart(*i) <= reach).collect();
                let weight = |i: &i64| 1.0 / apart(*i) as f64;
                let sum: f64 = near.iter().map(|i| weight(i) * *i as f64).sum();
                let expected = sum / near.iter().map(weight).sum::<f64>();
                let found = out[at as usize];
                let is_void = near.is_empty();
                assert!(if is_void { found.is_nan() } else { (found - expected).abs() < 1e-9 });
            }
        }
    }

    #[test]
    fn parts_are_filled_as_the_whole_is() {
        let values: Vec<f64> =
            (0..400).map(|i| if i * 7919 % 11 == 0 { f64::from(i) / 3.0 } else { V }).collect();
        let whole = Rect::new(0, 0, 20, 20);
        let mut expected = vec![0.0; 400];
        fill(&values, whole, whole, 3, &mut expected);
        let around = Rect::new(4, 2, 12, 12);
        let part = Rect::new(7, 5, 6, 6);
        let rows = (2..14).flat_map(|row| values[row * 20 + 4..row * 20 + 16].to_vec());
        let mut out = vec![0.0; 36];
        fill(&rows.collect::<Vec<_>>(), around, part, 3, &mut out);
        for (i, value) in out.iter().enumerate() {
            assert_eq!(value.to_bits(), expected[(5 + i / 6) * 20 + 7 + i % 6].to_bits());
        }
    }
}
