//! The ground from afar: a plane for each block of samples and how far they are from it, for the levels whose tiles
//! have too many samples to look at each again and again; and the samples along the lines where these tiles meet.

mod bytes;
mod lines;
mod relief;

use std::collections::BTreeMap;
use std::ops::Range;

use crate::chart::{Chart, Spot};
use crate::ground::{Fill, Ground, Means, Sample, around, between, feet};
use crate::run::Run;
use crate::tiling::Bounds;
use lines::{Lines, beside, spots, whole};
use terrane_base::geom::Rect;

/// Samples along a block, at least.
const LEAST_SIDE: u32 = 16;
/// Blocks of a grid, at most.
const MOST_BLOCKS: u64 = 1 << 21;

/// What is known of a block of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Block {
    /// Valid samples.
    pub count: u32,
    /// Height at its first sample, and what a column and a row add.
    plane: [f64; 3],
    /// The samples that are furthest below the plane, and above it.
    ends: [Extreme; 2],
    /// Metres between the heights of two of its samples beside each other, at the most.
    jump: f64,
}

/// A sample of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Extreme {
    /// Columns and rows from the first sample of the block.
    at: [u16; 2],
    height: f64,
    /// Metres above the plane.
    off: f64,
}

/// How a grid is divided into blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocks {
    /// Samples along the side of a block.
    pub side: u32,
    /// Columns and rows of blocks.
    pub counts: [u32; 2],
    /// Columns and rows of samples.
    whole: [u32; 2],
}

impl Blocks {
    /// Of a grid of so many columns and rows.
    pub fn of(whole: [u32; 2]) -> Self {
        let count =
            |side: u32| whole.map(|end| u64::from(end.div_ceil(side))).iter().product::<u64>();
        let mut side = LEAST_SIDE;
        while count(side) > MOST_BLOCKS {
            side *= 2;
        }
        Self { side, counts: whole.map(|end| end.div_ceil(side)), whole }
    }

    /// The samples of a block.
    pub fn rect(&self, [col, row]: [u32; 2]) -> Rect {
        let [col, row] = [col * self.side, row * self.side];
        Rect::new(col, row, self.side.min(self.whole[0] - col), self.side.min(self.whole[1] - row))
    }
}

impl Block {
    /// Of heights, `stride` values from one row to the next.
    fn of(heights: &[f64], stride: usize, [width, height]: [usize; 2]) -> Self {
        let at = |col: usize, row: usize| heights[row * stride + col];
        let valid = || {
            let all = (0..height).flat_map(move |row| (0..width).map(move |col| (col, row)));
            all.filter_map(move |(col, row)| {
                let z = at(col, row);
                z.is_finite().then_some((col as f64, row as f64, z))
            })
        };
        let Some((_, _, first)) = valid().next() else { return Self::default() };
        let mut sums = [0.0; 9];
        for (x, y, z) in valid() {
            let z = z - first;
            let terms = [1.0, x, y, z, x * x, x * y, y * y, x * z, y * z];
            (0..9).for_each(|i| sums[i] += terms[i]);
        }
        let [n, x, y, z, xx, xy, yy, xz, yz] = sums;
        let [xx, xy, yy] = [xx - x * x / n, xy - x * y / n, yy - y * y / n];
        let [xz, yz] = [xz - x * z / n, yz - y * z / n];
        let area = xx * yy - xy * xy;
        // Of less than three samples, or some on a line, the plane is level.
        let slopes = match area > 1e-9 * (xx * yy).max(1.0) {
            true => [(xz * yy - yz * xy) / area, (yz * xx - xz * xy) / area],
            false => [0.0; 2],
        };
        let base = first + (z - slopes[0] * x - slopes[1] * y) / n;
        let mut block = Self {
            count: n as u32,
            plane: [base, slopes[0], slopes[1]],
            ends: [Extreme::default(); 2],
            jump: jump(heights, stride, [width, height]),
        };
        let found = valid().map(|(x, y, height)| {
            let at = [x as u16, y as u16];
            Extreme { at, height, off: height - block.height([x, y]) }
        });
        let less = |a: &Extreme, b: &Extreme| a.off.total_cmp(&b.off);
        let low = found.clone().min_by(less).unwrap_or_default();
        let high = found.max_by(less).unwrap_or_default();
        block.ends = [low, high];
        block
    }

