//! Crossings of contour lines with the edges of the lattice of a grid.

/// An edge of the lattice of a grid: twice the linear index of its first sample, plus one where it
/// goes down to the next row instead of along its own.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, bytemuck::Pod, bytemuck::Zeroable,
)]
#[repr(transparent)]
pub struct CrossedEdge(u64);

impl CrossedEdge {
    /// The edge from sample (`col`, `row`) of a grid of `width` columns, along the row or down.
    pub fn new(col: u32, row: u32, is_down: bool, width: u32) -> Self {
        Self(2 * (u64::from(row) * u64::from(width) + u64::from(col)) + u64::from(is_down))
    }

    /// True when it goes down.
    pub fn is_down(self) -> bool {
        self.0 & 1 == 1
    }

    /// Column and row of its first sample, in a grid of `width` columns.
    pub fn first(self, width: u32) -> (u32, u32) {
        let index = self.0 / 2;
        ((index % u64::from(width)) as u32, (index / u64::from(width)) as u32)
    }
}

/// Where a line crosses an edge.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ContourVertex {
    /// The edge.
    pub edge: CrossedEdge,
    /// How far along it, from its first sample (0) to its second (1).
    pub at: f64,
}

impl ContourVertex {
    /// Column and row, with fractions, in a grid of `width` columns.
    pub fn place(&self, width: u32) -> [f64; 2] {
        let (col, row) = self.edge.first(width);
        let (col, row) = (f64::from(col), f64::from(row));
        if self.edge.is_down() { [col, row + self.at] } else { [col + self.at, row] }
    }

    /// Column and row of the nearer sample of its edge.
    pub fn nearer(&self, width: u32) -> (u32, u32) {
        let (col, row) = self.edge.first(width);
        match (self.at < 0.5, self.edge.is_down()) {
            (true, _) => (col, row),
            (false, true) => (col, row + 1),
            (false, false) => (col + 1, row),
        }
    }
}
