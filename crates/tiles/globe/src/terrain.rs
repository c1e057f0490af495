//! The ground of tiles: samples of a grid, interpolation, and fill of voids.

use std::collections::BTreeMap;

use crate::georeference::{GlobePosition, GridGeolocation};
use crate::globe::EllipsoidNormal;
use crate::sample_run::{
    SampleMeridian, SampleParallel, SampleRow, TerrainSample, TerrainSampleRun,
};
use crate::tiling::GeodeticBounds;
use terrane_base::geom::{Affine, Rect};

/// Access to the ground. All results depend only on grid and position, so that neighbouring tiles agree on a
/// border.
pub trait TerrainSampler {
    /// Interpolated height from the four surrounding samples; `None` if one of them is void. Beyond the grid
    /// the edge continues, or descends.
    fn height(&self, place: [f64; 2]) -> Option<f64>;

    /// The same with voids: the fill is used as their height. So the surface is continuous between samples and
    /// voids, and linear along meridians and parallels of samples.
    fn filled(&self, place: [f64; 2]) -> f64;

    /// Passes on breaks of the ground along the straight line between two positions on one meridian or
    /// parallel, with heights as from [`height`](Self::height): linear in between.
    fn bends(&self, ends: [[f64; 2]; 2], found: &mut impl FnMut([f64; 2], Option<f64>));

    /// Beyond a grid where heights descend: the height at the nearest position on the edge, and the descent in
    /// metres.
    fn beyond(&self, place: [f64; 2]) -> Option<[f64; 2]>;

    /// Passes on positions in a rectangle where the ground beyond the grid reaches the ellipsoid, one per
    /// `stride` samples of the edge.
    fn feet(&self, bounds: &GeodeticBounds, stride: u32, found: &mut impl FnMut(TerrainSample));

    /// Passes on every `stride`-th sample in a rectangle, border included, near samples in sequence.
    fn runs(
        &self,
        bounds: &GeodeticBounds,
        stride: u32,
        found: &mut impl FnMut(TerrainSampleRun<'_>),
    );

    /// The same for valid samples, one by one.
    fn each(&self, bounds: &GeodeticBounds, stride: u32, found: &mut impl FnMut(TerrainSample)) {
        self.runs(bounds, stride, &mut |run| run.each(found));
    }
}

/// A rectangle of heights of a grid.
#[derive(Clone, Debug)]
pub struct HeightPatch<'a> {
    heights: &'a [f64],
    rect: Rect,
    chart: &'a GridGeolocation,
    places: PatchPositions,
    fill: &'a VoidFill,
}

/// Positions of a patch's samples.
#[derive(Clone, Debug)]
enum PatchPositions {
    /// Where columns are meridians and rows parallels.
    Straight { cols: Vec<SampleMeridian>, rows: Vec<SampleParallel> },
    /// Computed once, row by row.
    Cached(Vec<([f64; 2], EllipsoidNormal)>),
    /// Computed on request.
    OnDemand,
}

impl<'a> HeightPatch<'a> {
    /// Memory in bytes per sample for cached positions.
    pub const PLACE_BYTES: u64 = size_of::<([f64; 2], EllipsoidNormal)>() as u64;

    /// Heights of `rect`, row by row, NaN for voids.
    pub fn new(
        heights: &'a [f64],
        rect: Rect,
        chart: &'a GridGeolocation,
        fill: &'a VoidFill,
    ) -> Self {
        debug_assert_eq!(heights.len(), rect.len());
        let places = match chart.map() {
            None => PatchPositions::OnDemand,
            Some(map) => {
                let cols = (rect.col..rect.col + rect.width).map(|col| longitude(map, col));
                let rows = (rect.row..rect.row + rect.height).map(|row| latitude(map, row));
                PatchPositions::Straight {
                    cols: cols.map(SampleMeridian::new).collect(),
                    rows: rows.map(SampleParallel::new).collect(),
                }
            }
        };
        Self { heights, rect, chart, places, fill }
    }