    /// The height of the plane, so many columns and rows from the first sample.
    fn height(&self, [col, row]: [f64; 2]) -> f64 {
        self.plane[0] + self.plane[1] * col + self.plane[2] * row
    }

    /// Metres that no sample is further from the plane.
    pub fn off(&self) -> f64 {
        // What was added up is rounded.
        let size = self.plane[0].abs() + self.plane[1].abs() * 1e4 + self.plane[2].abs() * 1e4;
        self.ends[0].off.abs().max(self.ends[1].off.abs()) + size * 1e-12
    }
}

/// A part of what is looked at in a first pass, to be gathered with the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Glance {
    rect: Rect,
    blocks: Vec<Block>,
    lines: [BTreeMap<u32, Vec<f64>>; 2],
    means: Means,
    range: Option<[f64; 2]>,
}

/// What is to be looked at: a grid of blocks, and the columns and rows of which samples are kept.
#[derive(Clone, Debug)]
pub struct Plan {
    /// How it is divided.
    pub blocks: Blocks,
    chart: Chart,
    lines: [Lines; 2],
}

impl Plan {
    /// Of a grid. Along the meridians and parallels of `lines` the samples on both sides are kept.
    pub fn new(chart: Chart, lines: [&[f64]; 2]) -> Self {
        let lines = if chart.map().is_some() { whole(&chart, lines) } else { spots(&chart, lines) };
        Self { blocks: Blocks::of(chart.whole()), chart, lines }
    }

    /// Where the samples of the grid are.
    pub fn chart(&self) -> &Chart {
        &self.chart
    }

    /// Looks at the samples of a rectangle whose sides are those of blocks, row by row.
    pub fn look(&self, rect: Rect, heights: &[f64]) -> Glance {
        let Blocks { side, whole, .. } = self.blocks;
        let mut means = Means::new(whole);
        for (row, line) in (rect.row..).zip(heights.chunks(rect.width as usize)) {
            means.add(rect.col, row, line);
        }
        let mut blocks = Vec::new();
        for row in (0..rect.height).step_by(side as usize) {
            for col in (0..rect.width).step_by(side as usize) {
                let size = [side.min(rect.width - col), side.min(rect.height - row)];
                let from = &heights[row as usize * rect.width as usize + col as usize..];
                blocks.push(Block::of(from, rect.width as usize, size.map(|side| side as usize)));
            }
        }
        let valid = || heights.iter().copied().filter(|height| height.is_finite());
        let range = valid().map(|height| [height; 2]).reduce(both);
        let width = rect.width as usize;
        let line = |axis: usize, (line, part): (u32, Range<usize>)| {
            let at = |along: u32| {
                let [col, row] = if axis == 0 { [line, along] } else { [along, line] };
                heights[(row - rect.row) as usize * width + (col - rect.col) as usize]
            };
            let heights = match &self.lines[axis][&line] {
                None => part.map(|along| at(along as u32)).collect(),
                Some(spots) => spots[part].iter().map(|along| at(*along)).collect(),
            };
            (line, heights)
        };
        let lines =
            [0, 1].map(|axis| self.within(axis, rect).map(|found| line(axis, found)).collect());
        Glance { rect, blocks, lines, means, range }
    }

    /// Bytes that what is seen of the whole grid takes.
    pub fn bytes(&self) -> u64 {
        let Blocks { counts, .. } = self.blocks;
        let blocks = u64::from(counts[0]) * u64::from(counts[1]) * size_of::<Block>() as u64;
        let line = |axis: usize| {
            let bytes = |spots: &Option<Vec<u32>>| {
                let number = if spots.is_some() { size_of::<u32>() } else { 0 };
                self.len(axis, spots) * (size_of::<f64>() + number)
            };
            self.lines[axis].values().map(bytes).sum::<usize>() as u64
        };
        blocks + line(0) + line(1) + Means::BYTES + self.chart.bytes()
    }

