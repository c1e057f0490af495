//! Grows ground from cell to cell, up ridges and to the edges of cliffs.
//!
//! A cloth cuts off ridges, and densification stops at slopes beyond its limits. But ground is continuous: the
//! lowest point of a cell is ground if it lies on the plane through the neighbouring ground, at any slope.
//! Roofs and plants are steps above that plane.

use crate::grid::within;
use crate::lowest_points::LowestPoints;

/// Cells on each side that a plane is fitted to, and fewest of them with ground.
const BESIDE: usize = 2;
const FEWEST: usize = 6;
/// Largest distance of ground from the plane, in metres; more with the slope of the plane and its residuals.
const NEAR: f64 = 0.1;
const BY_SLOPE: f64 = 0.15;
const MAX_STRAY: f64 = 0.3;
/// How far below the plane it may lie at least.
const BELOW: f64 = 0.3;
/// Steepest ground, rise over run.
const STEEPEST: f64 = 9.0;
/// Largest number of rounds, each of one cell.
const ROUNDS: usize = 64;
/// Smallest fraction of the spread along one axis that is independent of the other: collinear points have no
/// plane.
const SPREAD: f64 = 0.05;

/// The seeds with all cells grown from them, sorted.
pub(crate) fn grown(lows: &LowestPoints<'_>, seeds: &[usize]) -> Vec<usize> {
    let mut growing = RegionGrowing::new(lows, seeds);
    let mut waiting = vec![true; lows.points.len()];
    for _ in 0..ROUNDS {
        // All cells of a round are judged by the ground before it, so the order of cells leaves no trace.
        let reached = (0..waiting.len())
            .filter(|&at| waiting[at] && !growing.is_ground[at] && growing.continues(at));
        let reached: Vec<usize> = reached.collect();
        if reached.is_empty() {
            break;
        }
        waiting.fill(false);
        for at in reached {
            growing.is_ground[at] = true;
            growing.around(at).for_each(|other| waiting[other] = true);
        }
    }
    (0..waiting.len()).filter(|&at| growing.is_ground[at]).collect()
}

/// Scatter of ground around planes, in metres: the lower quartile over the seeds, as rough ground and plants
/// increase it. `None` if hardly any seed has neighbours.
pub(crate) fn scatter(lows: &LowestPoints<'_>, seeds: &[usize]) -> Option<f64> {
    let growing = RegionGrowing::new(lows, seeds);
    let mut strays: Vec<f64> =
        seeds.iter().filter_map(|&at| Some(growing.plane(at)?.stray)).collect();
    let quarter = strays.len() / 4;
    (quarter > 0).then(|| *strays.select_nth_unstable_by(quarter, f64::total_cmp).1)
}

struct RegionGrowing {
    /// The lowest point of each cell, in metres.
    points: Vec<Option<[f64; 3]>>,
    width: usize,
    is_ground: Vec<bool>,
}

impl RegionGrowing {
    /// Ground at the seeds only.
    fn new(lows: &LowestPoints<'_>, seeds: &[usize]) -> Self {
        let points = (0..lows.points.len()).map(|at| lows.metres(at)).collect();
        let mut is_ground = vec![false; lows.points.len()];
        seeds.iter().for_each(|&at| is_ground[at] = true);
        Self { points, width: lows.width, is_ground }
    }

    /// The cells around one.
    fn around(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, rows) = (self.width, self.points.len() / self.width);
        let cols = within(at % width, BESIDE, width);
        within(at / width, BESIDE, rows)
            .flat_map(move |row| cols.clone().map(move |col| row * width + col))
    }

    /// The plane through the neighbouring ground, relative to the point of a cell.
    fn plane(&self, at: usize) -> Option<FittedPlane> {
        let [x, y, z] = self.points[at]?;
        let mut sums = PlaneSums::default();
        for other in self.around(at).filter(|other| self.is_ground[*other]) {
            if let Some([east, north, up]) = self.points[other] {
                sums.add([east - x, north - y, up - z]);
            }
        }
        sums.plane()
    }

    /// Whether the point of a cell lies on the plane through the neighbouring ground.
    fn continues(&self, at: usize) -> bool {
        let Some(FittedPlane { height, slope, stray }) = self.plane(at) else { return false };
        let slope = slope[0].hypot(slope[1]);
        let near = NEAR + BY_SLOPE * slope + stray.min(MAX_STRAY);
        slope <= STEEPEST && -height <= near && height <= near.max(BELOW)
    }
}