    /// The same with cached positions.
    #[must_use]
    pub fn with_positions(mut self) -> Self {
        if matches!(self.places, PatchPositions::OnDemand) {
            let Rect { col, row, width, height } = self.rect;
            let all =
                (row..row + height).flat_map(|row| (col..col + width).map(move |col| [col, row]));
            let samples = all.map(|at| self.chart.sample(at.map(f64::from), 0.0));
            let places = samples.map(|sample| (sample.place, sample.upright)).collect();
            self.places = PatchPositions::Cached(places);
        }
        self
    }

    /// True if a rectangle, border included, contains a valid sample.
    pub fn holds_any(&self, bounds: &GeodeticBounds) -> bool {
        let [[left, right], [top, bottom]] = self.ranges(bounds);
        // The ranges of columns and rows are exact where these are meridians and parallels.
        let is_exact = self.chart.map().is_some();
        let mut all = (top..bottom).flat_map(|row| (left..right).map(move |col| (col, row)));
        all.any(|(col, row)| {
            self.at(col, row).is_some()
                && (is_exact || bounds.holds(self.sample(col, row, 0.0).place))
        })
    }

    /// A sample of the patch.
    fn sample(&self, col: u32, row: u32, height: f64) -> TerrainSample {
        let [along, down] = [col - self.rect.col, row - self.rect.row].map(|at| at as usize);
        match &self.places {
            PatchPositions::Straight { cols, rows } => rows[down].sample(&cols[along], height),
            PatchPositions::Cached(places) => {
                let (place, upright) = places[down * self.rect.width as usize + along];
                TerrainSample { place, height, upright }
            }
            PatchPositions::OnDemand => self.chart.sample([col, row].map(f64::from), height),
        }
    }

    /// The height of a sample of the patch.
    fn at(&self, col: u32, row: u32) -> Option<f64> {
        let [col, row] = [col.checked_sub(self.rect.col)?, row.checked_sub(self.rect.row)?];
        if col >= self.rect.width || row >= self.rect.height {
            return None;
        }
        let height = self.heights[row as usize * self.rect.width as usize + col as usize];
        height.is_finite().then_some(height)
    }

    fn between(&self, spot: GlobePosition) -> f64 {
        between(spot.at, self.fill, |[col, row]| self.at(col, row))
    }

    /// Columns and rows of all samples in a rectangle, ends excluded; exact where rows are parallels.
    fn ranges(&self, bounds: &GeodeticBounds) -> [[u32; 2]; 2] {
        if let Some(map) = self.chart.map() {
            let GeodeticBounds { west, south, east, north } = *bounds;
            return [self.range(map, 0, [west, east]), self.range(map, 1, [south, north])];
        }
        let Rect { col, row, width, height } = self.rect;
        let [cols, rows] = self.chart.range(bounds);
        [(cols, col, width), (rows, row, height)].map(|([low, high], first, count)| {
            [(low - 1.0).floor(), (high + 2.0).ceil()].map(|at| clip(at, first, count))
        })
    }

    /// Samples along an axis from `low` to `high`, both included.
    fn range(&self, map: &Affine, axis: usize, [low, high]: [f64; 2]) -> [u32; 2] {
        let [first, count] = match axis {
            0 => [self.rect.col, self.rect.width],
            _ => [self.rect.row, self.rect.height],
        };
        let [a, b] = [low, high].map(|value| match axis {
            0 => map.invert(value, map.y0)[0],
            _ => map.invert(map.x0, value)[1],
        });
        let place = if axis == 0 { longitude } else { latitude };
        // Rounding may be off by one.
        let mut start = clip(a.min(b).floor() - 1.0, first, count);
        let mut end = clip(a.max(b).ceil() + 2.0, first, count).max(start);
        while start < end && !(low..=high).contains(&place(map, start)) {
            start += 1;
        }
        while start < end && !(low..=high).contains(&place(map, end - 1)) {
            end -= 1;
        }
        [start, end]
    }
}

/// Longitude of a column, where columns are meridians.
fn longitude(map: &Affine, col: u32) -> f64 {
    map.apply(f64::from(col), 0.0)[0]
}

/// Latitude of a row, where rows are parallels.
fn latitude(map: &Affine, row: u32) -> f64 {
    map.apply(0.0, f64::from(row))[1]
}

/// A column or row clipped to a patch; one past the last at most.
fn clip(at: f64, first: u32, count: u32) -> u32 {
    at.clamp(f64::from(first), f64::from(first + count)) as u32
}

