//! Division of a grid into domains, each of which owns samples, cells and positions exactly once.

use terrane_base::geom::Rect;

use super::sections::floor;
use super::triangle::{ProofPosition, ProofTriangle};

/// A rectangle of samples of a grid. It owns its samples, the cells to the right of and below
/// them, and every position whose whole part is one of its samples; positions beyond the grid
/// belong to the nearest domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridDomain {
    /// Columns and rows of the grid.
    pub grid: [u32; 2],
    /// The samples owned: not empty, inside the grid.
    pub rect: Rect,
}

impl GridDomain {
    /// Sums of errors are formed over tiles of this many samples a side, so that they do not depend on the
    /// division; domains start at multiples of it.
    pub const UNIT: u32 = 32;

    /// The samples owned and those next to them, inside the grid.
    pub fn apron(&self) -> Rect {
        let Rect { col, row, .. } = self.rect;
        let (left, above) = (col.saturating_sub(1), row.saturating_sub(1));
        let right = (self.rect.end_col() + 1).min(self.grid[0]);
        let below = (self.rect.end_row() + 1).min(self.grid[1]);
        Rect::new(left, above, right - left, below - above)
    }

    /// True when the position is owned.
    pub fn owns(&self, at: ProofPosition) -> bool {
        let [col, row] = nearest_sample(self.grid, at);
        self.rect.contains(col, row)
    }

    /// True when the triangle may touch a position owned (never a wrong no).
    pub fn may_touch(&self, triangle: &ProofTriangle) -> bool {
        let [low, high] = triangle.bounds();
        let [left, above] = nearest_sample(self.grid, low);
        let [right, below] = nearest_sample(self.grid, high);
        let Rect { col, row, .. } = self.rect;
        if right < col || left >= self.rect.end_col() || below < row || above >= self.rect.end_row()
        {
            return false;
        }
        let [left, right] = columns(self.grid, triangle, row, self.rect.end_row());
        left < self.rect.end_col() && right >= col
    }

    /// Two halves along the longer side, `None` when it is a single unit.
    pub fn halves(&self) -> Option<[GridDomain; 2]> {
        let Rect { col, row, width, height } = self.rect;
        let (a, b) = if width >= height && width > Self::UNIT {
            let w = (width / 2).next_multiple_of(Self::UNIT);
            (Rect::new(col, row, w, height), Rect::new(col + w, row, width - w, height))
        } else if height > Self::UNIT {
            let h = (height / 2).next_multiple_of(Self::UNIT);
            (Rect::new(col, row, width, h), Rect::new(col, row + h, width, height - h))
        } else {
            return None;
        };
        Some([a, b].map(|rect| GridDomain { rect, ..*self }))
    }
}

/// The sample whose domain owns `at`.
fn nearest_sample(grid: [u32; 2], at: ProofPosition) -> [u32; 2] {
    let cells = [at.col, at.row].map(floor);
    [0, 1].map(|axis| cells[axis].clamp(0, i64::from(grid[axis]) - 1) as u32)
}

/// First and last column of samples near the part of `triangle` that rows `row .. end_row` own:
/// in `f64`, with a column of doubt on each side.
fn columns(grid: [u32; 2], triangle: &ProofTriangle, row: u32, end_row: u32) -> [u32; 2] {
    let above = if row == 0 { f64::NEG_INFINITY } else { f64::from(row) };
    let below = if end_row == grid[1] { f64::INFINITY } else { f64::from(end_row) };
    let points = triangle.positions().map(|p| [p.cols(), p.rows()]);
    let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 0..3 {
        let (p, q) = (points[i], points[(i + 1) % 3]);
        if p[1].max(q[1]) < above || p[1].min(q[1]) > below {
            continue;
        }
        for end in [p, q].map(|end| clipped([p, q], end, above, below)) {
            min = min.min(end);
            max = max.max(end);
        }
    }
    [min - 1.0, max + 1.0].map(|col| (col.max(0.0) as u32).min(grid[0] - 1))
}

/// The column of one end of the part of a segment between two rows.
fn clipped([p, q]: [[f64; 2]; 2], end: [f64; 2], above: f64, below: f64) -> f64 {
    let row = end[1].clamp(above, below);
    if row == end[1] {
        return end[0];
    }
    // No division by 0: the ends of a level segment are within the rows, or it was skipped.
    p[0] + (row - p[1]) / (q[1] - p[1]) * (q[0] - p[0])
}

