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

/// Memory of a thread, at least, as a multiple of the bytes of a window.
const WINDOWS: u64 = 8;

/// Inverse share of a decoded tile in the memory left by windows.
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
    pub(super) bytes: u64,
    window: u64,
    taken: u64,
    requested_threads: u64,
}

/// Columns and rows of a window: fewer where the position of each sample is stored.
pub(super) fn window(raster: &GlobeRaster<'_>) -> u32 {
    if raster.sample_bytes() == 0 { 512 } else { 128 }
}

/// Bytes of a window and its decoded tiles.
fn window_bytes(raster: &GlobeRaster<'_>) -> u64 {
    // Stored positions come with lists of sample numbers by tile: twice at a border, and a list has up to twice the capacity.
    let sample = match raster.sample_bytes() {
        0 => 8,
        position => 8 + position + 4 * size_of::<usize>() as u64,
    };
    u64::from(window(raster)).pow(2) * sample + (1 << 20)
}

/// Memory budget that leaves `free` bytes.
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

    /// Largest number of tiles.
    pub(super) fn tiles(&self) -> usize {
        usize::try_from(self.free / 2 / TILE_BYTES).unwrap_or(usize::MAX)
    }

    pub(super) fn take_tiles(&mut self, count: usize) {
        self.take(count as u64 * TILE_BYTES);
    }

    /// Fails for more than `max` tiles.
    pub(super) fn check(count: usize, max: usize) -> Result<()> {
        match count <= max {
            true => Ok(()),
            false => Err(short(
                format!("{count} tiles exceed the limit of {max} by memory"),
                enough(2 * count as u64 * TILE_BYTES),
            )),
        }
    }

    /// Largest number of segments of water polygons.
    pub(super) fn segments(&self) -> u64 {
        self.free / 2 / WaterBank::BYTES
    }

    /// Fails for more segments of water polygons than fit.
    pub(super) fn check_segments(&self, count: u64) -> Result<()> {
        let max = self.segments();
        match count <= max {
            true => Ok(()),
            false => Err(short(
                format!("{count} segments of polygons exceed the limit of {max} by memory"),
                enough(self.taken + 2 * count * WaterBank::BYTES),
            )),
        }
    }

    /// The remainder, for windows of the raster and decoded tiles.
    pub(super) fn divided(self, raster: &GlobeRaster<'_>, threads: usize) -> DividedBudget {
        self.shared(window_bytes(raster), threads)
    }

    fn shared(self, window: u64, requested: usize) -> DividedBudget {
        let max_threads = usize::try_from(self.free / (WINDOWS * window)).unwrap_or(usize::MAX);
        let threads = requested.clamp(1, max_threads.max(1));
        let bytes = self.free.saturating_sub(threads as u64 * window);
        let requested_threads = requested.max(1) as u64;
        DividedBudget { threads, bytes, window, taken: self.taken, requested_threads }
    }
}

impl DividedBudget {
    /// Largest number of vertices of a tile.
    fn vertices(&self) -> u64 {
        self.bytes / SHARES / self.threads as u64 / BYTES_PER_VERTEX as u64
    }

    /// Fails for a tile with more vertices than fit.
    pub(super) fn check_vertices(&self, vertices: usize) -> Result<()> {
        let max = self.vertices();
        if vertices as u64 <= max {
            return Ok(());
        }
        let tile = SHARES * vertices as u64 * BYTES_PER_VERTEX as u64;
        Err(short(
            format!("{vertices} vertices exceed the limit of {max} by memory"),
            // More memory means more threads, up to the requested number, which share it.
            enough(self.taken + self.requested_threads * (self.window + tile)),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::Error;

    const WINDOW: u64 = 3 << 20;

    /// A budget, less the records of tiles.
    fn budget(memory: u64, tiles: usize) -> TilesProofMemory {
        let resources = Resources { threads: 1, memory, temp_dir: None };
        let mut budget = TilesProofMemory::new(&resources);
        budget.take_tiles(tiles);
        budget
    }

    /// The bytes that an error advises.
    fn advised(error: &Error) -> u64 {
        let remedy = error.remedy_text().unwrap();
        let number: String = remedy.chars().filter(char::is_ascii_digit).collect();
        number.parse::<u64>().unwrap() << 20
    }

    #[test]
    fn advised_memory_is_enough() {
        let min = budget(32 << 20, 0).tiles();
        for count in [1 << 15, 1 << 20, 3_000_000, 1 << 28] {
            let error = TilesProofMemory::check(count, min).unwrap_err();
            let max = budget(advised(&error), 0).tiles();
            assert!(TilesProofMemory::check(count, max).is_ok(), "{count} tiles");
        }
        for (tiles, count) in [(0, 1 << 20), (10_000, 1 << 18), (1 << 20, 1 << 24)] {
            let error = budget(32 << 20, tiles).check_segments(count).unwrap_err();
            let fits = budget(advised(&error), tiles).check_segments(count);
            assert!(fits.is_ok(), "{tiles}, {count} segments");
        }
        for (tiles, vertices) in [(0, 1 << 16), (10_000, 1 << 18), (100_000, 1 << 20)] {
            for threads in [1, 2, 7, 64] {
                let divided = |memory| budget(memory, tiles).shared(WINDOW, threads);
                let error = divided(32 << 20).check_vertices(vertices).unwrap_err();
                let fits = divided(advised(&error)).check_vertices(vertices);
                assert!(fits.is_ok(), "{tiles}, {vertices} vertices, {threads} threads: {fits:?}");
            }
        }
    }
}
