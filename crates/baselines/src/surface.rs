//! The surface of a grid: the union of the cells whose four samples are valid.
//!
//! Samples on its outline towards voids are vertices from the start. Edges of the unit lattice are always
//! Delaunay (their diametral circle contains no other sample), so the Delaunay triangulation of these vertices
//! contains the outline without constraints; and no sample lies within a unit edge, so no method splits it.

use crate::grid::{HeightGrid, PackedSample};

/// Role of a sample in the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SampleRole {
    /// All its cells belong to the surface.
    Interior,
    /// Some of its cells belong to the surface: it must be a vertex.
    Outline,
    /// Valid, but in no cell of the surface.
    Isolated,
    /// Without a height.
    Void,
}

impl HeightGrid<'_> {
    /// Role of a sample in the surface.
    pub(crate) fn role(&self, at: PackedSample) -> SampleRole {
        let (mut has_cell, mut lacks_cell) = (false, false);
        for (col, row) in cells_around(self, at) {
            match self.holds_cell(col, row) {
                true => has_cell = true,
                false => lacks_cell = true,
            }
        }
        match (has_cell, lacks_cell) {
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
    let [cols, rows] = [(at.col(), cols), (at.row(), rows)]
        .map(|(at, count)| at.saturating_sub(1)..(at + 1).min(count));
    rows.flat_map(move |row| cols.clone().map(move |col| (col, row)))
}

/// Coverage of an area by the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SurfaceCoverage {
    /// All.
    Inside,
    /// Some.
    Partly,
    /// Nothing.
    Outside,
}

/// Summed-area table of the cells of the surface: counts those of a rectangle in O(1) (Crow 1984).
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

    /// Number of cells of the surface before this sample in columns and rows.
    fn before(&self, col: u32, row: u32) -> u32 {
        self.sums[row as usize * self.width as usize + col as usize]
    }

    /// Coverage of the rectangle between two samples by the surface, which ends with the grid.
    pub(crate) fn extent(&self, low: [u32; 2], high: [u32; 2]) -> SurfaceCoverage {
        let [[left, above], [right, below]] =
            [low, high].map(|[col, row]| [col.min(self.width - 1), row.min(self.height - 1)]);
        let count = self.before(right, below) + self.before(left, above)
            - self.before(left, below)
            - self.before(right, above);
        match count {
            0 => SurfaceCoverage::Outside,
            _ if u64::from(count) == area(low, high) => SurfaceCoverage::Inside,
            _ => SurfaceCoverage::Partly,
        }
    }
}

fn area(low: [u32; 2], high: [u32; 2]) -> u64 {
    u64::from(high[0] - low[0]) * u64::from(high[1] - low[1])
}

/// Statistics of the samples of a grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleStatistics {
    /// Number of samples with a height.
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