    /// Nothing seen yet.
    pub fn gather(self) -> Gathered {
        let Blocks { counts, whole, .. } = self.blocks;
        let blocks = vec![Block::default(); counts[0] as usize * counts[1] as usize];
        let line = |axis: usize| {
            let empty = |(at, spots): (&u32, _)| (*at, vec![f64::NAN; self.len(axis, spots)]);
            self.lines[axis].iter().map(empty).collect()
        };
        let (lines, means) = ([line(0), line(1)], Means::new(whole));
        Gathered { plan: self, blocks, lines, means, range: None }
    }
}

/// What was seen so far, whatever the order.
#[derive(Clone, Debug)]
pub struct Gathered {
    plan: Plan,
    blocks: Vec<Block>,
    lines: [BTreeMap<u32, Vec<f64>>; 2],
    means: Means,
    range: Option<[f64; 2]>,
}

impl Gathered {
    /// What is looked at.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Adds what was seen in a rectangle.
    pub fn add(&mut self, glance: Glance) {
        let Blocks { side, counts, .. } = self.plan.blocks;
        let Rect { col, row, width, .. } = glance.rect;
        let across = width.div_ceil(side) as usize;
        for (i, block) in glance.blocks.into_iter().enumerate() {
            let [x, y] = [col / side, row / side].map(|at| at as usize);
            self.blocks[(y + i / across) * counts[0] as usize + x + i % across] = block;
        }
        for axis in 0..2 {
            for (at, part) in self.plan.within(axis, glance.rect) {
                if let (Some(line), Some(heights)) =
                    (self.lines[axis].get_mut(&at), glance.lines[axis].get(&at))
                {
                    line[part].copy_from_slice(heights);
                }
            }
        }
        self.means.join(&glance.means);
        self.range = self.range.into_iter().chain(glance.range).reduce(both);
    }

    /// The grid from afar, once all was seen; `None` where all of it is void.
    pub fn finish(self) -> Option<Overview> {
        let Self { plan, blocks, lines, means, range } = self;
        Some(Overview { plan, blocks, lines, fill: means.fill()?, range: range? })
    }
}

/// Metres between two samples beside each other, at the most.
fn jump(heights: &[f64], stride: usize, [width, height]: [usize; 2]) -> f64 {
    let mut most = 0.0_f64;
    for row in 0..height {
        let line = &heights[row * stride..][..width];
        let across = line.windows(2).map(|two| (two[1] - two[0]).abs());
        // What is void compares as no number does.
        most = across.fold(most, f64::max);
        if row > 0 {
            let above = &heights[(row - 1) * stride..][..width];
            most = line.iter().zip(above).map(|(a, b)| (a - b).abs()).fold(most, f64::max);
        }
    }
    most
}

fn both(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Metres of a degree along the equator, about.
const DEGREE: f64 = 111_000.0;

/// How samples lie to a rectangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lie {
    /// None is in it.
    Beside,
    /// All are.
    Within,
    /// That is not known.
    Across,
}

/// A grid from afar.
#[derive(Clone, Debug)]
pub struct Overview {
    plan: Plan,
    blocks: Vec<Block>,
    lines: [BTreeMap<u32, Vec<f64>>; 2],
    fill: Fill,
    /// Metres of the lowest and the highest sample.
    pub range: [f64; 2],
}

impl Overview {
    /// How the grid is divided.
    pub fn plan(&self) -> &Blocks {
        &self.plan.blocks
    }

    /// What stands for voids.
    pub fn voids(&self) -> &Fill {
        &self.fill
    }

    /// A block, by column and row of blocks.
    pub fn block(&self, [col, row]: [u32; 2]) -> &Block {
        &self.blocks[row as usize * self.plan.blocks.counts[0] as usize + col as usize]
    }

