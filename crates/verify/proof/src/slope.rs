//! Difference of slopes between a mesh and its grid: the angle between normals.
//!
//! The slope of a cell comes from its four samples, by differences across its middle; it is compared with the
//! triangle that covers the middle. Where several do, as on a diagonal, the largest angle counts. Slopes are
//! turned from the lattice to the ground cell by cell, as a degree has another length everywhere.

use terrane_base::geom::Rect;

use crate::sections::sections;
use crate::sum::ExactSum;
use crate::{ErrorSpot, GridProofPart, ProofPosition, ProofTriangle, ProofVertex};

/// The matrix from a slope by column and row to one along two perpendicular directions on the ground.
pub type Turn = [[f64; 2]; 2];

/// A slope: by how much heights change along two directions.
pub type Slope = [f64; 2];

/// Bytes [`measure`] takes for a sample: its height, slope and worst angle.
const BYTES_PER_SAMPLE: u64 = 32;

/// Findings of the parts measured so far; the same in any order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SlopeTally {
    /// Cells with four samples whose middle a triangle covers.
    pub cells: u64,
    /// Cells with four samples whose middle no triangle covers.
    pub uncovered: u64,
    /// Sum of squared angles, in degrees.
    pub squares: ExactSum,
    /// The largest angle, in degrees, and the middle of its cell.
    pub worst: Option<ErrorSpot>,
}

impl SlopeTally {
    /// Adds the findings of other parts.
    pub fn merge(&mut self, other: &Self) {
        self.cells += other.cells;
        self.uncovered += other.uncovered;
        self.squares.merge(&other.squares);
        self.worst = self.worst.into_iter().chain(other.worst).reduce(ErrorSpot::worse);
    }

    fn add(&mut self, error: f64, [col, row]: [u32; 2]) {
        self.cells += 1;
        self.squares.add(error * error);
        let ProofPosition { col, row } = ProofPosition::sample(col.into(), row.into());
        let at = ProofPosition { col: col + MIDDLE, row: row + MIDDLE };
        let spot = ErrorSpot { error, at };
        self.worst = Some(self.worst.map_or(spot, |worst| worst.worse(spot)));
    }
}

/// From a sample to the middle of its cell.
const MIDDLE: i64 = ProofPosition::CELL / 2;

/// Bytes [`measure`] needs for a domain of `samples` samples touched by `triangles` triangles; heights and
/// triangles included.
pub fn bytes_needed(samples: u64, triangles: u64) -> u64 {
    let triangles = triangles.saturating_mul(size_of::<ProofTriangle>() as u64);
    samples.saturating_mul(BYTES_PER_SAMPLE).saturating_add(triangles)
}

/// The slope of a cell by its samples (left and right above, left and right below); `None` where one is
/// missing.
pub fn of_cell([a, b, c, d]: [f64; 4]) -> Option<Slope> {
    let slope = [((b - a) + (d - c)) / 2.0, ((c - a) + (d - b)) / 2.0];
    slope.iter().all(|s| s.is_finite()).then_some(slope)
}

/// The slope of a triangle by column and row; `None` without an area.
pub fn of_triangle(triangle: &ProofTriangle) -> Option<Slope> {
    let area = triangle.double_area();
    let cell = ProofPosition::CELL as f64;
    let area = (area != 0).then(|| area as f64 / cell / cell)?;
    let [a, b, c] = triangle.corners;
    let ([bx, by], [cx, cy]) = (b.at.minus(a.at), c.at.minus(a.at));
    let (bz, cz) = (b.z - a.z, c.z - a.z);
    Some([(bz * cy - cz * by) / area, (cz * bx - bz * cx) / area])
}

/// A slope of the lattice on the ground.
pub fn turned([[a, b], [c, d]]: Turn, [per_col, per_row]: Slope) -> Slope {
    [a * per_col + b * per_row, c * per_col + d * per_row]
}

/// The angle in degrees between the normals of two slopes of the ground.
pub fn between(p: Slope, q: Slope) -> f64 {
    let across = [q[1] - p[1], p[0] - q[0], p[0] * q[1] - p[1] * q[0]];
    let sine = across.iter().map(|v| v * v).sum::<f64>().sqrt();
    // The arc cosine of a dot product loses half of the digits of small angles.
    sine.atan2(1.0 + p[0] * q[0] + p[1] * q[1]).to_degrees()
}

/// Measures the cells that the part owns; `turn` returns the matrix at the middle of a cell (column, row).
pub fn measure(
    part: &GridProofPart<'_>,
    turn: &impl Fn(u32, u32) -> Turn,
    slopes: &mut SlopeTally,
) {
    let Some(mut cells) = SlopeCells::new(part) else { return };
    part.triangles.iter().for_each(|triangle| cells.add(triangle, turn));
    cells.add_to(slopes);
}

/// The cells of a part, row by row.
struct SlopeCells {
    /// By their samples at the left above.
    rect: Rect,
    /// NaN where a sample is missing.
    slopes: Vec<Slope>,
    /// The largest angle so far; -1 where no triangle covers the middle.
    worst: Vec<f64>,
}