impl TerrainSampler for HeightPatch<'_> {
    fn height(&self, place: [f64; 2]) -> Option<f64> {
        let (spot, mut sum) = (self.chart.within(place), 0.0);
        for ([col, row], part) in around(spot.at) {
            sum += part * self.at(col, row)?;
        }
        Some(spot.lower(sum))
    }

    fn filled(&self, place: [f64; 2]) -> f64 {
        let spot = self.chart.within(place);
        spot.lower(self.between(spot))
    }

    fn beyond(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let spot = self.chart.within(place);
        (spot.fall > 0.0).then(|| [self.between(spot), spot.fall])
    }

    fn feet(&self, bounds: &GeodeticBounds, stride: u32, found: &mut impl FnMut(TerrainSample)) {
        feet(self, self.chart, self.rect, bounds, stride, found);
    }

    fn bends(&self, [from, to]: [[f64; 2]; 2], found: &mut impl FnMut([f64; 2], Option<f64>)) {
        let Some(map) = self.chart.map() else {
            return self.chart.stops([from, to], &mut |place| found(place, self.height(place)));
        };
        let axis = usize::from(from[0] == to[0]);
        let [first, end] = self.range(map, axis, [from[axis], to[axis]]);
        for index in first..end {
            let mut place = from;
            // The map is not turned: each coordinate depends on its own index alone.
            place[axis] = map.apply(f64::from(index), f64::from(index))[axis];
            found(place, self.height(place));
        }
    }

    fn runs(
        &self,
        bounds: &GeodeticBounds,
        stride: u32,
        found: &mut impl FnMut(TerrainSampleRun<'_>),
    ) {
        let [[left, right], [top, bottom]] = self.ranges(bounds);
        let left = left.next_multiple_of(stride);
        if left >= right {
            return;
        }
        let [from, to] = [left, right].map(|col| (col - self.rect.col) as usize);
        for row in (top.next_multiple_of(stride)..bottom).step_by(stride as usize) {
            let down = (row - self.rect.row) as usize;
            let line = &self.heights[down * self.rect.width as usize..][from..to];
            if let PatchPositions::Straight { cols, rows } = &self.places {
                let (parallel, columns) = (rows[down], &cols[from..to]);
                found(TerrainSampleRun::Row(SampleRow {
                    parallel,
                    columns,
                    heights: line,
                    stride: stride as usize,
                }));
                continue;
            }
            let samples = (left..right).zip(line).step_by(stride as usize);
            for (col, height) in samples.filter(|(_, height)| height.is_finite()) {
                let sample = self.sample(col, row, *height);
                if bounds.holds(sample.place) {
                    found(TerrainSampleRun::One(sample));
                }
            }
        }
    }
}

/// Samples around a position in columns and rows with their weights; zero weights are omitted.
pub(crate) fn around([col, row]: [f64; 2]) -> impl Iterator<Item = ([u32; 2], f64)> {
    weighted(row).flat_map(move |(row, down)| {
        weighted(col).map(move |(col, along)| ([col, row], down * along))
    })
}

/// The two columns or rows around a position with their weights; zero weights are omitted.
#[inline]
fn weighted(at: f64) -> impl Iterator<Item = (u32, f64)> {
    let first = at as u32;
    let part = at - f64::from(first);
    // A sample that counts for nothing may be void, or beyond the last column.
    [(first, 1.0 - part), (first + 1, part)].into_iter().filter(|(_, part)| *part > 0.0)
}

/// Height at a position in columns and rows, from samples or fill.
pub(crate) fn between(
    at: [f64; 2],
    fill: &VoidFill,
    sample: impl Fn([u32; 2]) -> Option<f64>,
) -> f64 {
    around(at)
        .map(|(at, part)| part * sample(at).unwrap_or_else(|| fill.at(at.map(f64::from))))
        .sum()
}

