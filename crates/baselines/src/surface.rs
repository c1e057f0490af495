//! The surface of a grid: the union of the cells whose four samples are valid.
//!
//! Samples on its outline towards voids are vertices from the start. Edges of the unit lattice are Delaunay
//! edges whatever else is inserted (the circle around one holds no other sample), so in the Delaunay
//! triangulation of these vertices the outline is there without constraints; and no sample lies within a
//! unit edge, so no method ever splits it.

use crate::grid::{HeightGrid, PackedSample};

/// Part a sample plays in the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SampleRole {
    /// All its cells belong to the surface.
    Interior,
    /// Some of its cells do: it must be a vertex.
    Outline,
    /// It has a height but no cell: it has no surface.
    Isolated,
    /// It has no height.
    Void,
}

impl HeightGrid<'_> {
    /// Role of a sample in the surface.
    pub(crate) fn role(&self, at: PackedSample) -> SampleRole {
        let (mut held, mut missing) = (false, false);
        for (col, row) in cells_around(self, at) {
            match self.holds_cell(col, row) {
                true => held = true,
                false => missing = true,
            }
        }
        match (held, missing) {
            (true, true) => SampleRole::Outline,
            (true, false) => SampleRole::Interior,
            (false, _) if self.sample(at).is_nan() => SampleRole::Void,
            (false, _) => SampleRole::Isolated,
        }
    }
}

/// The cells of the grid that a sample is a corner of, by their first samples.
fn cells_around(grid: &HeightGrid<'_>, at: PackedSample) -> impl Iterator<Item = (u32, u32)> {
    let (cols, rows) = (grid.width().saturating_sub(1), grid.height().saturating_sub(1));
    let beside = |at: u32, count: u32| at.saturating_sub(1)..(at + 1).min(count);
    let (across, down) = (beside(at.col(), cols), beside(at.row(), rows));
    down.flat_map(move |row| across.clone().map(move |col| (col, row)))
}

/// How much of something belongs to the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SurfaceCoverage {
    /// All.
    Inside,
    /// Some.
    Partly,
    /// Nothing.
    Outside,
}

/// Cells of the surface, summed up from the first sample, so that those of a rectangle are counted in no time
/// (Crow 1984).
pub(crate) struct SurfaceCellSums {
    sums: Vec<u32>,
    width: u32,
    height: u32,
}

impl SurfaceCellSums {
    pub(crate) fn new(grid: &HeightGrid<'_>) -> Self {
        let (width, height) = (grid.width(), grid.height());
        let mut cells = Self { sums: Vec::with_capacity(grid.len()), width, height };
        for row in 0..height {
            let mut sum = 0;
            for col in 0..width {
                sum += u32::from(row > 0 && col > 0 && grid.holds_cell(col - 1, row - 1));
                let above = if row > 0 { cells.before(col, row - 1) } else { 0 };
                cells.sums.push(above + sum);
            }
        }
        cells
    }

    /// Cells of the surface before this sample, in columns and rows.
    fn before(&self, col: u32, row: u32) -> u32 {
        self.sums[row as usize * self.width as usize + col as usize]
    }

    /// How much of the rectangle between two samples belongs to the surface; beyond the grid nothing does.
    pub(crate) fn extent(&self, low: [u32; 2], high: [u32; 2]) -> SurfaceCoverage {
        let within = |[col, row]: [u32; 2]| [col.min(self.width - 1), row.min(self.height - 1)];
        let ([left, above], [right, below]) = (within(low), within(high));
        let held = self.before(right, below) + self.before(left, above)
            - self.before(left, below)
            - self.before(right, above);
        match held {
            0 => SurfaceCoverage::Outside,
            _ if u64::from(held) == area(low, high) => SurfaceCoverage::Inside,
            _ => SurfaceCoverage::Partly,
        }
    }
}

fn area(low: [u32; 2], high: [u32; 2]) -> u64 {
    u64::from(high[0] - low[0]) * u64::from(high[1] - low[1])
}

/// Samples of the grid by what becomes of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleStatistics {
    /// With a height.
    pub valid: u64,
    /// Number of valid samples without a cell of four valid samples: they have no surface.
    pub isolated: u64,
}

impl SampleStatistics {
    pub(crate) fn of(grid: &HeightGrid<'_>) -> Self {
        let mut census = Self::default();
        for role in grid.samples().map(|at| grid.role(at)) {
            census.valid += u64::from(role != SampleRole::Void);
            census.isolated += u64::from(role == SampleRole::Isolated);
        }
        census
    }
}
