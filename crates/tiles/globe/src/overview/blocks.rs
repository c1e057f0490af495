//! Blocks of samples: a plane for each, and the distances of its samples.

use terrane_base::geom::Rect;

/// Smallest number of samples along a block.
const MIN_SIDE: u32 = 16;
/// Largest number of blocks of a grid.
const MAX_BLOCKS: u64 = 1 << 21;

/// Statistics of a block of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleBlock {
    /// Valid samples.
    pub count: u32,
    /// Height at its first sample, and increments per column and row.
    pub(super) plane: [f64; 3],
    /// Samples furthest below and above the plane.
    pub(super) ends: [BlockExtreme; 2],
    /// Largest height difference of adjacent samples in metres.
    pub(super) jump: f64,
}

/// A sample of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BlockExtreme {
    /// Columns and rows from the first sample of the block.
    pub(super) at: [u16; 2],
    pub(super) height: f64,
    /// Metres above the plane.
    pub(super) off: f64,
}

/// Division of a grid into blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleBlocks {
    /// Samples along the side of a block.
    pub side: u32,
    /// Columns and rows of blocks.
    pub counts: [u32; 2],
    /// Columns and rows of samples.
    pub(super) size: [u32; 2],
}

impl SampleBlocks {
    /// For a grid of this many columns and rows.
    pub fn of(size: [u32; 2]) -> Self {
        let mut blocks = Self { side: MIN_SIDE, counts: [0; 2], size };
        loop {
            blocks.counts = size.map(|end| end.div_ceil(blocks.side));
            if blocks.counts.map(u64::from).iter().product::<u64>() <= MAX_BLOCKS {
                return blocks;
            }
            blocks.side *= 2;
        }
    }

    /// The samples of a block.
    pub fn rect(&self, [col, row]: [u32; 2]) -> Rect {
        let [col, row] = [col * self.side, row * self.side];
        Rect::new(col, row, self.side.min(self.size[0] - col), self.side.min(self.size[1] - row))
    }
}

impl SampleBlock {
    /// From heights with row stride `stride`.
    pub(super) fn of(heights: &[f64], stride: usize, [width, height]: [usize; 2]) -> Self {
        let valid = valid(heights, stride, [width, height]);
        let Some((_, _, first)) = valid.clone().next() else { return Self::default() };
        let mut sums = [0.0; 9];
        for (x, y, z) in valid.clone() {
            // Relative to one of them: sums of squares of large heights would lose the small differences.
            let z = z - first;
            let terms = [1.0, x, y, z, x * x, x * y, y * y, x * z, y * z];
            (0..9).for_each(|i| sums[i] += terms[i]);
        }
        let [n, x, y, z, xx, xy, yy, xz, yz] = sums;
        let [xx, xy, yy] = [xx - x * x / n, xy - x * y / n, yy - y * y / n];
        let [xz, yz] = [xz - x * z / n, yz - y * z / n];
        let area = xx * yy - xy * xy;
        // With fewer than three samples, or collinear ones, the plane is level.
        let slopes = match area > 1e-9 * (xx * yy).max(1.0) {
            true => [(xz * yy - yz * xy) / area, (yz * xx - xz * xy) / area],
            false => [0.0; 2],
        };
        let base = first + (z - slopes[0] * x - slopes[1] * y) / n;
        let mut block = Self {
            count: n as u32,
            plane: [base, slopes[0], slopes[1]],
            ends: [BlockExtreme::default(); 2],
            jump: jump(heights, stride, [width, height]),
        };
        let samples = valid.map(|(x, y, height)| {
            let at = [x as u16, y as u16];
            BlockExtreme { at, height, off: height - block.height([x, y]) }
        });
        let low = samples.clone().min_by(|a, b| a.off.total_cmp(&b.off)).unwrap_or_default();
        let high = samples.max_by(|a, b| a.off.total_cmp(&b.off)).unwrap_or_default();
        block.ends = [low, high];
        block
    }

    /// Height of the plane at a column and row from the first sample.
    pub(super) fn height(&self, [col, row]: [f64; 2]) -> f64 {
        self.plane[0] + self.plane[1] * col + self.plane[2] * row
    }

    /// Upper bound of the distance of samples from the plane in metres.
    pub fn off(&self) -> f64 {
        // Rounding error of the sums.
        let size = self.plane[0].abs() + self.plane[1].abs() * 1e4 + self.plane[2].abs() * 1e4;
        self.ends[0].off.abs().max(self.ends[1].off.abs()) + size * 1e-12
    }
}

/// Column, row and height of the valid samples.
fn valid(
    heights: &[f64],
    stride: usize,
    [width, height]: [usize; 2],
) -> impl Iterator<Item = (f64, f64, f64)> + Clone {
    let all = (0..height).flat_map(move |row| (0..width).map(move |col| (col, row)));
    all.filter_map(move |(col, row)| {
        let z = heights[row * stride + col];
        z.is_finite().then_some((col as f64, row as f64, z))
    })
}

/// Largest height difference of adjacent samples in metres.
fn jump(heights: &[f64], stride: usize, [width, height]: [usize; 2]) -> f64 {
    let mut largest = 0.0_f64;
    for row in 0..height {
        let line = &heights[row * stride..][..width];
        let across = line.windows(2).map(|two| (two[1] - two[0]).abs());
        // NaN heights never compare.
        largest = across.fold(largest, f64::max);
        if row > 0 {
            let above = &heights[(row - 1) * stride..][..width];
            let down = line.iter().zip(above).map(|(a, b)| (a - b).abs());
            largest = down.fold(largest, f64::max);
        }
    }
    largest
}