/// A fitted plane: its height at the origin, its slope, and its residuals.
pub(crate) struct FittedPlane {
    pub(crate) height: f64,
    slope: [f64; 2],
    pub(crate) stray: f64,
}

impl FittedPlane {
    pub(crate) const LEVEL: Self = Self { height: 0.0, slope: [0.0; 2], stray: 0.0 };

    /// Height of a point above the plane.
    pub(crate) fn above(&self, [x, y, z]: [f64; 3]) -> f64 {
        z - self.height - self.slope[0] * x - self.slope[1] * y
    }
}

/// Sums over points.
#[derive(Default)]
pub(crate) struct PlaneSums {
    pub(crate) count: usize,
    first: [f64; 3],
    /// Of x x, x y, y y, x z, y z, z z.
    second: [f64; 6],
}

impl PlaneSums {
    pub(crate) fn add(&mut self, [x, y, z]: [f64; 3]) {
        self.count += 1;
        self.first.iter_mut().zip([x, y, z]).for_each(|(sum, v)| *sum += v);
        let products = [x * x, x * y, y * y, x * z, y * z, z * z];
        self.second.iter_mut().zip(products).for_each(|(sum, v)| *sum += v);
    }

    /// The least-squares plane; `None` for too few or collinear points.
    pub(crate) fn plane(&self) -> Option<FittedPlane> {
        let count = (self.count >= FEWEST).then_some(self.count as f64)?;
        let [x, y, z] = self.first.map(|sum| sum / count);
        let means = [(x, x), (x, y), (y, y), (x, z), (y, z), (z, z)];
        let mut central = self.second;
        for (sum, (a, b)) in central.iter_mut().zip(means) {
            *sum -= count * a * b;
        }
        let [xx, xy, yy, xz, yz, zz] = central;
        let determinant = xx * yy - xy * xy;
        if determinant <= SPREAD * xx * yy {
            return None;
        }
        let (east, north) = ((xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant);
        let left = (zz - east * xz - north * yz).max(0.0);
        Some(FittedPlane {
            height: z - east * x - north * y,
            slope: [east, north],
            stray: (left / (count - 3.0)).sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Point;

    const WIDTH: usize = 40;

    /// The cells that ground grows to from the first column, of cells so high in metres.
    fn grown_to(height: impl Fn(usize, usize) -> f64) -> Vec<bool> {
        let at = |v: usize| v as i32 * 100 + 50;
        let point = |k: usize| {
            let (col, row) = (k % WIDTH, k / WIDTH);
            Point::new(at(col), at(row), (height(col, row) * 100.0).round() as i32)
        };
        let points: Vec<Point> = (0..WIDTH * WIDTH).map(point).collect();
        let lows = LowestPoints {
            points: &points,
            width: WIDTH,
            cell: 1.0,
            corner: [0.0; 2],
            step: [0.01; 3],
        };
        let seeds: Vec<usize> = (0..points.len()).filter(|k| k % WIDTH < 3).collect();
        let mut is_grown = vec![false; points.len()];
        grown(&lows, &seeds).into_iter().for_each(|at| is_grown[at] = true);
        is_grown
    }

    #[test]
    fn slopes_of_any_steepness_are_climbed_and_steps_are_not() {
        for slope in [0.0, 0.4, 1.7, 3.0] {
            assert!(grown_to(|col, _| slope * col as f64).into_iter().all(|is| is), "{slope}");
        }
        let ridge = |col: usize, _: usize| 1.5 * 18.0_f64.min(col as f64);
        assert!(grown_to(ridge).iter().enumerate().all(|(k, is)| *is || k % WIDTH > 17));
        for step in [0.6, 2.5, 9.0] {
            let found = grown_to(|col, _| 0.2 * col as f64 + if col < 20 { 0.0 } else { step });
            assert!(found.iter().enumerate().all(|(k, is)| *is == (k % WIDTH < 20)), "{step}");
        }
    }
}