impl SlopeCells {
    fn new(part: &GridProofPart<'_>) -> Option<Self> {
        let (owned, [width, height]) = (part.domain.rect, part.domain.grid);
        let all = Rect::new(0, 0, width.saturating_sub(1), height.saturating_sub(1));
        let rect = owned.intersect(&all);
        if rect.is_empty() {
            return None;
        }
        let apron = part.domain.apron();
        let (stride, count) = (apron.width as usize, rect.width as usize);
        let mut slopes = Vec::with_capacity(rect.len());
        for row in rect.row..rect.end_row() {
            let first = (row - apron.row) as usize * stride + (rect.col - apron.col) as usize;
            let [above, below] = [first, first + stride].map(|at| &part.heights[at..=at + count]);
            let cells = above.windows(2).zip(below.windows(2));
            slopes.extend(
                cells.map(|(a, b)| of_cell([a[0], a[1], b[0], b[1]]).unwrap_or([f64::NAN; 2])),
            );
        }
        Some(Self { rect, slopes, worst: vec![-1.0; rect.len()] })
    }

    /// Raises the angles of the cells whose middle is in the closed triangle.
    fn add(&mut self, triangle: &ProofTriangle, turn: &impl Fn(u32, u32) -> Turn) {
        let Some(slope) = of_triangle(triangle) else { return };
        let rect = self.rect;
        let (first, last) = (i64::from(rect.row), i64::from(rect.end_row()) - 1);
        let (left, right) = (i64::from(rect.col), i64::from(rect.end_col()));
        sections::<i128>(&shifted(triangle), first, last, |row, section| {
            let [from, to] = section.samples();
            for col in from.max(left)..to.min(right) {
                // Inside the rectangle, so both fit.
                let (col, row) = (col as u32, row as u32);
                self.raise([col, row], slope, turn(col, row));
            }
        });
    }

    fn raise(&mut self, [col, row]: [u32; 2], slope: Slope, turn: Turn) {
        let row = (row - self.rect.row) as usize * self.rect.width as usize;
        let at = row + (col - self.rect.col) as usize;
        let error = between(turned(turn, self.slopes[at]), turned(turn, slope));
        // A comparison with NaN fails, so a cell without a slope keeps its value.
        self.worst[at] = if error > self.worst[at] { error } else { self.worst[at] };
    }

    fn add_to(&self, slopes: &mut SlopeTally) {
        let width = self.rect.width as usize;
        for (i, (slope, &worst)) in self.slopes.iter().zip(&self.worst).enumerate() {
            if slope[0].is_nan() {
                continue;
            }
            let at = [self.rect.col + (i % width) as u32, self.rect.row + (i / width) as u32];
            match worst < 0.0 {
                true => slopes.uncovered += 1,
                false => slopes.add(worst, at),
            }
        }
    }
}

