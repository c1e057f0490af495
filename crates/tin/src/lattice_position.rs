//! Positions on the lattice of a tile or patch.

use terrane_base::geom::predicates::Lattice;

/// A lattice position inside a tile or patch: column and row below 2^14, packed so that integer
/// order is (row, column) order.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, bytemuck::Pod, bytemuck::Zeroable,
)]
#[repr(transparent)]
pub struct TilePosition(u32);

impl TilePosition {
    /// Bits of the column.
    const BITS: u32 = 14;

    /// The position (`col`, `row`); both below 2^14.
    #[inline(always)]
    pub fn new(col: u32, row: u32) -> Self {
        debug_assert!(col >> Self::BITS == 0 && row >> Self::BITS == 0);
        Self(row << Self::BITS | col)
    }

    /// Column.
    #[inline(always)]
    pub fn col(self) -> u32 {
        self.0 & ((1 << Self::BITS) - 1)
    }

    /// Row.
    #[inline(always)]
    pub fn row(self) -> u32 {
        self.0 >> Self::BITS
    }

    /// As coordinates for the predicates.
    #[inline(always)]
    pub(super) fn lattice(self) -> Lattice {
        [self.col() as i32, self.row() as i32]
    }

    /// Squared distance in cells, exact.
    #[inline]
    pub(super) fn square_distance(self, other: Self) -> f64 {
        let ([x, y], [to_x, to_y]) = (self.lattice(), other.lattice());
        let [dx, dy] = [to_x - x, to_y - y].map(f64::from);
        dx * dx + dy * dy
    }
}
