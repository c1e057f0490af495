//! Samples around a rectangle that a computation on it reads.

use terrane_base::geom::Rect;

/// Samples that a computation needs on each side of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SampleHalo(pub(crate) u32);

impl SampleHalo {
    /// The rectangle with the samples around it, clipped to the grid.
    pub(crate) fn around(self, rect: Rect, grid: Rect) -> Rect {
        let [left, top] = [rect.col, rect.row].map(|at| at.saturating_sub(self.0));
        let [right, bottom] = [(rect.end_col(), grid.end_col()), (rect.end_row(), grid.end_row())]
            .map(|(end, most)| end.saturating_add(self.0).min(most));
        Rect::new(left, top, right - left, bottom - top)
    }

    /// The samples that `rect` is the last to need, of rectangles that cover the grid from left to right and down: all
    /// but the last columns and rows, which the next rectangles need, and those that the rectangles before have left.
    pub(crate) fn last_read_for(self, rect: Rect, grid: Rect) -> Rect {
        let span = |first: u32, end: u32, size: u32| {
            let last = if end < size { end.saturating_sub(self.0) } else { size };
            let first = first.saturating_sub(self.0);
            (first, last.saturating_sub(first))
        };
        let (col, width) = span(rect.col, rect.end_col(), grid.width);
        let (row, height) = span(rect.row, rect.end_row(), grid.height);
        Rect::new(col, row, width, height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sample_is_released_once_and_after_its_last_use() {
        for (size, block, halo) in [
            ([23, 17], [5, 3], 1),
            ([23, 17], [5, 3], 7),
            ([9, 40], [9, 2], 100),
            ([30, 4], [4, 4], 2),
        ] {
            let (halo, grid) = (SampleHalo(halo), Rect::new(0, 0, size[0], size[1]));
            let mut released = vec![None; grid.len()];
            let mut last = vec![0; grid.len()];
            let cells = |rect: Rect| {
                (rect.row..rect.end_row()).flat_map(move |row| {
                    (rect.col..rect.end_col()).map(move |col| (row * size[0] + col) as usize)
                })
            };
            let mut number = 0;
            for row in (0..size[1]).step_by(block[1] as usize) {
                for col in (0..size[0]).step_by(block[0] as usize) {
                    let rect = Rect::new(col, row, block[0], block[1]).intersect(&grid);
                    cells(halo.around(rect, grid)).for_each(|at| last[at] = number);
                    for at in cells(halo.last_read_for(rect, grid)) {
                        assert_eq!(released[at].replace(number), None, "{rect:?} {halo:?}");
                    }
                    number += 1;
                }
            }
            let all: Vec<u32> = released.into_iter().map(Option::unwrap).collect();
            assert!(all.iter().zip(&last).all(|(released, last)| released >= last), "{halo:?}");
        }
    }
}