    /// The first and the last column and row of blocks with samples in a rectangle, the last ones excluded.
    pub fn blocks_in(&self, bounds: &Bounds) -> [[u32; 2]; 2] {
        let ends = self.plan.chart.range(bounds);
        let side = f64::from(self.plan.blocks.side);
        [0, 1].map(|axis: usize| {
            let [low, high] = ends[axis];
            let count = f64::from(self.plan.blocks.counts[axis]);
            // A sample more on each side, as places are rounded.
            let first = ((low - 1.0) / side).floor().clamp(0.0, count);
            let end = ((high + 1.0) / side).floor() + 1.0;
            [first as u32, end.clamp(first, count) as u32]
        })
    }

    /// The corners of a block's samples, on its plane.
    pub fn corners(&self, at: [u32; 2]) -> [Sample; 4] {
        let rect = self.plan.blocks.rect(at);
        let ends = [[0, 0], [1, 0], [1, 1], [0, 1]];
        ends.map(|[right, down]| {
            let offset = [right * (rect.width - 1), down * (rect.height - 1)].map(f64::from);
            let at_grid = [f64::from(rect.col) + offset[0], f64::from(rect.row) + offset[1]];
            self.plan.chart.sample(at_grid, self.block(at).height(offset))
        })
    }

    /// How the samples of a block, whose corners are given, lie to a rectangle.
    pub fn lie(&self, at: [u32; 2], corners: &[Sample; 4], bounds: &Bounds) -> Lie {
        let holds = |bounds: &Bounds| corners.iter().all(|corner| bounds.holds(corner.place));
        if !self.plan.chart.is_bent() {
            return if holds(bounds) { Lie::Within } else { Lie::Across };
        }
        // What bows out of a block is beyond its corners; meridians are the nearer to each other the further north.
        let furthest = corners.iter().fold(0.0_f64, |most, corner| most.max(corner.place[1].abs()));
        let slack = self.bow(at) / DEGREE / furthest.to_radians().cos().max(1e-3);
        let Bounds { west, south, east, north } = bounds.grown(slack);
        let all = |is: &dyn Fn([f64; 2]) -> bool| corners.iter().all(|corner| is(corner.place));
        let is_beside = all(&|[lon, _]| lon < west)
            || all(&|[lon, _]| lon > east)
            || all(&|[_, lat]| lat < south)
            || all(&|[_, lat]| lat > north);
        match is_beside {
            true => Lie::Beside,
            false if holds(&bounds.grown(-slack)) => Lie::Within,
            false => Lie::Across,
        }
    }

    /// Metres that a block's samples are from a flat surface through its corners, at the most, beside the heights;
    /// nothing where columns are meridians.
    pub fn bow(&self, at: [u32; 2]) -> f64 {
        let rect = self.plan.blocks.rect(at);
        let ends = [[rect.col, rect.row], [rect.end_col() - 1, rect.end_row() - 1]];
        let [first, last] = ends.map(|end| end.map(f64::from));
        self.plan.chart.bow(first, last)
    }
}

impl Overview {
    /// The height between samples, or on a block's plane.
    fn at(&self, Spot { at: [col, row], .. }: Spot) -> Option<f64> {
        if let Ok(found) = self.kept([col, row]) {
            return found;
        }
        let side = f64::from(self.plan.blocks.side);
        let at = [(col / side) as u32, (row / side) as u32];
        let block = self.block(at);
        let [low, high] = self.range;
        let offset = [col - f64::from(at[0]) * side, row - f64::from(at[1]) * side];
        (block.count > 0).then(|| block.height(offset).clamp(low, high))
    }

    fn between(&self, spot: Spot) -> f64 {
        let is_kept = around(spot.at).all(|(at, _)| self.sample(at).is_some());
        match if is_kept { None } else { self.at(spot) } {
            Some(height) => height,
            None => between(spot.at, &self.fill, |at| self.sample(at).filter(|z| z.is_finite())),
        }
    }
}

