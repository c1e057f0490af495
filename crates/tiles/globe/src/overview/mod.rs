//! Overview of the ground: a plane for each block of samples with the distances of the samples, for levels
//! whose tiles have too many samples; and the samples along the borders of these tiles.

mod blocks;
mod bytes;
mod lines;
mod plan;
mod relief;

use std::collections::BTreeMap;

use crate::georeference::GlobePosition;
use crate::sample_run::{TerrainSample, TerrainSampleRun};
use crate::terrain::{TerrainSampler, VoidFill, around, between, feet};
use crate::tiling::GeodeticBounds;
use blocks::BlockExtreme;
pub use blocks::{SampleBlock, SampleBlocks};
use lines::snapped;
pub use plan::{BlockSummary, GatheredOverview, OverviewPlan};
use terrane_base::geom::Rect;

/// Metres of a degree along the equator, about.
const DEGREE: f64 = 111_000.0;

/// Position of samples relative to a rectangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RectRelation {
    /// None inside.
    Beside,
    /// All inside.
    Within,
    /// Unknown.
    Across,
}

/// Overview of a grid.
#[derive(Clone, Debug)]
pub struct GridOverview {
    plan: OverviewPlan,
    blocks: Vec<SampleBlock>,
    lines: [BTreeMap<u32, Vec<f64>>; 2],
    fill: VoidFill,
    /// Lowest and highest sample in metres.
    pub range: [f64; 2],
}

impl GatheredOverview {
    /// The overview after the first pass; `None` if all samples are void.
    pub fn finish(self) -> Option<GridOverview> {
        let Self { plan, blocks, lines, means, range } = self;
        Some(GridOverview { plan, blocks, lines, fill: means.fill()?, range: range? })
    }
}

impl GridOverview {
    /// Division into blocks.
    pub fn plan(&self) -> &SampleBlocks {
        &self.plan.blocks
    }

    /// Fill of voids.
    pub fn voids(&self) -> &VoidFill {
        &self.fill
    }

    /// Block by column and row of blocks.
    pub fn block(&self, [col, row]: [u32; 2]) -> &SampleBlock {
        &self.blocks[row as usize * self.plan.blocks.counts[0] as usize + col as usize]
    }

    /// Range of columns and rows of blocks with samples in a rectangle, ends excluded.
    pub fn blocks_in(&self, bounds: &GeodeticBounds) -> [[u32; 2]; 2] {
        let ends = self.plan.chart.range(bounds);
        let side = f64::from(self.plan.blocks.side);
        [0, 1].map(|axis: usize| {
            let [low, high] = ends[axis];
            let count = f64::from(self.plan.blocks.counts[axis]);
            // One more sample on each side, because positions are rounded.
            let first = ((low - 1.0) / side).floor().clamp(0.0, count);
            let end = ((high + 1.0) / side).floor() + 1.0;
            [first as u32, end.clamp(first, count) as u32]
        })
    }

    /// Corners of a block's samples on its plane.
    pub fn corners(&self, at: [u32; 2]) -> [TerrainSample; 4] {
        let rect = self.plan.blocks.rect(at);
        let ends = [[0, 0], [1, 0], [1, 1], [0, 1]];
        ends.map(|[right, down]| {
            let offset = [right * (rect.width - 1), down * (rect.height - 1)].map(f64::from);
            let at_grid = [f64::from(rect.col) + offset[0], f64::from(rect.row) + offset[1]];
            self.plan.chart.sample(at_grid, self.block(at).height(offset))
        })
    }

    /// Position of a block's samples, given by its corners, relative to a rectangle.
    pub fn lie(
        &self,
        at: [u32; 2],
        corners: &[TerrainSample; 4],
        bounds: &GeodeticBounds,
    ) -> RectRelation {
        let places = corners.each_ref().map(|corner| corner.place);
        if !self.plan.chart.is_bent() {
            let is_within = places.iter().all(|place| bounds.holds(*place));
            return if is_within { RectRelation::Within } else { RectRelation::Across };
        }
        // Parts of a block may bulge beyond its corners; meridians converge towards the poles.
        let furthest = places.iter().fold(0.0_f64, |max, [_, lat]| max.max(lat.abs()));
        let slack = self.bow(at) / DEGREE / furthest.to_radians().cos().max(1e-3);
        let GeodeticBounds { west, south, east, north } = bounds.grown(slack);
        let is_beside = places.iter().all(|[lon, _]| *lon < west)
            || places.iter().all(|[lon, _]| *lon > east)
            || places.iter().all(|[_, lat]| *lat < south)
            || places.iter().all(|[_, lat]| *lat > north);
        let inner = bounds.grown(-slack);
        match is_beside {
            true => RectRelation::Beside,
            false if places.iter().all(|place| inner.holds(*place)) => RectRelation::Within,
            false => RectRelation::Across,
        }
    }

