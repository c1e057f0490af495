//! Weights of a grid near its voids: where it fades into the grids below.

use terrane_base::geom::Rect;

/// Distances to the nearest void, up to a number of cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Feather(pub(super) u32);

impl Feather {
    /// The rectangle whose samples determine the weights of a piece.
    pub(super) fn around(self, piece: Rect, bounds: Rect) -> Rect {
        let Self(cells) = self;
        let first = [piece.col, piece.row].map(|first| first.saturating_sub(cells));
        let end = [piece.end_col(), piece.end_row()].map(|end| end.saturating_add(cells));
        Rect::new(first[0], first[1], end[0] - first[0], end[1] - first[1]).intersect(&bounds)
    }

    /// Weights of the samples of a piece, from the heights of the rectangle around it: the distance to the nearest void,
    /// in cells, by one more than the width of the feather, at most 1. `O(n w)` for n samples and the width w.
    pub(super) fn weights(
        self,
        piece: Rect,
        around: Rect,
        heights: &[f64],
        weights: &mut Vec<f64>,
    ) {
        weights.clear();
        if self.0 == 0 || !heights.iter().any(|height| height.is_nan()) {
            weights.resize(piece.len(), 1.0);
            return;
        }
        let (width, most) = (around.width as usize, self.0 + 1);
        // Columns to the nearest void of the same row.
        let mut across = vec![most; heights.len()];
        for (across, heights) in across.chunks_exact_mut(width).zip(heights.chunks_exact(width)) {
            let mut near = most;
            for (at, height) in heights.iter().enumerate() {
                near = if height.is_nan() { 0 } else { (near + 1).min(most) };
                across[at] = near;
            }
            near = most;
            for (at, height) in heights.iter().enumerate().rev() {
                near = if height.is_nan() { 0 } else { (near + 1).min(most) };
                across[at] = across[at].min(near);
            }
        }
        for row in piece.row..piece.end_row() {
            let rows = row.saturating_sub(self.0).max(around.row)
                ..row.saturating_add(most).min(around.end_row());
            for col in piece.col..piece.end_col() {
                let at = (col - around.col) as usize;
                let nearest = rows.clone().map(|other| {
                    let [columns, rows] =
                        [across[(other - around.row) as usize * width + at], other.abs_diff(row)];
                    u64::from(columns).pow(2) + u64::from(rows).pow(2)
                });
                let nearest = nearest.min().unwrap_or(0) as f64;
                weights.push((nearest.sqrt() / f64::from(most)).min(1.0));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn weights_are_distances_to_the_nearest_void(
            voids in prop::collection::vec((0_u32..30, 0_u32..20), 0..12), cells in 1_u32..9,
            col in 0_u32..20, row in 0_u32..10,
        ) {
            let (bounds, piece) = (Rect::new(0, 0, 30, 20), Rect::new(col, row, 10, 10));
            let around = Feather(cells).around(piece, bounds);
            let is_void = |col: u32, row: u32| voids.contains(&(col, row));
            let places = |rect: Rect| {
                (rect.row..rect.end_row()).flat_map(move |row| (rect.col..rect.end_col()).map(move |col| (col, row)))
            };
            let heights: Vec<f64> =
                places(around).map(|(col, row)| if is_void(col, row) { f64::NAN } else { 1.0 }).collect();
            let mut weights = Vec::new();
            Feather(cells).weights(piece, around, &heights, &mut weights);
            for ((col, row), weight) in places(piece).zip(&weights) {
                let distance = |(c, r): &(u32, u32)| f64::from(col.abs_diff(*c)).hypot(f64::from(row.abs_diff(*r)));
                let nearest = voids.iter().map(distance).fold(f64::INFINITY, f64::min);
                let expected = (nearest / f64::from(cells + 1)).min(1.0);
                prop_assert!((weight - expected).abs() < 1e-12, "{col} {row}: {weight} {expected}");
            }
        }
    }
}