/// Passes on, for every `stride`-th sample in `rect` at the edge of the grid, the position outside where the
/// ground reaches the ellipsoid.
pub(crate) fn feet(
    ground: &impl TerrainSampler,
    chart: &GridGeolocation,
    rect: Rect,
    bounds: &GeodeticBounds,
    stride: u32,
    found: &mut impl FnMut(TerrainSample),
) {
    if chart.slope() == 0.0 {
        return;
    }
    let parts = [rect.col..rect.end_col(), rect.row..rect.end_row()];
    for axis in 0..2 {
        let (ends, mut along) = (&parts[axis], parts[1 - axis].clone());
        // Where rows are parallels, these positions are on the meridian or parallel of their samples.
        if !chart.is_bent() {
            let [low, high] = chart.range(bounds)[1 - axis];
            let (first, end) = (low.floor().max(0.0) as u32, high.ceil().max(0.0) as u32 + 1);
            along = first.max(along.start)..end.min(along.end);
        }
        let last = chart.size()[axis] - 1;
        for (end, inwards) in
            [(0, 1.0), (last, -1.0)].into_iter().filter(|(at, _)| ends.contains(at))
        {
            let strided =
                (along.start.next_multiple_of(stride)..along.end).step_by(stride as usize);
            let last = along.end.checked_sub(1).filter(|last| along.contains(last));
            for along in strided.chain(last) {
                let mut at = [f64::from(end); 2];
                at[1 - axis] = f64::from(along);
                let far = ground.filled(chart.place(at)).abs() / chart.slope();
                let place = chart.outside(at, axis, inwards, far);
                if bounds.holds(place) {
                    found(TerrainSample::new(place, ground.filled(place)));
                }
            }
        }
    }
}

/// Fill of voids and of the area beyond the grid: means of cells of samples, and for cells without samples,
/// means of larger cells around. Always between the lowest and the highest sample.
#[derive(Clone, Debug, PartialEq)]
pub struct VoidFill {
    means: Vec<f64>,
    width: u32,
    height: u32,
    /// Samples along the side of a cell.
    cell: u32,
}

/// Nearest integer, inlined for 64-bit values.
#[inline(always)]
fn rounded(value: f64) -> i128 {
    let nearest = value.round();
    if nearest.abs() < 9.2e18 { i128::from(nearest as i64) } else { nearest as i128 }
}

/// Sums for a [`VoidFill`], independent of the order of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct VoidFillSums {
    /// By cell: sum in steps of 2^-20 m (independent of order), and count.
    sums: BTreeMap<u32, (i128, u64)>,
    width: u32,
    height: u32,
    cell: u32,
}

/// Largest number of cells along a side.
const MAX_CELLS: u32 = 128;
/// Step of summed heights.
const FRACTION: f64 = (1 << 20) as f64;

impl VoidFillSums {
    /// Largest memory in bytes, including the fill.
    pub(crate) const BYTES: u64 = (MAX_CELLS * MAX_CELLS) as u64 * 48;

    /// For a grid of this many columns and rows.
    pub fn new([width, height]: [u32; 2]) -> Self {
        let cell = width.max(height).div_ceil(MAX_CELLS).max(1);
        let [width, height] = [width, height].map(|side| side.div_ceil(cell));
        Self { sums: BTreeMap::new(), width, height, cell }
    }

    /// Adds a run of samples of a row; non-finite values are skipped.
    pub fn add(&mut self, first: u32, row: u32, heights: &[f64]) {
        let (mut col, mut left) = (first, heights);
        while !left.is_empty() {
            let here = (self.cell - col % self.cell).min(left.len() as u32);
            let (piece, rest) = left.split_at(here as usize);
            let (mut sum, mut count) = (0, 0);
            for height in piece.iter().filter(|height| height.is_finite()) {
                sum += rounded(height * FRACTION);
                count += 1;
            }
            self.sum(row / self.cell * self.width + col / self.cell, sum, count);
            (col, left) = (col + here, rest);
        }
    }

    fn sum(&mut self, cell: u32, sum: i128, count: u64) {
        if count > 0 {
            let here = self.sums.entry(cell).or_default();
            *here = (here.0 + sum, here.1 + count);
        }
    }

    /// Adds the sums of other samples of the same grid.
    pub fn join(&mut self, other: &Self) {
        other.sums().for_each(|(cell, sum, count)| self.sum(cell, sum, count));
    }