    /// Largest distance of a block's samples from a flat surface through its corners in metres, without
    /// heights; 0 where columns are meridians.
    pub fn bow(&self, at: [u32; 2]) -> f64 {
        let rect = self.plan.blocks.rect(at);
        let ends = [[rect.col, rect.row], [rect.end_col() - 1, rect.end_row() - 1]];
        let [first, last] = ends.map(|end| end.map(f64::from));
        self.plan.chart.bow(first, last)
    }
}

impl GridOverview {
    /// Interpolated height from stored samples; `Err` if they are not stored.
    fn stored(&self, [col, row]: [f64; 2]) -> Result<Option<f64>, ()> {
        match self.plan.chart.map() {
            Some(_) => self.on_line([col, row]),
            None => self.on_spots([col, row]),
        }
    }

    /// Height at a position, from stored samples.
    fn stored_height(&self, place: [f64; 2]) -> Result<Option<f64>, ()> {
        let spot = self.plan.chart.within(place);
        self.stored(spot.at).map(|height| height.map(|height| spot.lower(height)))
    }

    /// A stored sample, NaN if void; `None` if not stored.
    fn sample(&self, at: [u32; 2]) -> Option<f64> {
        (0..2).find_map(|axis| {
            let (line, along) = (at[axis], at[1 - axis]);
            let heights = self.lines[axis].get(&line)?;
            match self.plan.lines[axis].get(&line)? {
                None => heights.get(along as usize).copied(),
                Some(spots) => spots.binary_search(&along).ok().map(|spot| heights[spot]),
            }
        })
    }

    /// Interpolated height from samples of two rows.
    fn on_spots(&self, at: [f64; 2]) -> Result<Option<f64>, ()> {
        let mut sum = 0.0;
        for (at, part) in around(at) {
            sum += part * self.sample(at).ok_or(())?;
        }
        Ok(sum.is_finite().then_some(sum))
    }

    /// Height on a stored column or row; `Err` for others.
    fn on_line(&self, [col, row]: [f64; 2]) -> Result<Option<f64>, ()> {
        for (axis, [across, along]) in [(0, [col, row]), (1, [row, col])] {
            let first = across as u32;
            let part = across - f64::from(first);
            let next = first + u32::from(part > 0.0);
            let [Some(a), Some(b)] = [first, next].map(|at| self.lines[axis].get(&at)) else {
                continue;
            };
            let height = match part > 0.0 {
                true => height_on(a, along) * (1.0 - part) + height_on(b, along) * part,
                false => height_on(a, along),
            };
            return Ok(height.is_finite().then_some(height));
        }
        Err(())
    }
}

/// Height between two samples of a column or row.
fn height_on(line: &[f64], along: f64) -> f64 {
    let at = along as usize;
    let part = along - at as f64;
    // On a sample it alone counts: the next one may be void, or missing.
    if part > 0.0 { line[at] * (1.0 - part) + line[at + 1] * part } else { line[at] }
}

impl GridOverview {
    /// Height from samples, or on a block's plane.
    fn at(&self, GlobePosition { at: [col, row], .. }: GlobePosition) -> Option<f64> {
        if let Ok(height) = self.stored([col, row]) {
            return height;
        }
        let side = f64::from(self.plan.blocks.side);
        let at = [(col / side) as u32, (row / side) as u32];
        let block = self.block(at);
        let [low, high] = self.range;
        let offset = [col - f64::from(at[0]) * side, row - f64::from(at[1]) * side];
        (block.count > 0).then(|| block.height(offset).clamp(low, high))
    }

    fn between(&self, spot: GlobePosition) -> f64 {
        let is_stored = around(spot.at).all(|(at, _)| self.sample(at).is_some());
        match if is_stored { None } else { self.at(spot) } {
            Some(height) => height,
            None => between(spot.at, &self.fill, |at| self.sample(at).filter(|z| z.is_finite())),
        }
    }
}

impl TerrainSampler for GridOverview {
    /// Exact along stored lines; elsewhere the height of the block's plane.
    fn height(&self, place: [f64; 2]) -> Option<f64> {
        let spot = self.plan.chart.within(place);
        self.at(spot).map(|height| spot.lower(height))
    }