impl Ground for Overview {
    /// Exact along the lines that were kept; elsewhere that of the block's plane.
    fn height(&self, place: [f64; 2]) -> Option<f64> {
        let spot = self.plan.chart.within(place);
        self.at(spot).map(|height| spot.lower(height))
    }

    /// Between samples that are kept; elsewhere as the height is.
    fn filled(&self, place: [f64; 2]) -> f64 {
        let spot = self.plan.chart.within(place);
        spot.lower(self.between(spot))
    }

    fn beyond(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let spot = self.plan.chart.within(place);
        (spot.fall > 0.0).then(|| [self.between(spot), spot.fall])
    }

    fn feet(&self, bounds: &Bounds, stride: u32, found: &mut impl FnMut(Sample)) {
        let [width, height] = self.plan.blocks.whole;
        feet(self, (&self.plan.chart, Rect::new(0, 0, width, height)), (bounds, stride), found);
    }

    fn bends(&self, [from, to]: [[f64; 2]; 2], found: &mut impl FnMut([f64; 2], Option<f64>)) {
        let mut stop = |place: [f64; 2]| {
            let spot = self.plan.chart.within(place);
            if let Ok(height) = self.kept(spot.at) {
                found(place, height.map(|height| spot.lower(height)));
            }
        };
        let Some(map) = self.plan.chart.map() else {
            return self.plan.chart.stops([from, to], &mut stop);
        };
        let axis = usize::from(from[0] == to[0]);
        let ends = [from, to].map(|end| beside(map, end)[axis]);
        let most = f64::from(self.plan.blocks.whole[axis] - 1);
        let first = ends[0].min(ends[1]).ceil().max(0.0);
        let last = ends[0].max(ends[1]).floor().min(most);
        let mut index = first;
        while index <= last {
            let mut place = from;
            place[axis] = map.apply(index, index)[axis];
            stop(place);
            index += 1.0;
        }
    }