    /// Cells with samples in a rectangle.
    pub(crate) fn cells_in(&self, rect: Rect) -> u64 {
        let [across, down] =
            [(rect.col, rect.width), (rect.row, rect.height)].map(|(from, count)| match count {
                0 => 0,
                _ => u64::from((from + count - 1) / self.cell - from / self.cell) + 1,
            });
        across * down
    }

    /// Cells with their sums and counts.
    pub(crate) fn sums(&self) -> impl Iterator<Item = (u32, i128, u64)> {
        self.sums.iter().map(|(cell, (sum, count))| (*cell, *sum, *count))
    }

    /// Adds a sum; `None` for an invalid cell or sum.
    pub(crate) fn put(&mut self, cell: u32, sum: i128, count: u64) -> Option<()> {
        // Far below the range of the type, so that no merged sum overflows.
        let is_valid = cell < self.width * self.height && sum.unsigned_abs() >> 100 == 0;
        is_valid.then(|| self.sum(cell, sum, count))
    }

    /// The fill; `None` without samples.
    pub fn fill(&self) -> Option<VoidFill> {
        let cells = 0..self.width * self.height;
        let sums = cells.map(|cell| self.sums.get(&cell).copied().unwrap_or_default());
        let sums: Vec<_> = sums.collect();
        let means = filled(&sums, [self.width as usize, self.height as usize])?;
        Some(VoidFill { means, width: self.width, height: self.height, cell: self.cell })
    }
}

/// Means of sums; empty cells use sums of two by two cells.
fn filled(sums: &[(i128, u64)], [width, height]: [usize; 2]) -> Option<Vec<f64>> {
    if sums.iter().all(|(_, count)| *count > 0) {
        return Some(sums.iter().map(mean).collect());
    }
    if width == 1 && height == 1 {
        return None;
    }
    let [wide, high] = [width.div_ceil(2), height.div_ceil(2)];
    let mut fewer = vec![(0, 0); wide * high];
    for (i, (sum, count)) in sums.iter().enumerate() {
        let place = &mut fewer[i / width / 2 * wide + i % width / 2];
        *place = (place.0 + sum, place.1 + count);
    }
    let coarse = filled(&fewer, [wide, high])?;
    let means = sums.iter().enumerate().map(|(i, sum)| match sum.1 {
        0 => coarse[i / width / 2 * wide + i % width / 2],
        _ => mean(sum),
    });
    Some(means.collect())
}

/// Mean height of a sum and its count, in metres.
fn mean((sum, count): &(i128, u64)) -> f64 {
    *sum as f64 / *count as f64 / FRACTION
}

