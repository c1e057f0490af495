//! The ground surface of a method: a height for each cell, and a tolerance for ground points.

/// Cells on each side that a slope, and a height between cells, are taken from.
pub(crate) const BESIDE: usize = 1;

/// The ground under a window of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundSurface {
    /// Cells of a row, and of a row with its margins.
    width: usize,
    wide: usize,
    /// Height at the centre of each cell and of those beside the window, in steps, or NaN if unknown.
    heights: Vec<f64>,
    /// Largest distance of a ground point of a cell from it, in steps.
    pub(crate) tolerances: Vec<f32>,
}

impl GroundSurface {
    /// The surface of heights in steps at the cells and those beside the window, NaN if unknown; `tolerance` is
    /// a function of the slope in steps per cell.
    pub(crate) fn new(width: usize, heights: Vec<f64>, tolerance: impl Fn(f64) -> f64) -> Self {
        let mut ground = Self { width, wide: width + 2 * BESIDE, heights, tolerances: Vec::new() };
        let cells = width * (ground.heights.len() / ground.wide - 2 * BESIDE);
        let slopes = (0..cells).map(|k| ground.slope(ground.at(k % width, k / width)));
        ground.tolerances = slopes.map(|slope| tolerance(slope) as f32).collect();
        ground
    }

    /// Index of the height of a cell.
    fn at(&self, col: usize, row: usize) -> usize {
        (row + BESIDE) * self.wide + col + BESIDE
    }

    fn known(&self, at: usize) -> Option<f64> {
        Some(self.heights[at]).filter(|height| !height.is_nan())
    }

    /// Steepness at a cell in steps by cell: from the neighbours on both sides where there are.
    fn slope(&self, at: usize) -> f64 {
        let [x, y] =
            [1, self.wide].map(|away| match [at - away, at, at + away].map(|at| self.known(at)) {
                [Some(a), _, Some(b)] => 0.5 * (b - a),
                [Some(a), Some(b), None] | [None, Some(a), Some(b)] => b - a,
                _ => 0.0,
            });
        (x * x + y * y).sqrt()
    }

    /// Height in steps at a position in the cell (`col`, `row`): `place` is from 0 to 1 along both axes.
    /// Interpolated between the centres of cells; `None` in a cell that is far from all points.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn height(&self, col: usize, row: usize, place: [f64; 2]) -> Option<f64> {
        let at = self.at(col, row);
        let own = self.known(at)?;
        let [(after, x), (above, y)] = place.map(|place| (place >= 0.5, (place - 0.5).abs()));
        let over = if above { at + self.wide } else { at - self.wide };
        let [beside, beside_over] = [at, over].map(|at| if after { at + 1 } else { at - 1 });
        // A neighbour that is far from all points is as high as the cell on this side of it.
        let next = self.known(beside).unwrap_or(own);
        let up = self.known(over).unwrap_or(own);
        let corner = self.known(beside_over).unwrap_or(next + up - own);
        let near = own + (next - own) * x;
        let far = up + (corner - up) * x;
        Some(near + (far - near) * y)
    }

    /// Whether a point of the cell (`col`, `row`) at `place` is ground. False far from all ground points.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn is_ground(&self, col: usize, row: usize, place: [f64; 2], z: i32) -> bool {
        let tolerance = f64::from(self.tolerances[row * self.width + col]);
        let height = self.height(col, row, place);
        height.is_some_and(|height| (f64::from(z) - height).abs() <= tolerance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: i32 = i32::MAX;

    /// Two cells by two, with the cells beside them.
    fn ground_of(heights: [i32; 16], tolerances: [f32; 4]) -> GroundSurface {
        let heights = heights.map(|z| if z == NONE { f64::NAN } else { z.into() }).to_vec();
        GroundSurface { width: 2, wide: 4, heights, tolerances: tolerances.to_vec() }
    }

    const DISTINCT: [i32; 16] =
        [10, 25, 70, 3, 90, 40, 60, 85, 20, 100, 130, 170, 55, 300, 310, 290];

    #[test]
    fn a_height_is_blended_from_the_four_nearest_centres() {
        let ground = ground_of(DISTINCT, [0.0; 4]);
        let height = |col: usize, row: usize| f64::from(DISTINCT[row * 4 + col]);
        for (col, row) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            for (x, y) in [(0.5, 0.5), (0.0, 0.75), (0.25, 0.25), (0.75, 0.125), (1.0, 1.0)] {
                // The place among all centres, the first of which is at (0, 0).
                let (east, north) = (col as f64 + 0.5 + x, row as f64 + 0.5 + y);
                let (w, s) = (east.floor(), north.floor());
                let [across, up] = [east - w, north - s];
                let (w, s) = (w as usize, s as usize);
                let along = |row: usize| match across {
                    0.0 => height(w, row),
                    _ => height(w, row) * (1.0 - across) + height(w + 1, row) * across,
                };
                let expected = match up {
                    0.0 => along(s),
                    _ => along(s) * (1.0 - up) + along(s + 1) * up,
                };
                let found = ground.height(col, row, [x, y]).unwrap();
                assert!((found - expected).abs() < 1e-9, "{col} {row} {x} {y}: {found} {expected}");
            }
        }
    }

    #[test]
    fn beyond_the_last_heights_the_surface_goes_on_as_it_was() {
        let without = |gone: &[usize]| {
            let mut heights = DISTINCT;
            gone.iter().for_each(|&at| heights[at] = NONE);
            ground_of(heights, [0.0; 4])
        };
        // The cell (0, 0) is at 5; beside it are 4 and 6, above it 9 and below it 1.
        let own = f64::from(DISTINCT[5]);
        let at = |gone: &[usize], place| without(gone).height(0, 0, place).unwrap();
        assert_eq!(at(&[6, 9, 10], [1.0, 1.0]), own);
        assert_eq!(at(&[10], [1.0, 1.0]), own + (60.0 - own) * 0.5 + (100.0 - own) * 0.5);
        assert_eq!(at(&[6], [1.0, 0.5]), own);
        assert_eq!(at(&[6], [1.0, 1.0]), (own + own + 100.0 + 130.0) / 4.0);
        assert_eq!(without(&[5]).height(0, 0, [0.5; 2]), None);
        // Slopes are taken from what is there: both sides, one, or none.
        let slope = |gone: &[usize]| without(gone).slope(5);
        let rise = |x: f64, y: f64| x.hypot(y);
        assert_eq!(slope(&[]), rise(0.5 * (60.0 - 90.0), 0.5 * (100.0 - 25.0)));
        assert_eq!(slope(&[4]), rise(20.0, 37.5));
        assert_eq!(slope(&[6, 1]), rise(-50.0, 60.0));
        assert_eq!(slope(&[4, 6, 9]), rise(0.0, 15.0));
        assert_eq!(slope(&[4, 6, 1, 9]), 0.0);
    }

    #[test]
    fn each_cell_has_its_own_tolerance() {
        let ground = ground_of([100; 16], [1.0, 2.0, 4.0, 8.0]);
        for (i, (col, row)) in [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            let most = 1 << i;
            let is = |off: i32| ground.is_ground(col, row, [0.3, 0.9], 100 + off);
            assert_eq!([most, -most, most + 1].map(is), [true, true, false], "{col} {row}");
        }
    }
}
