//! Layout of a store: tile sizes, tile counts and byte offsets.

use crate::grid::SampleType;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;
use terrane_base::limits;

/// Valid tile sides.
pub const TILE_SIDES: &[u32] = &[256, 512, 1024];
/// Default tile side.
pub const DEFAULT_TILE: u32 = 512;
/// Alignment of tiles in bytes.
pub(super) const PAGE: u64 = 4096;
/// Tile sides are multiples of this, so that a tile is a whole number of pages.
const SIDE_STEP: u32 = 64;

/// Size and tiling of a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TiledTiffLayout {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) tile_width: u32,
    pub(super) tile_height: u32,
    pub(super) sample_type: SampleType,
}

impl TiledTiffLayout {
    /// The layout with tiles of `side`, smaller where the grid is.
    pub(super) fn new(width: u32, height: u32, side: u32, sample_type: SampleType) -> Result<Self> {
        if !TILE_SIDES.contains(&side) {
            return Err(Error::usage(format!("tile size {side} is not supported"))
                .remedy(format!("choose one of {TILE_SIDES:?}")));
        }
        if width == 0 || height == 0 {
            return Err(Error::usage("grid has no samples"));
        }
        // The minimum comes first: the next multiple of a large length would overflow.
        let [tile_width, tile_height] =
            [width, height].map(|length| side.min(length.min(side).next_multiple_of(SIDE_STEP)));
        let layout = Self { width, height, tile_width, tile_height, sample_type };
        layout.check()?;
        Ok(layout)
    }

    /// Rejects layouts that this version does not write, before anything is computed from them.
    pub(super) fn check(&self) -> Result<()> {
        limits::check("width", u64::from(self.width), limits::MAX_SIDE)?;
        limits::check("height", u64::from(self.height), limits::MAX_SIDE)?;
        let largest = TILE_SIDES.last().copied().unwrap_or(DEFAULT_TILE);
        let are_sides_valid = [self.tile_width, self.tile_height]
            .iter()
            .all(|side| (1..=largest).contains(side) && side.is_multiple_of(SIDE_STEP));
        if self.width == 0 || self.height == 0 || !are_sides_valid {
            return Err(Error::new(ErrorKind::BadInput, "invalid layout of a store"));
        }
        limits::check("number of tiles", self.tiles(), limits::MAX_BLOCKS)
    }

    /// Number of tiles across.
    pub(super) fn across(&self) -> u32 {
        self.width.div_ceil(self.tile_width)
    }

    /// Number of tiles down.
    pub(super) fn down(&self) -> u32 {
        self.height.div_ceil(self.tile_height)
    }

    /// Number of tiles.
    pub(super) fn tiles(&self) -> u64 {
        u64::from(self.across()) * u64::from(self.down())
    }

    /// Bytes of one row of one tile.
    pub(super) fn row_bytes(&self) -> u64 {
        u64::from(self.tile_width) * self.sample_type.bytes() as u64
    }

    /// Bytes of one tile, a multiple of [`PAGE`].
    pub(super) fn tile_bytes(&self) -> u64 {
        self.row_bytes() * u64::from(self.tile_height)
    }

    /// Number of the tile at (`across`, `down`).
    pub(super) fn tile(&self, across: u32, down: u32) -> u64 {
        u64::from(down) * u64::from(self.across()) + u64::from(across)
    }

    /// The samples of the grid in the tile at (`across`, `down`).
    pub(super) fn tile_rect(&self, across: u32, down: u32) -> Rect {
        let tile = Rect::new(
            across * self.tile_width,
            down * self.tile_height,
            self.tile_width,
            self.tile_height,
        );
        tile.intersect(&Rect::new(0, 0, self.width, self.height))
    }
}
