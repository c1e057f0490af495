//! How the memory of a contour job is divided.

use super::job::ContourJob;
use terrane_engine::memory::MemoryShares;
use terrane_window::contour::{self as contour, ContourVertex};

/// Bytes of a vertex that waits.
pub(super) const VERTEX_BYTES: u64 = size_of::<ContourVertex>() as u64;

/// Bytes of a crossing in the tile at hand: its node, and its vertex.
const CROSSING_BYTES: u64 = contour::CROSSING_BYTES + VERTEX_BYTES;

/// Additional bytes of simplification for each crossing, when most vertices are kept.
const SIMPLIFYING_BYTES: u64 = 140;

/// Least and largest number of crossings of a tile that memory is reserved for.
const CROSSINGS: [u64; 2] = [1 << 17, 1 << 24];

/// Bytes of a waiting piece: itself, its open ends, and its sort key.
const PIECE_BYTES: u64 = 160;

/// Additional bytes of polygons for each crossing in the tile at hand, and each straight side of its border.
const BAND_CROSSING_BYTES: u64 = 80;

/// Bytes of a waiting piece of polygons.
const BAND_PIECE_BYTES: u64 = 512;

/// Bytes of a straight side of the border, and of the rings that are made of it.
pub(super) const SIDE_BYTES: u64 = 128;

/// Bytes of a vertex of the line that is being written: here, as a position, and as text.
const WRITING_BYTES: u64 = 128;

/// A divided budget.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ContourMemory {
    pub(super) threads: usize,
    /// Bytes of a thread.
    pub(super) worker: u64,
    /// Most crossings of a tile.
    pub(super) crossings: u64,
    /// Bytes for pieces of lines and sides of the border, and of a piece.
    pub(super) waiting: u64,
    pub(super) piece_bytes: u64,
    /// Most vertices that wait in memory.
    pub(super) vertices: u64,
    memory: u64,
}

impl ContourMemory {
    /// What a thread takes; without shares of an open grid.
    pub(super) fn of(job: &ContourJob) -> Self {
        let side = u64::from(job.options.tile) + 1;
        let samples = side * side * 8;
        let crossing_bytes =
            CROSSING_BYTES + job.options.tolerance.map_or(0, |_| SIMPLIFYING_BYTES);
        let polygons = job.options.polygons;
        let crossing_bytes = crossing_bytes + if polygons { BAND_CROSSING_BYTES } else { 0 };
        let piece_bytes = if polygons { BAND_PIECE_BYTES } else { PIECE_BYTES };
        let [min, max] = CROSSINGS;
        let (memory, threads) =
            (job.options.resources.memory, job.options.resources.threads.max(1));
        let share = (memory / 4 / threads as u64).saturating_sub(samples);
        let crossings = (share / crossing_bytes).clamp(min, max);
        let worker = samples + crossings * crossing_bytes;
        Self { worker, crossings, memory, piece_bytes, ..Self::default() }
    }

    /// The same with the shares that an open grid leaves.
    pub(super) fn with(self, shares: MemoryShares) -> Self {
        Self {
            threads: shares.threads,
            waiting: shares.mesh / 4 * 3,
            vertices: shares.mesh / 4 / VERTEX_BYTES,
            ..self
        }
    }

    /// Most vertices of a line; lines are written after all tiles.
    pub(super) fn line_vertices(&self) -> u64 {
        self.memory / 2 / WRITING_BYTES
    }

    /// The memory in which a line, or polygon, with so many vertices can be written.
    pub(super) fn for_line(vertices: u64) -> u64 {
        vertices.saturating_mul(2 * WRITING_BYTES)
    }
}