    /// From stored samples; elsewhere as the height.
    fn filled(&self, place: [f64; 2]) -> f64 {
        let spot = self.plan.chart.within(place);
        spot.lower(self.between(spot))
    }

    fn beyond(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let spot = self.plan.chart.within(place);
        (spot.fall > 0.0).then(|| [self.between(spot), spot.fall])
    }

    fn feet(&self, bounds: &GeodeticBounds, stride: u32, found: &mut impl FnMut(TerrainSample)) {
        let [width, height] = self.plan.blocks.size;
        feet(self, &self.plan.chart, Rect::new(0, 0, width, height), bounds, stride, found);
    }

    fn bends(&self, [from, to]: [[f64; 2]; 2], found: &mut impl FnMut([f64; 2], Option<f64>)) {
        let Some(map) = self.plan.chart.map() else {
            return self.plan.chart.stops([from, to], &mut |place| {
                if let Ok(height) = self.stored_height(place) {
                    found(place, height);
                }
            });
        };
        let axis = usize::from(from[0] == to[0]);
        let ends = [from, to].map(|end| snapped(map, end)[axis]);
        let max = f64::from(self.plan.blocks.size[axis] - 1);
        let first = ends[0].min(ends[1]).ceil().max(0.0);
        let last = ends[0].max(ends[1]).floor().min(max);
        let mut index = first;
        while index <= last {
            let mut place = from;
            place[axis] = map.apply(index, index)[axis];
            if let Ok(height) = self.stored_height(place) {
                found(place, height);
            }
            index += 1.0;
        }
    }

    /// Samples of each block furthest from its plane.
    fn runs(&self, bounds: &GeodeticBounds, _: u32, found: &mut impl FnMut(TerrainSampleRun<'_>)) {
        let [cols, rows] = self.blocks_in(bounds);
        for row in rows[0]..rows[1] {
            for col in cols[0]..cols[1] {
                let block = self.block([col, row]);
                let rect = self.plan.blocks.rect([col, row]);
                let ends = &block.ends[..if block.count > 0 { 2 } else { 0 }];
                for BlockExtreme { at: [right, down], height, .. } in ends {
                    let at =
                        [rect.col + u32::from(*right), rect.row + u32::from(*down)].map(f64::from);
                    let sample = self.plan.chart.sample(at, *height);
                    if bounds.holds(sample.place) {
                        found(TerrainSampleRun::One(sample));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::georeference::GridGeolocation;
    use proptest::prelude::*;
    use terrane_base::geom::Affine;

    const MAP: Affine = Affine { x0: 7.0, a: 0.01, b: 0.0, y0: 46.0, d: 0.0, e: -0.01 };

    fn overview(
        whole: [u32; 2],
        heights: &[f64],
        lines: [&[f64]; 2],
        pieces: u32,
    ) -> Option<GridOverview> {
        let plan = OverviewPlan::new(GridGeolocation::straight(MAP, whole), lines);
        let rows = plan.blocks.side * pieces;
        let look = |row: u32| {
            let rect = Rect::new(0, row, whole[0], rows.min(whole[1] - row));
            let from = row as usize * whole[0] as usize;
            plan.summarize(rect, &heights[from..][..rect.len()])
        };
        let mut gathered = plan.clone().gather();
        for summary in (0..whole[1]).step_by(rows as usize).map(look) {
            // As it is kept and read again.
            let mut kept = Vec::new();
            summary.write(&mut kept);
            assert!(plan.read_summary(&mut &kept[..kept.len() - 1]).is_none());
            let mut left = &kept[..];
            let back = plan.read_summary(&mut left).unwrap();
            let most = plan.written_bytes(summary.rect);
            let is_whole = heights.iter().all(|height| height.is_finite());
            assert!(kept.len() as u64 <= most && (!is_whole || kept.len() as u64 == most));
            assert!(left.is_empty() && format!("{back:?}") == format!("{summary:?}"));
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
        let plan = OverviewPlan::new(GridGeolocation::straight(MAP, [20, 20]), [&[], &[]]);
        let summary = plan.summarize(Rect::new(0, 0, 20, 20), &[f64::NAN; 400]);
        let mut kept = Vec::new();
        summary.write(&mut kept);
        let back = plan.read_summary(&mut &kept[..]).unwrap();
        assert!(back.range.is_none() && back.blocks == summary.blocks);
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
        let chart = GridGeolocation::straight(MAP, [100, 50]);
        let patch =
            crate::HeightPatch::new(&heights, Rect::new(0, 0, 100, 50), &chart, &found.fill);
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