/// A grid divided into domains of equal size, numbered row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DomainLayout {
    /// Columns and rows of the grid, neither 0.
    pub grid: [u32; 2],
    /// Columns and rows of a domain: multiples of [`GridDomain::UNIT`].
    pub size: [u32; 2],
}

impl DomainLayout {
    /// Domains across and down.
    pub fn counts(&self) -> [u32; 2] {
        [0, 1].map(|i| self.grid[i].div_ceil(self.size[i]))
    }

    /// Number of domains.
    pub fn len(&self) -> u64 {
        self.counts().iter().map(|&n| u64::from(n)).product()
    }

    /// Never: a grid has at least one sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The domain at (`across`, `down`).
    fn at(&self, across: u32, down: u32) -> GridDomain {
        let [w, h] = self.size;
        let all = Rect::new(0, 0, self.grid[0], self.grid[1]);
        let rect = Rect::new(across * w, down * h, w, h);
        GridDomain { grid: self.grid, rect: rect.intersect(&all) }
    }

    /// Domain `index`.
    pub fn domain(&self, index: u64) -> GridDomain {
        let across = u64::from(self.counts()[0]);
        self.at((index % across) as u32, (index / across) as u32)
    }

    fn index(&self, across: u32, down: u32) -> u64 {
        u64::from(down) * u64::from(self.counts()[0]) + u64::from(across)
    }

    /// Index of the domain that owns `at`.
    pub fn owner(&self, at: ProofPosition) -> u64 {
        let [col, row] = nearest_sample(self.grid, at);
        self.index(col / self.size[0], row / self.size[1])
    }

    /// Calls `visit` with every domain the triangle may touch.
    pub fn touched(&self, triangle: &ProofTriangle, mut visit: impl FnMut(u64)) {
        let [low, high] = triangle.bounds().map(|p| nearest_sample(self.grid, p));
        let [left, right] = [low[0] / self.size[0], high[0] / self.size[0]];
        let [above, below] = [low[1] / self.size[1], high[1] / self.size[1]];
        for down in above..=below {
            let Rect { row, .. } = self.at(0, down).rect;
            let end_row = self.at(0, down).rect.end_row();
            // A triangle touches all domains of a box one domain wide or high.
            let [first, last] = if left == right || above == below {
                [left, right]
            } else {
                columns(self.grid, triangle, row, end_row).map(|col| col / self.size[0])
            };
            for across in first.max(left)..=last.min(right) {
                visit(self.index(across, down));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle::ProofVertex;
    use proptest::prelude::*;

    fn triangle(points: [[f64; 2]; 3]) -> ProofTriangle {
        ProofTriangle {
            corners: points.map(|[c, r]| ProofVertex { at: ProofPosition::nearest(c, r), z: 0.0 }),
        }
    }

    #[test]
    fn domains_tile_the_grid_and_halves_tile_a_domain() {
        let layout = DomainLayout { grid: [100, 70], size: [64, 32] };
        let owned: usize = (0..layout.len()).map(|i| layout.domain(i).rect.len()).sum();
        assert_eq!((layout.len(), owned), (6, 7000));
        let whole = GridDomain { grid: [100, 70], rect: Rect::new(0, 0, 100, 70) };
        let [a, b] = whole.halves().unwrap();
        assert_eq!((a.rect, b.rect), (Rect::new(0, 0, 64, 70), Rect::new(64, 0, 36, 70)));
        let unit = GridDomain { grid: [100, 70], rect: Rect::new(32, 32, 32, 32) };
        assert_eq!(unit.halves(), None);
        assert_eq!(unit.apron(), Rect::new(31, 31, 34, 34));
    }

    proptest! {
        #[test]
        fn no_touched_domain_is_missed(
            points in prop::array::uniform3([-50.0..250.0, -50.0..250.0]),
            weights in prop::array::uniform3(0.0..1.0f64),
        ) {
            let layout = DomainLayout { grid: [200, 150], size: [32, 64] };
            let t = triangle(points);
            let mut touched = Vec::new();
            layout.touched(&t, |i| touched.push(i));
            let total: f64 = weights.iter().sum::<f64>().max(1e-9);
            let mix = |k: usize| (0..3).map(|i| weights[i] / total * points[i][k]).sum::<f64>();
            let inside = ProofPosition::nearest(mix(0), mix(1));
            for at in t.positions().into_iter().chain([inside]) {
                prop_assert!(touched.contains(&layout.owner(at)));
                prop_assert!(layout.domain(layout.owner(at)).owns(at));
                prop_assert!(layout.domain(layout.owner(at)).may_touch(&t));
            }
        }
    }
}
