//! Positions in grid cells, to find identical ones.

use terrane_base::geom::plane::Xy;

/// Average number of positions per cell.
const LOAD: usize = 4;

/// Positions in the cells of a uniform grid.
#[derive(Debug)]
pub(super) struct PositionBins {
    low: Xy,
    /// Cells per unit of x and of y.
    scale: Xy,
    /// Cells along x and along y.
    size: [usize; 2],
    /// Start of each cell in `order`.
    starts: Vec<u32>,
    /// Indices of positions by cell, ascending in each.
    order: Vec<u32>,
}

impl PositionBins {
    /// For fewer than 2^32 finite positions, with cells at least `side` wide and high. O(n).
    pub(super) fn new(points: &[Xy], side: f64) -> Self {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for p in points {
            for axis in 0..2 {
                low[axis] = low[axis].min(p[axis]);
                high[axis] = high[axis].max(p[axis]);
            }
        }
        let wide = [0, 1].map(|axis| if points.is_empty() { 0.0 } else { high[axis] - low[axis] });
        let (size, scale) = shape(wide, points.len() / LOAD, side);
        let mut bins = Self { low, scale, size, starts: vec![], order: vec![0; points.len()] };
        bins.starts = vec![0; size[0] * size[1] + 1];
        for &p in points {
            let cell = bins.cell(p);
            bins.starts[cell] += 1;
        }
        let mut sum = 0;
        for start in &mut bins.starts {
            sum += *start;
            *start = sum;
        }
        // From the last on, as cells are filled from their ends: numbers then ascend in each.
        for (i, &p) in points.iter().enumerate().rev() {
            let cell = bins.cell(p);
            bins.starts[cell] -= 1;
            bins.order[bins.starts[cell] as usize] = i as u32;
        }
        bins
    }

    #[inline(always)]
    fn column_row(&self, p: Xy) -> [usize; 2] {
        [0, 1].map(|axis| {
            let at = ((p[axis] - self.low[axis]) * self.scale[axis]) as usize;
            at.min(self.size[axis] - 1)
        })
    }

    #[inline(always)]
    fn cell(&self, p: Xy) -> usize {
        let [column, row] = self.column_row(p);
        row * self.size[0] + column
    }

    /// For each position, the lowest index of identical positions. O(n log n) at worst.
    pub(super) fn same(mut self, points: &[Xy]) -> Vec<u32> {
        let mut lowest = vec![0; points.len()];
        let mut order = std::mem::take(&mut self.order);
        for pair in self.starts.windows(2) {
            let cell = &mut order[pair[0] as usize..pair[1] as usize];
            // Both zeros are one position, which `total_cmp` would keep apart.
            let at = |v: u32| points[v as usize].map(|c| c + 0.0);
            cell.sort_unstable_by(|&a, &b| {
                let (p, q) = (at(a), at(b));
                p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1])).then(a.cmp(&b))
            });
            for run in cell.chunk_by(|&a, &b| at(a) == at(b)) {
                run.iter().for_each(|&v| lowest[v as usize] = run[0]);
            }
        }
        lowest
    }

    /// Indices of positions with a different one within `reach`, which is at most the `side` of the cells;
    /// ascending.
    pub(super) fn close(&self, points: &[Xy], reach: f64) -> Vec<u32> {
        (0..points.len() as u32).filter(|&v| self.has_near(points, v, reach)).collect()
    }

    #[inline]
    fn has_near(&self, points: &[Xy], v: u32, reach: f64) -> bool {
        let p = points[v as usize];
        let [low, high] = [-reach, reach].map(|by| self.column_row([p[0] + by, p[1] + by]));
        (low[1]..=high[1]).any(|row| {
            let first = self.starts[row * self.size[0] + low[0]] as usize;
            let end = self.starts[row * self.size[0] + high[0] + 1] as usize;
            let mut others = self.order[first..end].iter().map(|&o| points[o as usize]);
            others.any(|q| p != q && within(p, q, reach))
        })
    }
}