/// The triangle moved half a cell to the left and up, so that the middles of cells come to samples.
fn shifted(triangle: &ProofTriangle) -> ProofTriangle {
    let corners = triangle.corners.map(|ProofVertex { at, z }| ProofVertex {
        at: ProofPosition { row: at.row - MIDDLE, col: at.col - MIDDLE },
        z,
    });
    ProofTriangle { corners }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::double_area;
    use crate::{DomainLayout, GridDomain, HeightPrecision};
    use proptest::prelude::*;

    const PLAIN: Turn = [[1.0, 0.0], [0.0, 1.0]];

    fn triangle(points: [[f64; 3]; 3]) -> ProofTriangle {
        ProofTriangle {
            corners: points.map(|[c, r, z]| ProofVertex { at: ProofPosition::nearest(c, r), z }),
        }
    }

    #[test]
    fn slopes_and_angles_of_known_planes() {
        assert_eq!(of_cell([0.0, 1.0, 2.0, 3.0]), Some([1.0, 2.0]));
        assert_eq!(of_cell([0.0, 1.0, f64::NAN, 3.0]), None);
        let plane = |x: f64, y: f64| [x, y, 3.0 + 0.5 * x - 2.0 * y];
        let slope = of_triangle(&triangle([plane(1.0, 7.0), plane(4.0, 2.0), plane(9.0, 9.0)]));
        let [x, y] = slope.unwrap();
        assert!((x - 0.5).abs() < 1e-12 && (y + 2.0).abs() < 1e-12);
        assert_eq!(of_triangle(&triangle([[0.0; 3], [1.0, 1.0, 4.0], [2.0, 2.0, 9.0]])), None);
        assert_eq!(between([0.3, -7.0], [0.3, -7.0]), 0.0);
        assert!((between([0.0, 0.0], [1.0, 0.0]) - 45.0).abs() < 1e-12);
        assert!((between([1.0, 0.0], [-1.0, 0.0]) - 90.0).abs() < 1e-12);
        assert_eq!(turned([[0.0, 2.0], [3.0, 0.0]], [1.0, 10.0]), [20.0, 3.0]);
    }

    proptest! {
        /// Beside the arc cosine of the normals.
        #[test]
        fn like_the_angle_of_normals(p in [-9.0..9.0f64, -9.0..9.0f64], q in [-9.0..9.0f64, -9.0..9.0f64]) {
            let length = |[x, y]: [f64; 2]| (1.0 + x * x + y * y).sqrt();
            let cosine = (1.0 + p[0] * q[0] + p[1] * q[1]) / length(p) / length(q);
            prop_assert!((between(p, q) - cosine.min(1.0).acos().to_degrees()).abs() < 1e-5);
            prop_assert_eq!(between(p, q), between(q, p));
        }
    }

    /// The whole grid at once or by domains of 32 samples.
    fn slopes(
        grid: [u32; 2],
        heights: &[f64],
        triangles: &[ProofTriangle],
        size: u32,
        turn: Turn,
    ) -> SlopeTally {
        let layout = DomainLayout { grid, size: [size; 2] };
        let mut all = SlopeTally::default();
        for domain in (0..layout.len()).rev().map(|i| layout.domain(i)) {
            let mut own = SlopeTally::default();
            measure(&part(domain, &window(heights, &domain), triangles), &|_, _| turn, &mut own);
            all.merge(&own);
        }
        all
    }

    fn window(heights: &[f64], domain: &GridDomain) -> Vec<f64> {
        let apron = domain.apron();
        let places = (apron.row..apron.end_row())
            .flat_map(|r| (apron.col..apron.end_col()).map(move |c| (c, r)));
        places.map(|(c, r)| heights[(r * domain.grid[0] + c) as usize]).collect()
    }

    fn part<'a>(
        domain: GridDomain,
        heights: &'a [f64],
        triangles: &'a [ProofTriangle],
    ) -> GridProofPart<'a> {
        let (precision, vertices) = (HeightPrecision::Double, None);
        let (tolerance, is_fitted) = (None, false);
        GridProofPart {
            domain,
            heights,
            triangles,
            vertices,
            kept: &[],
            lines: &[],
            min_angle: None,
            precision,
            is_fitted,
            tolerance,
            orientation: 1,
        }
    }

    /// Every cell with every triangle.
    fn slow(
        grid: [u32; 2],
        heights: &[f64],
        triangles: &[ProofTriangle],
        turn: Turn,
    ) -> (u64, u64, f64, f64) {
        let (mut cells, mut uncovered, mut squares, mut worst) = (0, 0, 0.0, 0.0f64);
        for (c, r) in (0..grid[1] - 1).flat_map(|r| (0..grid[0] - 1).map(move |c| (c, r))) {
            let z = |i: u32, k: u32| heights[((r + k) * grid[0] + c + i) as usize];
            let Some(slope) = of_cell([z(0, 0), z(1, 0), z(0, 1), z(1, 1)]) else { continue };
            let at = ProofPosition::nearest(f64::from(c) + 0.5, f64::from(r) + 0.5);
            let covers = |t: &&ProofTriangle| {
                let [a, b, d] = t.positions();
                let sign = t.double_area().signum();
                let sides = [double_area(at, b, d), double_area(a, at, d), double_area(a, b, at)];
                sign != 0 && sides.iter().all(|w| w * sign >= 0)
            };
            let angle = |t: &ProofTriangle| {
                between(turned(turn, slope), turned(turn, of_triangle(t).unwrap()))
            };
            match triangles.iter().filter(covers).map(angle).reduce(f64::max) {
                None => uncovered += 1,
                Some(angle) => {
                    (cells, squares, worst) =
                        (cells + 1, squares + angle * angle, worst.max(angle));
                }
            }
        }
        (cells, uncovered, squares, worst)
    }

    proptest! {
        #[test]
        fn like_every_cell_with_every_triangle(
            heights in prop::collection::vec(prop_oneof![9 => -5.0..5.0f64, 1 => Just(f64::NAN)], 40 * 7),
            points in prop::collection::vec(prop::array::uniform3([-2i32..84, -2i32..16, -5i32..5]), 1..20),
        ) {
            // Corners at halves of cells, so that many edges run through middles.
            let half = |[c, r, z]: [i32; 3]| [f64::from(c) / 2.0, f64::from(r) / 2.0, f64::from(z)];
            let triangles: Vec<ProofTriangle> = points.iter().map(|t| triangle(t.map(half))).collect();
            let (grid, turn) = ([40, 7], [[0.1, 0.02], [-0.01, 0.2]]);
            let found = slopes(grid, &heights, &triangles, 64, turn);
            let (cells, uncovered, squares, worst) = slow(grid, &heights, &triangles, turn);
            prop_assert_eq!((found.cells, found.uncovered), (cells, uncovered));
            prop_assert!((found.squares.value() - squares).abs() <= 1e-9 * squares);
            prop_assert_eq!(found.worst.map_or(0.0, |spot| spot.error), worst);
            prop_assert_eq!(slopes(grid, &heights, &triangles, 32, turn), found);
        }
    }

    #[test]
    fn a_grid_of_one_row_has_no_cells() {
        assert_eq!(slopes([5, 1], &[0.0; 5], &[], 32, PLAIN), SlopeTally::default());
        assert_eq!(slopes([1, 5], &[0.0; 5], &[], 32, PLAIN), SlopeTally::default());
    }
}