impl VoidFill {
    /// Range of the fill in a rectangle of samples.
    pub(crate) fn ends(&self, rect: Rect) -> [f64; 2] {
        let axes = [(rect.col, rect.width, self.width), (rect.row, rect.height, self.height)];
        // With the cells around, as heights are interpolated between them.
        let [cols, rows] = axes.map(|(first, count, cells)| {
            let last = (first + count - 1) / self.cell + 1;
            (first / self.cell).saturating_sub(1)..last.min(cells - 1) + 1
        });
        let all = rows.flat_map(|row| cols.clone().map(move |col| row * self.width + col));
        let means = all.map(|cell| self.means[cell as usize]);
        means.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], mean| {
            [low.min(mean), high.max(mean)]
        })
    }

    /// At a position in samples; beyond the grid as at its border.
    pub fn at(&self, place: [f64; 2]) -> f64 {
        let [cols, rows] = [(place[0], self.width), (place[1], self.height)].map(|(at, count)| {
            let at = ((at + 0.5) / f64::from(self.cell) - 0.5).clamp(0.0, f64::from(count - 1));
            let first = at.floor();
            [(first as u32, 1.0 - (at - first)), ((first as u32 + 1).min(count - 1), at - first)]
        });
        let sums = rows.map(|(row, down)| {
            let means =
                cols.map(|(col, part)| part * down * self.means[(row * self.width + col) as usize]);
            means.iter().sum::<f64>()
        });
        sums.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: Affine = Affine { x0: 7.0, a: 0.01, b: 0.0, y0: 46.0, d: 0.0, e: -0.01 };

    fn fill(value: f64) -> VoidFill {
        let mut means = VoidFillSums::new([50, 40]);
        means.add(0, 0, &[value]);
        means.fill().unwrap()
    }

    #[test]
    fn heights_between_samples_are_those_of_straight_lines() {
        let heights: Vec<f64> =
            (0..2000).map(|i| f64::from(i % 50) * 3.0 - f64::from(i / 50) * 2.0).collect();
        let fill = fill(5.0);
        let chart = GridGeolocation::straight(MAP, [50, 40]);
        let patch = HeightPatch::new(&heights, Rect::new(0, 0, 50, 40), &chart, &fill);
        for [col, row] in [[0.0, 0.0], [3.3, 7.8], [49.0, 39.0], [20.5, 0.0]] {
            let found = patch.height(MAP.apply(col, row)).unwrap();
            assert!((found - (col * 3.0 - row * 2.0)).abs() < 1e-9, "{col} {row}");
        }
        let edge = |col: f64, row: f64| patch.height(MAP.apply(col, row)).unwrap();
        assert!((edge(-7.5, 3.5) + 7.0).abs() < 1e-9, "beyond the grid its edge goes on");
        assert!((edge(60.0, 39.2) - 69.0).abs() < 1e-9);
        let mut bends = Vec::new();
        let [from, to] = [MAP.apply(7.25, 20.5), MAP.apply(7.25, 10.5)];
        patch.bends([from, to], &mut |[_, lat], height| bends.push((lat, height.unwrap())));
        assert_eq!(bends.len(), 10);
        for (lat, height) in bends {
            assert!((height - 21.75 + MAP.invert(0.0, lat)[1] * 2.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_part_of_a_grid_is_as_the_whole() {
        let heights: Vec<f64> = (0..2000).map(|i| f64::from(i * 7919 % 997)).collect();
        let fill = fill(5.0);
        let chart = GridGeolocation::straight(MAP, [50, 40]);
        let whole = HeightPatch::new(&heights, Rect::new(0, 0, 50, 40), &chart, &fill);
        let rect = Rect::new(11, 5, 30, 30);
        let part: Vec<f64> =
            (5..35).flat_map(|row| heights[row * 50 + 11..][..30].to_vec()).collect();
        let part = HeightPatch::new(&part, rect, &chart, &fill);
        let bounds = GeodeticBounds { west: 7.2, south: 45.7, east: 7.3, north: 45.9 };
        for stride in [1, 2, 4] {
            let all = |patch: &HeightPatch<'_>| {
                let mut found = Vec::new();
                patch.each(&bounds, stride, &mut |sample| {
                    found.push((sample.place, sample.height));
                });
                found
            };
            assert_eq!(all(&whole), all(&part));
            assert!(!all(&whole).is_empty());
            assert!(all(&whole).iter().all(|(place, _)| bounds.holds(*place)));
            let place = [7.2345, 45.8123];
            assert_eq!(whole.height(place), part.height(place));
        }
        let mut count = 0;
        whole.each(&bounds, 1, &mut |_| count += 1);
        assert_eq!(count, 11 * 21);
    }

    #[test]
    fn voids_are_void_and_filled_with_what_is_around() {
        let mut heights = vec![10.0; 2000];
        heights[0] = f64::NAN;
        heights[1999] = 30.0;
        let mut means = VoidFillSums::new([50, 40]);
        for (row, line) in (0..).zip(heights.chunks(50)) {
            means.add(0, row, line);
        }
        let fill = means.fill().unwrap();
        let chart = GridGeolocation::straight(MAP, [50, 40]);
        let patch = HeightPatch::new(&heights, Rect::new(0, 0, 50, 40), &chart, &fill);
        assert_eq!(patch.height(MAP.apply(0.2, 0.2)), None);
        assert_eq!(patch.height(MAP.apply(1.0, 0.0)), Some(10.0), "on a sample it alone counts");
        let filled = patch.filled(MAP.apply(0.0, 0.0));
        assert!((10.0..=30.0).contains(&filled));
        assert_eq!(
            patch.filled([100.0, 80.0]),
            patch.filled(MAP.apply(49.0, 0.0)),
            "beyond the grid"
        );
        assert!(VoidFillSums::new([3, 3]).fill().is_none());
    }
}
