//! Which points of an unclassified cloud are ground: a morphological filter of the lowest heights.
//!
//! After Pingel, Clarke & McBride, "An improved simple morphological filter for the terrain
//! classification of airborne LIDAR data" (2013): the lowest point of each cell makes a surface; what
//! an opening with a window cuts off by more than the window's size times a slope is an object; the
//! holes are filled; and a point is ground when it lies near the surface that is left, the nearer the
//! flatter it is. Three things differ, so that a tile with a halo of [`Parameters::reach`] cells has
//! the same result as the whole, to the last bit: windows are squares and open the first surface (for
//! squares that is the same as to open the surface opened before), holes are filled by means over
//! windows of limited size instead of by springs, and all heights are whole numbers.

mod fill;
mod low;
mod open;

use fill::filled;

/// The lowest height of a cell without points.
pub const EMPTY: i32 = i32::MAX;

/// What is ground. Lengths are in one unit, the same for x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Side of a cell.
    pub cell: f64,
    /// A step of the heights.
    pub step: f64,
    /// Half the width of the largest objects that are taken off.
    pub window: f64,
    /// Steepest terrain, as rise over run; what is steeper is cut off as an object.
    pub slope: f64,
    /// How far from the surface a ground point may lie on level ground.
    pub height: f64,
    /// How much further it may lie where the terrain is not level, for each unit that it rises from
    /// a cell to the next: a cell's lowest point lies at its lower end.
    pub scaling: f64,
    /// How far a low point must lie below all but a few around it to be noise.
    pub depth: f64,
}

impl Parameters {
    /// The usual values for cells of side `cell` and heights in steps of `step`, in metres.
    pub fn metres(cell: f64, step: f64) -> Self {
        let (window, slope, height, scaling, depth) = (18.0, 0.15, 0.5, 1.25, 1.0);
        Self { cell, step, window, slope, height, scaling, depth }
    }

    /// Half the width of the largest window, in cells.
    fn radius(&self) -> usize {
        (self.window / self.cell).ceil().clamp(1.0, MOST_RADIUS) as usize
    }

    /// How many cells around a cell its surface, and what is ground in it, depend on.
    pub fn reach(&self) -> usize {
        let radius = self.radius();
        low::REACH + 2 * fill::reach(radius) + open::reach(radius) + BESIDE
    }
}

/// Most cells of half a window.
const MOST_RADIUS: f64 = 1024.0;
/// Cells on each side that a slope, and a height between cells, are taken from.
const BESIDE: usize = 1;

/// The ground under a window of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    width: usize,
    /// Height of each cell in steps, or [`EMPTY`] far from all points.
    heights: Vec<i32>,
    /// How far a ground point may lie from it, in steps.
    tolerances: Vec<f32>,
}

/// The ground under the cells whose lowest heights are `minima`, row by row, in steps; cells without
/// points are [`EMPTY`], and so is all beyond the window. Cells further than [`Parameters::reach`]
/// from the window's border have the ground that they have in any larger window.
///
/// Time is proportional to the cells: a quarter of a microsecond each, with memory for 60 bytes.
///
/// # Panics
/// When `minima` is not whole rows of `width`.
pub fn ground(minima: &[i32], width: usize, parameters: &Parameters) -> Ground {
    assert!(width > 0 && minima.len().is_multiple_of(width), "whole rows of cells");
    let mut bare = low::without_noise(minima, width, parameters.depth / parameters.step);
    open::take_off_objects(&mut bare, width, parameters);
    let heights = filled(&bare, width, fill::reach(parameters.radius()));
    let tolerances = tolerances(&heights, width, parameters);
    Ground { width, heights, tolerances }
}

/// How far ground points may lie from each cell.
fn tolerances(heights: &[i32], width: usize, parameters: &Parameters) -> Vec<f32> {
    let Parameters { step, height, scaling, .. } = *parameters;
    let tolerance = |at: usize| (height / step + scaling * slope(heights, width, at)) as f32;
    (0..heights.len()).map(tolerance).collect()
}

/// Steepness at a cell in steps by cell: from the neighbours on both sides where there are.
fn slope(heights: &[i32], width: usize, at: usize) -> f64 {
    let known = |at: Option<usize>| {
        let height = at.and_then(|at| heights.get(at)).copied().unwrap_or(EMPTY);
        (height != EMPTY).then(|| f64::from(height))
    };
    let rise = |before: Option<f64>, after: Option<f64>| match (before, known(Some(at)), after) {
        (Some(a), _, Some(b)) => 0.5 * (b - a),
        (Some(a), Some(b), None) | (None, Some(a), Some(b)) => b - a,
        _ => 0.0,
    };
    let col = at % width;
    let west = known((col > 0).then(|| at - 1));
    let east = known((col + 1 < width).then(|| at + 1));
    let x = rise(west, east);
    let y = rise(known(at.checked_sub(width)), known(Some(at + width)));
    (x * x + y * y).sqrt()
}