    /// Of each block the samples furthest from its plane.
    fn runs(&self, bounds: &Bounds, _: u32, found: &mut impl FnMut(Run<'_>)) {
        let [cols, rows] = self.blocks_in(bounds);
        for row in rows[0]..rows[1] {
            for col in cols[0]..cols[1] {
                let block = self.block([col, row]);
                let rect = self.plan.blocks.rect([col, row]);
                let ends = &block.ends[..if block.count > 0 { 2 } else { 0 }];
                for Extreme { at: [right, down], height, .. } in ends {
                    let at =
                        [rect.col + u32::from(*right), rect.row + u32::from(*down)].map(f64::from);
                    let sample = self.plan.chart.sample(at, *height);
                    if bounds.holds(sample.place) {
                        found(Run::One(sample));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use terrane_base::geom::Affine;

    const MAP: Affine = Affine { x0: 7.0, a: 0.01, b: 0.0, y0: 46.0, d: 0.0, e: -0.01 };

    fn overview(
        whole: [u32; 2],
        heights: &[f64],
        lines: [&[f64]; 2],
        pieces: u32,
    ) -> Option<Overview> {
        let plan = Plan::new(Chart::straight(MAP, whole), lines);
        let rows = plan.blocks.side * pieces;
        let look = |row: u32| {
            let rect = Rect::new(0, row, whole[0], rows.min(whole[1] - row));
            let from = row as usize * whole[0] as usize;
            plan.look(rect, &heights[from..][..rect.len()])
        };
        let mut gathered = plan.clone().gather();
        for glance in (0..whole[1]).step_by(rows as usize).map(look) {
            // As it is kept and read again.
            let mut kept = Vec::new();
            glance.write(&mut kept);
            assert!(plan.read_glance(&mut &kept[..kept.len() - 1]).is_none());
            let mut left = &kept[..];
            let back = plan.read_glance(&mut left).unwrap();
            let most = plan.written_bytes(glance.rect);
            let is_whole = heights.iter().all(|height| height.is_finite());
            assert!(kept.len() as u64 <= most && (!is_whole || kept.len() as u64 == most));
            assert!(left.is_empty() && format!("{back:?}") == format!("{glance:?}"));
            gathered.add(back);
        }
        gathered.finish()
    }

    proptest! {
        #[test]
        fn no_sample_is_further_from_its_plane_than_told(
            size in (1_u32..70, 1_u32..70), seed: u32, voids in 0_u32..5, relief in 0.0..1e4_f64,
        ) {
            let whole = [size.0, size.1];
            let noise = |i: u32| (i ^ seed).wrapping_mul(0x9e37_79b9) >> 8;
            let height = |i: u32| match noise(i) % 8 < voids {
                true => f64::NAN,
                false => f64::from(noise(i)) / 16_777_216.0 * relief + f64::from(i % whole[0]) * 3.0,
            };
            let heights: Vec<f64> = (0..whole[0] * whole[1]).map(height).collect();
            let found = overview(whole, &heights, [&[7.123], &[45.77]], 1);
            prop_assert_eq!(found.is_none(), heights.iter().all(|z| z.is_nan()));
            let Some(found) = found else { return Ok(()) };
            let mut count = 0;
            for (i, z) in heights.iter().enumerate().filter(|(_, z)| z.is_finite()) {
                let [col, row] = [i as u32 % whole[0], i as u32 / whole[0]];
                let at = [col / 16, row / 16];
                let offset = [col % 16, row % 16].map(f64::from);
                let block = found.block(at);
                prop_assert!((z - block.height(offset)).abs() <= block.off());
                prop_assert!(found.range[0] <= *z && *z <= found.range[1]);
                count += 1;
            }
            prop_assert_eq!(count, found.blocks.iter().map(|block| block.count).sum::<u32>());
            let other = overview(whole, &heights, [&[7.123], &[45.77]], 2).unwrap();
            prop_assert_eq!(&found.blocks, &other.blocks);
            prop_assert_eq!(&found.fill, &other.fill);
        }
    }

    #[test]
    fn a_void_part_comes_back_void() {
        let plan = Plan::new(Chart::straight(MAP, [20, 20]), [&[], &[]]);
        let glance = plan.look(Rect::new(0, 0, 20, 20), &[f64::NAN; 400]);
        let mut kept = Vec::new();
        glance.write(&mut kept);
        let back = plan.read_glance(&mut &kept[..]).unwrap();
        assert!(back.range.is_none() && back.blocks == glance.blocks);
        let mut gathered = plan.gather();
        gathered.add(back);
        assert!(gathered.finish().is_none());
    }

    #[test]
    fn along_lines_heights_are_those_of_the_grid() {
        let heights: Vec<f64> =
            (0..5000_u32).map(|i| f64::from(i.wrapping_mul(7919) % 997)).collect();
        let lines: [&[f64]; 2] = [&[7.2345, 7.3, 12.0], &[45.7, 45.8123]];
        let found = overview([100, 50], &heights, lines, 1).unwrap();
        let chart = Chart::straight(MAP, [100, 50]);
        let patch = crate::Patch::new(&heights, Rect::new(0, 0, 100, 50), &chart, &found.fill);
        for ends in [
            [[7.2345, 45.6], [7.2345, 45.9]],
            [[7.1, 45.8123], [7.9, 45.8123]],
            [[7.3, 45.5], [7.3, 46.5]],
        ] {
            let (mut far, mut near) = (Vec::new(), Vec::new());
            found.bends(ends, &mut |place, height| far.push((place, height)));
            patch.bends(ends, &mut |place, height| near.push((place, height)));
            assert!(far.len() > 20);
            assert_eq!(far.len(), near.len());
            for (far, near) in far.iter().zip(&near) {
                assert!((far.1.unwrap() - near.1.unwrap()).abs() < 1e-6, "{far:?} {near:?}");
            }
        }
        assert_eq!(found.height([7.2345, 47.0]), found.height([7.2345, 46.0]), "its edge goes on");
    }
}
