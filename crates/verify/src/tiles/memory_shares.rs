//! Division of the memory budget. Half of it, less the program's own memory, is for the proof: up to a half of that
//! for records of all tiles, up to a half of the remainder for sides of water polygons, and the rest for windows of
//! samples and decoded tiles. The other half is for blocks of the raster, and for the allocator.

use super::georeference::GlobeRaster;
use terrane_base::error::Result;
use terrane_engine::Resources;
use terrane_engine::memory::{PROGRAM, beside_program, short};
use terrane_proof::tiles::{BYTES_PER_VERTEX, WaterBank};

/// Bytes of the record of each tile, with its metadata from subtrees.
const TILE_BYTES: u64 = 256;

/// Threads get so many times the bytes of a window, at least.
const WINDOWS: u64 = 8;

/// Inverse share of a decoded tile in the memory left beside windows.
const SHARES: u64 = 4;

/// Memory not yet allotted.
#[derive(Clone, Copy, Debug)]
pub(super) struct TilesProofMemory {
    free: u64,
    taken: u64,
}

/// The remaining memory, and its division among threads.
#[derive(Clone, Copy, Debug)]
pub(super) struct DividedBudget {
    pub(super) threads: usize,
    /// Bytes for decoded tiles.
    pub(super) memory: u64,
    window: u64,
    taken: u64,
    /// Requested threads.
    wanted: u64,
}

/// Columns and rows of a window: fewer where the position of each sample is stored.
pub(super) fn window(places: &GlobeRaster<'_>) -> u32 {
    if places.sample_bytes() == 0 { 512 } else { 128 }
}

/// Bytes of a window and its decoded tiles.
fn window_bytes(places: &GlobeRaster<'_>) -> u64 {
    // Of samples whose places are kept, their numbers by tile are, too: twice at a border, in lists that grow.
    let sample = match places.sample_bytes() {
        0 => 8,
        place => 8 + place + 4 * size_of::<usize>() as u64,
    };
    u64::from(window(places)).pow(2) * sample + (1 << 20)
}

/// Bytes of memory in which so many are free.
fn enough(free: u64) -> u64 {
    PROGRAM + 2 * free
}

impl TilesProofMemory {
    pub(super) fn new(resources: &Resources) -> Self {
        Self { free: beside_program(resources.memory) / 2, taken: 0 }
    }

    pub(super) fn take(&mut self, bytes: u64) {
        self.free = self.free.saturating_sub(bytes);
        self.taken += bytes;
    }

    /// Number of tiles that fit.
    pub(super) fn tiles(&self) -> usize {
        usize::try_from(self.free / 2 / TILE_BYTES).unwrap_or(usize::MAX)
    }

    pub(super) fn take_tiles(&mut self, count: usize) {
        self.take(count as u64 * TILE_BYTES);
    }

    /// Fails where there are more than `most` tiles.
    pub(super) fn check(count: usize, most: usize) -> Result<()> {
        match count <= most {
            true => Ok(()),
            false => Err(short(
                format!("there are {count} tiles, and {most} fit into memory"),
                enough(2 * count as u64 * TILE_BYTES),
            )),
        }
    }

    /// Number of parts of sides of water polygons that fit.
    pub(super) fn sides(&self) -> u64 {
        self.free / 2 / WaterBank::BYTES
    }

    /// Fails where there are more than so many.
    pub(super) fn check_sides(&self, count: u64) -> Result<()> {
        let most = self.sides();
        match count <= most {
            true => Ok(()),
            false => Err(short(
                format!("its sides have {count} parts, and {most} fit into memory"),
                enough(self.taken + 2 * count * WaterBank::BYTES),
            )),
        }
    }

    /// The remainder, for windows of the raster and decoded tiles.
    pub(super) fn divided(self, places: &GlobeRaster<'_>, threads: usize) -> DividedBudget {
        self.shared(window_bytes(places), threads)
    }

    fn shared(self, window: u64, wanted: usize) -> DividedBudget {
        let fitting = usize::try_from(self.free / (WINDOWS * window)).unwrap_or(usize::MAX);
        let threads = wanted.clamp(1, fitting.max(1));
        let memory = self.free.saturating_sub(threads as u64 * window);
        DividedBudget { threads, memory, window, taken: self.taken, wanted: wanted.max(1) as u64 }
    }
}

impl DividedBudget {
    /// Most vertices of a tile.
    fn vertices(&self) -> u64 {
        self.memory / SHARES / self.threads as u64 / BYTES_PER_VERTEX as u64
    }

    /// Fails where a tile has more vertices than fit.
    pub(super) fn fit(&self, vertices: usize) -> Result<()> {
        let most = self.vertices();
        if vertices as u64 <= most {
            return Ok(());
        }
        let tile = SHARES * vertices as u64 * BYTES_PER_VERTEX as u64;
        Err(short(
            format!("has {vertices} vertices, and {most} fit into memory"),
            enough(self.taken + self.wanted * (self.window + tile)),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::Error;

    const WINDOW: u64 = 3 << 20;

    fn room(memory: u64) -> TilesProofMemory {
        TilesProofMemory::new(&Resources { threads: 1, memory, temp_dir: None })
    }

    /// The bytes that an error advises.
    fn advised(error: &Error) -> u64 {
        let remedy = error.remedy_text().unwrap();
        let number: String = remedy.chars().filter(char::is_ascii_digit).collect();
        number.parse::<u64>().unwrap() << 20
    }

    #[test]
    fn memory_that_is_advised_is_enough() {
        let least = room(32 << 20);
        for count in [1 << 15, 1 << 20, 3_000_000, 1 << 28] {
            let error = TilesProofMemory::check(count, least.tiles()).unwrap_err();
            assert!(
                TilesProofMemory::check(count, room(advised(&error)).tiles()).is_ok(),
                "{count} tiles"
            );
        }
        for (tiles, count) in [(0, 1 << 20), (10_000, 1 << 18), (1 << 20, 1 << 24)] {
            let taken = |memory| {
                let mut room = room(memory);
                room.take_tiles(tiles);
                room
            };
            let error = taken(32 << 20).check_sides(count).unwrap_err();
            assert!(taken(advised(&error)).check_sides(count).is_ok(), "{tiles}, {count} sides");
        }
        for (tiles, vertices) in [(0, 1 << 16), (10_000, 1 << 18), (100_000, 1 << 20)] {
            for threads in [1, 2, 7, 64] {
                let divided = |memory| {
                    let mut room = room(memory);
                    room.take_tiles(tiles);
                    room.shared(WINDOW, threads)
                };
                let error = divided(32 << 20).fit(vertices).unwrap_err();
                let fits = divided(advised(&error)).fit(vertices);
                assert!(fits.is_ok(), "{tiles}, {vertices} vertices, {threads} threads: {fits:?}");
            }
        }
    }
}