impl Ground {
    /// Height in steps at a place of the cell (`col`, `row`): `place` is from 0 to 1 along the rows
    /// and across them. Between the centres of cells it is blended; `None` where a cell that takes
    /// part is far from all points.
    pub fn height(&self, col: usize, row: usize, place: [f64; 2]) -> Option<f64> {
        let at = row * self.width + col;
        let own = self.known(Some(at))?;
        let [(side, x), (up, y)] = place.map(|place| (place >= 0.5, (place - 0.5).abs()));
        let beside = match side {
            true => (col + 1 < self.width).then(|| at + 1),
            false => (col > 0).then(|| at - 1),
        };
        let away = |at: usize| match up {
            true => Some(at + self.width),
            false => at.checked_sub(self.width),
        };
        // A neighbour beyond the window or all points is as high as the cell on this side of it.
        let next = self.known(beside).unwrap_or(own);
        let above = self.known(away(at)).unwrap_or(own);
        let corner = self.known(beside.and_then(away)).unwrap_or(next + above - own);
        let near = own + (next - own) * x;
        let far = above + (corner - above) * x;
        Some(near + (far - near) * y)
    }

    /// Whether a point of the cell (`col`, `row`) at `place` is ground. Far from the points that the
    /// ground was made of none is.
    pub fn is_ground(&self, col: usize, row: usize, place: [f64; 2], z: i32) -> bool {
        let tolerance = f64::from(self.tolerances[row * self.width + col]);
        self.height(col, row, place)
            .is_some_and(|height| (f64::from(z) - height).abs() <= tolerance)
    }

    fn known(&self, at: Option<usize>) -> Option<f64> {
        let height = *self.heights.get(at?)?;
        (height != EMPTY).then(|| f64::from(height))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELLS: Parameters = Parameters {
        cell: 1.0,
        step: 0.01,
        window: 3.0,
        slope: 0.15,
        height: 0.5,
        scaling: 1.25,
        depth: 1.0,
    };

    /// A slope of 2 steps east and 3 south by cell, with a block on it.
    fn slope_with_block() -> (Vec<i32>, usize) {
        let height = |k: i32| {
            let (col, row) = (k % 40, k / 40);
            let block = (15..20).contains(&col) && (12..18).contains(&row);
            1000 + 2 * col - 3 * row + if block { 300 } else { 0 }
        };
        ((0..1200).map(height).collect(), 40)
    }

    #[test]
    fn a_block_is_taken_off_and_the_slope_stays() {
        let (minima, width) = slope_with_block();
        let ground = ground(&minima, width, &CELLS);
        for (at, low) in minima.iter().enumerate() {
            let (col, row) = (at % width, at / width);
            let plane = 1000 + 2 * col as i32 - 3 * row as i32;
            let is = |z: i32| ground.is_ground(col, row, [0.5, 0.5], z);
            assert_eq!(is(*low), *low == plane, "({col}, {row})");
            assert!(is(plane) && is(plane + 40) && is(plane - 40), "({col}, {row})");
            assert!(!is(plane + 100) && !is(plane - 100), "({col}, {row})");
        }
    }

    #[test]
    fn heights_are_blended_between_the_centres_of_cells() {
        let minima = [0, 100, 200, 400];
        let level = Parameters { slope: 1e6, depth: 1e6, ..CELLS };
        let ground = ground(&minima, 2, &level);
        assert_eq!(ground.height(0, 0, [0.5, 0.5]), Some(0.0));
        assert_eq!(ground.height(0, 0, [1.0, 0.5]), Some(50.0));
        assert_eq!(ground.height(1, 0, [0.0, 0.5]), Some(50.0));
        assert_eq!(ground.height(1, 1, [0.0, 0.0]), Some(175.0));
        assert_eq!(ground.height(0, 1, [1.0, 0.0]), Some(175.0));
        assert_eq!(ground.height(0, 0, [0.0, 0.0]), Some(0.0), "flat beyond the border");
    }

    #[test]
    fn nothing_is_ground_where_there_are_no_points() {
        let mut minima = vec![EMPTY; 100 * 3];
        assert_eq!(ground(&minima, 100, &CELLS).height(50, 1, [0.5, 0.5]), None);
        minima[100] = 7;
        let ground = ground(&minima, 100, &CELLS);
        assert!(ground.is_ground(0, 1, [0.5, 0.5], 7));
        assert!(!ground.is_ground(99, 1, [0.5, 0.5], 7));
        assert!(super::ground(&[], 4, &CELLS).heights.is_empty());
    }
}