/// Whether two positions are within `reach`.
#[inline(always)]
pub(super) fn within(p: Xy, q: Xy, reach: f64) -> bool {
    let (x, y) = (p[0] - q[0], p[1] - q[1]);
    x * x + y * y <= reach * reach
}

/// Number of cells, and cells per unit, for a number of positions; none narrower than `side`.
fn shape(wide: Xy, count: usize, side: f64) -> ([usize; 2], Xy) {
    let count = count.max(1) as f64;
    let [w, h] = wide;
    let share = match (w > 0.0, h > 0.0) {
        (true, true) => {
            let columns = (count.sqrt() * (w.sqrt() / h.sqrt())).clamp(1.0, count);
            [columns, count / columns]
        }
        (true, false) => [count, 1.0],
        (false, true) => [1.0, count],
        (false, false) => [1.0, 1.0],
    };
    let size = [0, 1].map(|axis| {
        let most = if side > 0.0 { (wide[axis] / side).floor() } else { f64::INFINITY };
        share[axis].floor().min(most).max(1.0) as usize
    });
    let scale = [0, 1].map(|axis| match wide[axis] > 0.0 {
        true => size[axis] as f64 / wide[axis],
        false => 0.0,
    });
    (size, scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn cells_are_about_as_wide_as_high() {
        assert_eq!(shape([100.0, 25.0], 64, 0.0), ([16, 4], [0.16, 0.16]));
        assert_eq!(shape([25.0, 100.0], 64, 0.0), ([4, 16], [0.16, 0.16]));
        assert_eq!(shape([100.0, 100.0], 10_000, 20.0), ([5, 5], [0.05, 0.05]));
        assert_eq!(shape([1000.0, 1e-9], 8, 0.0).0, [8, 1]);
        assert_eq!(shape([8.0, 0.0], 4, 0.0), ([4, 1], [0.5, 0.0]));
        assert_eq!(shape([0.0, 8.0], 4, 0.0), ([1, 4], [0.0, 0.5]));
        assert_eq!(shape([0.0, 0.0], 4, 0.0), ([1, 1], [0.0, 0.0]));
        assert_eq!(shape([8.0, 8.0], 0, 0.0).0, [1, 1]);
        assert_eq!(shape([8.0, 8.0], 64, 9.0).0, [1, 1]);
    }

    proptest! {
        #[test]
        fn bins_find_what_searches_find(
            cells in proptest::collection::vec((0i32..30, 0i32..9), 0..150),
            reach in 0.5f64..6.0,
        ) {
            let points: Vec<Xy> = cells.iter().map(|(x, y)| [f64::from(*x), f64::from(*y)]).collect();
            let bins = PositionBins::new(&points, reach);
            let near = |p: Xy, q: Xy| p != q && (p[0] - q[0]).hypot(p[1] - q[1]) <= reach;
            let close: Vec<u32> = (0..points.len() as u32)
                .filter(|v| points.iter().any(|q| near(points[*v as usize], *q)))
                .collect();
            prop_assert_eq!(bins.close(&points, reach), close);
            let mut all = bins.order.clone();
            all.sort_unstable();
            prop_assert_eq!(all, (0..points.len() as u32).collect::<Vec<_>>());
            let first = |p: &Xy| points.iter().position(|q| q == p).unwrap() as u32;
            let lowest: Vec<u32> = points.iter().map(first).collect();
            prop_assert_eq!(PositionBins::new(&points, 0.0).same(&points), lowest);
        }
    }

    #[test]
    fn cells_have_about_as_many_each() {
        let points: Vec<Xy> = (0..4096).map(|i| [f64::from(i % 64), f64::from(i / 64)]).collect();
        let bins = PositionBins::new(&points, 0.0);
        assert_eq!(bins.size, [32, 32]);
        let most = bins.starts.windows(2).map(|pair| pair[1] - pair[0]).max();
        assert!(most.is_some_and(|most| most <= 9), "{most:?}");
    }
}
