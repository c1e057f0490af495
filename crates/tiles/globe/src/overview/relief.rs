//! Requirements of the ground on levels, from blocks before any tile is made: height range of a tile, and
//! roughness where a tile would have too many vertices.

use super::GridOverview;
use super::blocks::SampleBlock;
use super::plan::both;
use crate::globe::EQUATOR;
use crate::level::LevelRelief;
use crate::tiling::{degrees, level_error};

/// Approximate largest number of vertices of a tile at the geometric error.
const MAX_VERTICES: u64 = 1 << 18;

/// Range of no heights.
const NONE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

impl GridOverview {
    /// Range of heights of a tile.
    pub fn ends(&self) -> [f64; 2] {
        match self.plan.chart.slope() > 0.0 {
            true => both(self.range, [0.0; 2]),
            false => self.range,
        }
    }

    /// Requirements of each level to the last. O(blocks) for each far level.
    pub fn reliefs(&self, last: u8) -> Vec<LevelRelief> {
        let ranges = self.ranges();
        let [low, high] = self.ends();
        let jump = self.jump();
        let levels = (0..=last).map(|level| LevelRelief {
            reach: low.abs().max(high.abs()),
            range: self.range_of(level, &ranges).min(high - low),
            rough: self.roughness(level),
            doubt: self.plan.chart.doubt(),
            jump,
        });
        levels.collect()
    }

    /// Largest height difference of adjacent samples in metres: between two blocks the difference guaranteed by
    /// their planes, so that rough ground is not taken for a cliff.
    fn jump(&self) -> f64 {
        let [cols, rows] = self.plan.blocks.counts;
        let all = (0..rows).flat_map(|row| (0..cols).map(move |col| [col, row]));
        let jumps = all.map(|at| {
            let [right, below] = [0, 1].map(|axis| self.jump_beside(at, axis));
            self.block(at).jump.max(right).max(below)
        });
        jumps.fold(0.0, f64::max)
    }

    /// The same between a block and the next one along an axis; 0 where there is none.
    fn jump_beside(&self, at: [u32; 2], axis: usize) -> f64 {
        let mut next = at;
        next[axis] += 1;
        if next[axis] == self.plan.blocks.counts[axis] {
            return 0.0;
        }
        let [block, beside] = [at, next].map(|at| self.block(at));
        if block.count == 0 || beside.count == 0 {
            return 0.0;
        }
        let rect = self.plan.blocks.rect(at);
        let last = [rect.width - 1, rect.height - 1].map(f64::from);
        let [first, last] = [0.0, last[1 - axis]].map(|along| {
            let [mut here, mut there] = [[along; 2], [along; 2]];
            (here[axis], there[axis]) = (last[axis], 0.0);
            (block.height(here) - beside.height(there)).abs()
        });
        first.max(last) - block.off() - beside.off()
    }

    /// Largest height range of a tile in metres.
    fn range_of(&self, level: u8, ranges: &[f64]) -> f64 {
        let across = degrees(level) / self.plan.chart.spacing() / f64::from(self.plan.blocks.side);
        // Tiles may lie across rows, and begin within a block.
        let blocks = across * 2_f64.sqrt() + 2.0;
        let doubled = (blocks.log2().ceil() as usize).min(ranges.len() - 1);
        let fall = 2.0 * degrees(level).to_radians() * EQUATOR * self.plan.chart.slope();
        ranges[doubled] + fall
    }

    /// Largest height range of 1, 2, 4, ... times as many adjacent blocks in metres, up to all.
    fn ranges(&self) -> Vec<f64> {
        let [cols, rows] = self.plan.blocks.counts.map(|count| count as usize);
        let all = (0..rows as u32).flat_map(|row| (0..cols as u32).map(move |col| [col, row]));
        let mut ends: Vec<[f64; 2]> = all.map(|at| self.ends_of(at)).collect();
        let mut ranges = vec![max_range(&ends)];
        let mut size = 1;
        while size < cols.max(rows) {
            for row in 0..rows {
                for col in 0..cols {
                    let [right, down] = [(col + size).min(cols - 1), (row + size).min(rows - 1)];
                    let of = [[right, row], [col, down], [right, down]];
                    let range = of.iter().fold(ends[row * cols + col], |range, [col, row]| {
                        both(range, ends[row * cols + col])
                    });
                    ends[row * cols + col] = range;
                }
            }
            size *= 2;
            ranges.push(max_range(&ends));
        }
        ranges
    }

    /// Range of heights of a block, including its voids.
    fn ends_of(&self, at: [u32; 2]) -> [f64; 2] {
        let (block, rect) = (self.block(at), self.plan.blocks.rect(at));
        let of_voids = match u64::from(block.count) == rect.len() as u64 {
            true => NONE,
            false => self.fill.ends(rect),
        };
        let [low, high] = self.range;
        let [below, above] = block.ends_of([rect.width, rect.height]);
        both([below.max(low), above.min(high)], of_voids)
    }

    /// Error below which tiles of a level would have too many vertices, because they have more samples in
    /// blocks that no plane approximates.
    fn roughness(&self, level: u8) -> f64 {
        let across = degrees(level) / self.plan.chart.spacing();
        if across * across <= MAX_VERTICES as f64 {
            return 0.0;
        }
        let [cols, rows] = self.plan.blocks.counts;
        let all = (0..rows).flat_map(|row| (0..cols).map(move |col| [col, row]));
        let rough = all.filter(|at| self.block(*at).off() > level_error(level));
        let mut blocks: Vec<RoughBlock> = rough
            .map(|at| {
                let (block, rect) = (self.block(at), self.plan.blocks.rect(at));
                let middle = [rect.col + rect.width / 2, rect.row + rect.height / 2];
                let [lon, lat] = self.plan.chart.place(middle.map(f64::from));
                let tile = [lon + 180.0, lat + 90.0].map(|at| (at / degrees(level)) as u32);
                RoughBlock { tile, off: block.off(), samples: block.count }
            })
            .collect();
        blocks.sort_by(|a, b| a.tile.cmp(&b.tile).then(b.off.total_cmp(&a.off)));
        blocks.chunk_by(|a, b| a.tile == b.tile).map(tile_roughness).fold(0.0, f64::max)
    }
}

/// A block that no plane approximates within the error of a level.
struct RoughBlock {
    /// Column and row of its tile.
    tile: [u32; 2],
    /// Largest distance of a sample from the plane in metres.
    off: f64,
    samples: u32,
}

/// Error of a tile with at most [`MAX_VERTICES`] samples in rougher blocks; its blocks are sorted by error,
/// largest first.
fn tile_roughness(blocks: &[RoughBlock]) -> f64 {
    let mut sum = 0;
    let first = blocks.iter().find(|block| {
        sum += u64::from(block.samples);
        sum > MAX_VERTICES
    });
    // At least the distance of two samples of a block: below it, each vertex would cause another.
    first.map_or(0.0, |block| 2.0 * block.off)
}

fn max_range(ends: &[[f64; 2]]) -> f64 {
    ends.iter().map(|[low, high]| high - low).fold(0.0, f64::max)
}

impl SampleBlock {
    /// Bounds of the heights of its samples, for a size in columns and rows.
    fn ends_of(&self, [width, height]: [u32; 2]) -> [f64; 2] {
        if self.count == 0 {
            return NONE;
        }
        let [right, down] = [width - 1, height - 1].map(f64::from);
        let corners = [[0.0, 0.0], [right, 0.0], [0.0, down], [right, down]];
        let plane = corners.map(|at| [self.height(at); 2]).into_iter().fold(NONE, both);
        [plane[0] - self.off(), plane[1] + self.off()]
    }
}
