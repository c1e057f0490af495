//! The geodetic tiling: level z has 2^(z+1) columns from -180 degrees and 2^z rows from the south pole.

use std::fmt;

/// The finest supported level: all borders of tiles are exact in `f64`, and columns fit in 32 bits.
pub const MAX_LEVEL: u8 = 30;

/// The largest u, v and height of a vertex.
pub const LAST: u16 = 32_767;

/// A tile by its level, column and row. Sorted by level, then row from the south, then column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ProofTileId {
    /// Level, 0 the coarsest.
    pub level: u8,
    /// Row, from the south.
    pub y: u32,
    /// Column, from the west.
    pub x: u32,
}

/// A side of a tile, in the order of the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum ProofTileSide {
    West,
    South,
    East,
    North,
}

impl ProofTileSide {
    /// All of them, in the order of the format.
    pub const ALL: [Self; 4] = [Self::West, Self::South, Self::East, Self::North];

    /// The same border as seen from the neighbour.
    pub fn opposite(self) -> Self {
        match self {
            Self::West => Self::East,
            Self::South => Self::North,
            Self::East => Self::West,
            Self::North => Self::South,
        }
    }

    /// True for a side of constant longitude.
    pub fn is_meridian(self) -> bool {
        matches!(self, Self::West | Self::East)
    }
}

impl fmt::Display for ProofTileId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}/{}", self.level, self.x, self.y)
    }
}

impl ProofTileId {
    /// The tile of column `x` and row `y`; `None` beyond the last ones, or [`MAX_LEVEL`].
    pub fn new(level: u8, x: u32, y: u32) -> Option<Self> {
        let is_there = level <= MAX_LEVEL && x < columns(level) && y < rows(level);
        is_there.then_some(Self { level, y, x })
    }

    /// West, south, east and north in degrees, exact.
    pub fn bounds(self) -> [f64; 4] {
        let side = side(self.level);
        let [x, y] = [self.x, self.y].map(f64::from);
        let (west, south) = (x * side - 180.0, y * side - 90.0);
        [west, south, west + side, south + side]
    }

    /// The neighbour on its level; `None` beyond the poles and the antimeridian.
    pub fn neighbour(self, side: ProofTileSide) -> Option<Self> {
        let Self { level, x, y } = self;
        match side {
            ProofTileSide::West => Self::new(level, x.checked_sub(1)?, y),
            ProofTileSide::South => Self::new(level, x, y.checked_sub(1)?),
            ProofTileSide::East => Self::new(level, x + 1, y),
            ProofTileSide::North => Self::new(level, x, y + 1),
        }
    }

    /// The tile of the next coarser level that contains it.
    pub fn parent(self) -> Option<Self> {
        Self::new(self.level.checked_sub(1)?, self.x / 2, self.y / 2)
    }

    /// Its four tiles of the next finer level.
    pub fn below(self) -> impl Iterator<Item = Self> {
        let Self { level, x, y } = self;
        let parts = [[0, 0], [1, 0], [0, 1], [1, 1]];
        parts.into_iter().filter_map(move |[i, j]| Self::new(level + 1, 2 * x + i, 2 * y + j))
    }

    /// The neighbour on the next coarser level; `None` where the side is not a border of that level.
    pub fn coarser_beside(self, side: ProofTileSide) -> Option<Self> {
        let parent = self.parent()?;
        let [is_east, is_north] = [self.x, self.y].map(|at| at % 2 == 1);
        let is_outer = match side {
            ProofTileSide::West => !is_east,
            ProofTileSide::East => is_east,
            ProofTileSide::South => !is_north,
            ProofTileSide::North => is_north,
        };
        parent.neighbour(side).filter(|_| is_outer)
    }

    /// The rows of tiles of a level that contain a latitude, borders included.
    pub fn rows_of(level: u8, latitude: f64) -> impl Iterator<Item = u32> {
        around(level, latitude + 90.0).filter(move |&y| {
            let bounds = Self::new(level, 0, y).map(Self::bounds);
            bounds.is_some_and(|[_, south, _, north]| (south..=north).contains(&latitude))
        })
    }

    /// The columns of tiles of a level that contain a longitude, borders included.
    pub fn columns_of(level: u8, longitude: f64) -> impl Iterator<Item = u32> {
        around(level, longitude + 180.0).filter(move |&x| {
            let bounds = Self::new(level, x, 0).map(Self::bounds);
            bounds.is_some_and(|[west, _, east, _]| (west..=east).contains(&longitude))
        })
    }
}

/// Columns of a level.
pub fn columns(level: u8) -> u32 {
    2 << level
}

/// Rows of a level.
pub fn rows(level: u8) -> u32 {
    1 << level
}

/// Coordinate at a step of [`LAST`] between two ends; the ends are exact.
pub(super) fn coordinate(step: u16, low: f64, high: f64) -> f64 {
    match step {
        LAST => high,
        step => low + f64::from(step) / f64::from(LAST) * (high - low),
    }
}

/// Degrees of a side of a tile, exact.
fn side(level: u8) -> f64 {
    180.0 / f64::from(rows(level))
}

/// Numbers of tiles that may contain a coordinate `degrees` from the first border.
fn around(level: u8, degrees: f64) -> impl Iterator<Item = u32> {
    // The quotient rounds, so neighbours are candidates as well.
    let near = (degrees / side(level)) as u32;
    near.saturating_sub(1)..=near.saturating_add(1)
}
