//! Kept vertices as bits: one per vertex of a tile, in input order.

use std::path::Path;

use bytemuck::Pod;

use terrane_base::bits::BitSet;
use terrane_base::error::Result;
use terrane_files::Buckets;
use terrane_line::tiles::TileRun;
use terrane_vector as vector;

/// Records of a tile held at a time.
const RECORDS: usize = 128;

/// Appends to `bits` the kept flags of `count` vertices, the first with number `first`.
pub(super) fn add(bits: &mut BitSet, kept: &vector::RetainedVertices, first: usize, count: usize) {
    match kept {
        vector::RetainedVertices::All => {
            for vertex in first..first + count {
                bits.insert(vertex);
            }
        }
        vector::RetainedVertices::Nothing => {}
        vector::RetainedVertices::Vertices(vertices) => {
            for vertex in vertices {
                bits.insert(first + *vertex as usize);
            }
        }
    }
}

/// Bits of all tiles, in memory or in an unnamed file.
pub(super) struct RetainedBits {
    bits: Buckets<u64>,
    tile_count: usize,
}

impl RetainedBits {
    pub(super) fn new(folder: &Path, tile_count: usize, memory: u64) -> Self {
        Self { bits: Buckets::new(folder, tile_count, memory), tile_count }
    }

    /// Sets the bits of a tile, once.
    pub(super) fn set(&self, tile: usize, bits: &BitSet) -> Result<()> {
        self.bits.push(tile, bits.words())
    }

    pub(super) fn reader(&self) -> RetainedBitsReader<'_> {
        RetainedBitsReader {
            bits: &self.bits,
            words: TileCursors::new(self.tile_count),
            open: vec![(0, 0); self.tile_count],
        }
    }
}

/// Next records of a tile.
#[derive(Clone, Debug)]
struct TileCursor<T> {
    records: Vec<T>,
    /// Number of the first record.
    first: usize,
    /// Next record.
    next: usize,
}

/// Reads the records of each tile in order, in blocks of 128.
#[derive(Debug)]
pub(super) struct TileCursors<T>(Vec<TileCursor<T>>);

impl<T: Pod> TileCursors<T> {
    pub(super) fn new(tile_count: usize) -> Self {
        Self(
            (0..tile_count)
                .map(|_| TileCursor { records: Vec::new(), first: 0, next: 0 })
                .collect(),
        )
    }

    /// Next record of a tile; `None` at the end.
    pub(super) fn next(&mut self, all: &Buckets<T>, tile: usize) -> Result<Option<T>> {
        let cursor = &mut self.0[tile];
        if cursor.next >= cursor.first + cursor.records.len() {
            cursor.records.resize(RECORDS, T::zeroed());
            let count = all.read_from(tile, cursor.next as u64, &mut cursor.records)?;
            cursor.records.truncate(count);
            cursor.first = cursor.next;
        }
        let record = cursor.records.get(cursor.next - cursor.first).copied();
        cursor.next += 1;
        Ok(record)
    }
}

/// Reads the bits of each tile in order.
pub(super) struct RetainedBitsReader<'a> {
    bits: &'a Buckets<u64>,
    words: TileCursors<u64>,
    /// Rest of each tile's last word, and its number of bits.
    open: Vec<(u64, u32)>,
}

impl RetainedBitsReader<'_> {
    /// Kept indices, ascending, of a part of `count` vertices with these runs, the next of their tiles.
    pub(super) fn part(
        &mut self,
        runs: &[TileRun],
        count: usize,
        found: &mut Vec<u32>,
    ) -> Result<()> {
        found.clear();
        for run in runs {
            for k in 0..run.count {
                if self.next(run.tile as usize)? {
                    found.push(((run.first + k) % count) as u32);
                }
            }
        }
        // The last run of a ring may wrap around to its start.
        if found.last() < found.first() {
            found.sort_unstable();
        }
        Ok(())
    }

    fn next(&mut self, tile: usize) -> Result<bool> {
        let (word, left) = &mut self.open[tile];
        if *left == 0 {
            let next = self.words.next(self.bits, tile)?;
            (*word, *left) = (next.unwrap_or_default(), u64::BITS);
        }
        let bit = *word & 1 == 1;
        (*word, *left) = (*word >> 1, *left - 1);
        Ok(bit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_come_back_in_the_order_of_the_parts() {
        let folder = tempfile::tempdir().unwrap();
        for memory in [1 << 20, 0] {
            let kept = RetainedBits::new(folder.path(), 2, memory);
            // Every third vertex of the first tile, every fifth of the second.
            for (tile, step) in [(0, 3), (1, 5)] {
                let mut bits = BitSet::new(20_000);
                for at in (0..20_000).step_by(step) {
                    bits.insert(at);
                }
                kept.set(tile, &bits).unwrap();
            }
            let mut reader = kept.reader();
            let (mut found, mut first) = (Vec::new(), [0, 0]);
            for part in 0..1500 {
                let runs: Vec<TileRun> = (0..3)
                    .scan(2, |at, k| {
                        let run = TileRun { tile: k % 2, first: *at, count: 3 + (part + *at) % 5 };
                        *at += run.count;
                        Some(run)
                    })
                    .collect();
                // A ring: the last run ends with its first two vertices.
                let count: usize = runs.iter().map(|run| run.count).sum();
                let mut want = Vec::new();
                for run in &runs {
                    let (own, step) = (&mut first[run.tile as usize], [3, 5][run.tile as usize]);
                    let is_kept = |k: &usize| (*own + k).is_multiple_of(step);
                    let all = (0..run.count).filter(is_kept);
                    want.extend(all.map(|k| ((run.first + k) % count) as u32));
                    *own += run.count;
                }
                want.sort_unstable();
                reader.part(&runs, count, &mut found).unwrap();
                assert_eq!(found, want);
            }
        }
    }
}
