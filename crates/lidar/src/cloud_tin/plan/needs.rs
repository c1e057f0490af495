//! Estimates the resources for a mesh of a point cloud by selecting vertices in a few tiles.

use crate::cloud_tin::lines::CloudLines;
use crate::cloud_tin::prepared::PreparedCloudTin;
use crate::cloud_tin::regions::{CloudTinRegion, CloudTinRegions, REGION_POINTS};
use crate::cloud_tin::vertex_selection::{BAND, select_first};
use crate::point_index::{ENTRY, POINT, PointStore, Tiling};
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_delaunay::ConvexHull;
use terrane_engine::memory::polygon_bytes;
use terrane_engine::plan::{PlanNeeds, RunControl};

/// Sampled tiles.
const MAX_SAMPLES: u32 = 96;
/// Steps of an evenly spread sequence along x and y (Roberts 2018).
const STEPS: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053_2];
/// Nanoseconds of one thread for a point in all tasks, and for a vertex that is written, as measured on one machine;
/// see benches/history/2026.md, 7.
const NANOSECONDS: [f64; 2] = [3300.0, 2000.0];
/// Safety factor: a few tiles underestimate the whole.
const MARGIN: f64 = 1.15;
/// Bytes of the result of a region.
const LOOK: u64 = 80;

/// A few tiles, with the points in and around them.
pub(super) struct TileSample {
    squares: Vec<usize>,
    points: PointStore,
}

impl TileSample {
    /// A sample without points yet.
    pub(super) fn new(ready: &PreparedCloudTin<'_>) -> Self {
        let tiling = ready.tiling();
        let squares = sample_tiles(&tiling);
        let memory = ready.job.resources.memory / 8;
        let points = PointStore::empty(tiling, ready.folder(), memory);
        let windows =
            squares.iter().map(|square| tiling.window_of(*square).grown(tiling.side() / BAND));
        let points = points.only(windows.flat_map(|window| tiling.touching(window)));
        Self { squares, points }
    }

    /// Adds points that lie in or around the tiles.
    pub(super) fn take(&self, points: &[Point]) -> Result<()> {
        self.points.add(points)
    }

    /// Vertices per point; 1 if there is no sample.
    pub(super) fn share(
        &self,
        ready: &PreparedCloudTin<'_>,
        hull: &ConvexHull,
        at: RunControl<'_>,
    ) -> Result<f64> {
        let tiling = self.points.tiling();
        let regions: Vec<_> = self.squares.iter().filter_map(|&s| self.region(s)).collect();
        let sampled: u64 = regions.iter().map(|region| region.points).sum();
        if ready.tolerance() == 0.0 || sampled == 0 {
            return Ok(1.0);
        }
        let (count, regions) = (regions.len(), CloudTinRegions::known(&regions, tiling));
        let mut lines = CloudLines::new(&ready.constraints, hull.clone(), tiling);
        lines.divide(&regions, tiling);
        let memory = ready.job.resources.memory / 8;
        let vertices = PointStore::empty(*tiling, ready.folder(), memory);
        let no_posts = PointStore::empty(*tiling, ready.folder(), memory);
        let work = ready.work(&self.points, &regions, &lines, 0, at)?;
        let hull = hull.corners();
        select_first(&work, 0..count, ready.tolerance(), &hull, &no_posts, &vertices)?;
        Ok((MARGIN * vertices.count() as f64 / sampled as f64).min(1.0))
    }

    /// The region of a single tile; `None` without points, or with more than a region has.
    fn region(&self, square: usize) -> Option<CloudTinRegion> {
        let count = self.points.summary(square).map_or(0, |summary| summary.count);
        let columns = self.points.tiling().counts()[0] as usize;
        let low = [square % columns, square / columns].map(|at| at as u32);
        let region = CloudTinRegion { low, end: low.map(|at| at + 1), points: count };
        (1..=REGION_POINTS).contains(&count).then_some(region)
    }
}

/// Evenly spread tiles, at most half of all, each once.
fn sample_tiles(tiling: &Tiling) -> Vec<usize> {
    let count = MAX_SAMPLES.min(tiling.count().div_ceil(2) as u32);
    let mut tiles: Vec<_> = (0..count).map(|i| sample_tile(tiling, i)).collect();
    tiles.sort_unstable();
    tiles.dedup();
    tiles
}

/// A tile of an evenly spread sequence.
fn sample_tile(tiling: &Tiling, i: u32) -> usize {
    let counts = tiling.counts();
    tiling.square([0, 1].map(|axis| {
        let at = (f64::from(i) * STEPS[axis]).fract() * f64::from(counts[axis]);
        (at as u32).min(counts[axis] - 1)
    }))
}

/// Resources of the plan, if this `share` of the points become vertices.
pub(super) fn expect(
    ready: &PreparedCloudTin<'_>,
    regions: &[CloudTinRegion],
    share: f64,
) -> Result<PlanNeeds> {
    let points: u64 = regions.iter().map(|region| region.points).sum();
    let vertices = (points as f64 * share) as u64;
    let squares = ready.tiling().count() as u64;
    let max_points = regions.iter().map(|region| region.points).max().unwrap_or(0);
    let worker = ready.division.worker(max_points, 0);
    let [task, writing] = NANOSECONDS.map(|n| n * 1e-9);
    Ok(PlanNeeds {
        // Squares of all rounds are known by their indices, twice while these are put in order.
        memory: ready.division.min_memory(worker, 6 * squares * ENTRY)
            + polygon_bytes(&ready.job.options),
        thread_memory: worker * 8 / ready.division.workers,
        objects: vertices * POINT + squares * ENTRY + 2 * LOOK * regions.len() as u64,
        output: (ready.format.capacity)().file_bytes(vertices, 2 * vertices),
        seconds: [points as f64 * task, vertices as f64 * writing],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_even_and_few() {
        for (wide, high) in [(1, 1), (7, 1), (9000, 200), (4000, 4000)] {
            let corners = [Point::new(0, 0, 0), Point::new(wide - 1, high - 1, 0)];
            let tiling = Tiling::new(corners, (wide * high) as u64 * 100);
            let places = sample_tiles(&tiling);
            assert!(places.len() <= MAX_SAMPLES as usize && !places.is_empty());
            assert!(places.len() * 2 <= tiling.count() + 1 && places.is_sorted());
            if tiling.count() > 1000 {
                assert!(places.len() > 80);
                let half = places.partition_point(|&place| place < tiling.count() / 2);
                assert!(half.abs_diff(places.len() / 2) < 4, "{half} of {}", places.len());
            }
        }
    }
}
