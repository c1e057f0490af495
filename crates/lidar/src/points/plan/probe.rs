//! Estimates the resources for tiles of points by making a few.

use tempfile::TempDir;

use super::manifest::PointTilesPlan;
use super::tasks::OpenedTranslate;
use crate::point_index::parts_in;
use crate::points::prepared::{converter, min_memory};
use crate::points::stages::noise::noise_index::Noise;
use crate::points::tile_subset::window;
use crate::points::tiled_output::Spans;
use terrane_base::error::{Error, Result};
use terrane_cloud::PointSource;
use terrane_cloud::write::PointPacking;
use terrane_delaunay::SiteWindow;
use terrane_engine::memory::polygon_bytes;
use terrane_engine::plan::{PlanNeeds, RunControl};

/// Sampled tiles along each side.
const ALONG: u32 = 3;
/// Most points to read for one: in an unordered point cloud, each would read much of it.
const MAX_POINTS: u64 = 1 << 22;
/// Nanoseconds of one thread for a point that is read, tiled and compressed; with ground by classes, and with a
/// ground method; as measured on one machine; see benches/history/2026.md, 28 and 29.
const POINT: [f64; 3] = [500.0, 1500.0, 28_000.0];
/// Nanoseconds for a byte that is copied at the end.
const BYTE: f64 = 2.0;
/// Safety factor: a few tiles underestimate the whole.
const MARGIN: f64 = 1.06;

/// Resources of the plan.
pub(super) fn expect(
    opened: &OpenedTranslate,
    work: &PointTilesPlan,
    at: RunControl<'_>,
) -> Result<PlanNeeds> {
    let folder = opened.job.resources.temp_dir.clone().unwrap_or_else(std::env::temp_dir);
    let (mut sample_bytes, mut sample_area) = (0.0, 0.0);
    let samples = sample_tiles(work.blocks.spans);
    at.progress.begin("sample", samples.len() as u64);
    for place in samples {
        at.cancel.check()?;
        if points_near(opened, work, place)? <= MAX_POINTS {
            let folder = TempDir::new_in(&folder).map_err(|e| Error::write(&folder, e))?;
            sample_bytes += opened.make(work, place, folder.path(), at.silent())?.bytes as f64;
            sample_area += area(opened, work, place);
        }
        at.progress.advance(1);
    }
    at.progress.end();
    let count = work.blocks.points as f64;
    let output = match sample_area {
        0.0 => count * converter(&opened.job, &opened.cloud)?.size() as f64 * grown(work),
        _ => MARGIN * sample_bytes / sample_area * area(opened, work, work.blocks.spans),
    } as u64;
    let kind = work.knowledge.seen.as_ref().map_or(0, |seen| if seen.by_class { 1 } else { 2 });
    let [memory, thread_memory] = min_memory(&opened.job, &opened.cloud, heaviest(opened, work)?)?;
    let noted = work.knowledge.noise.as_ref().map_or(0, Noise::bytes);
    Ok(PlanNeeds {
        memory: memory + noted + polygon_bytes(&opened.job.cloud),
        thread_memory,
        objects: output,
        output,
        seconds: [count * grown(work) * POINT[kind] * 1e-9, output as f64 * BYTE * 1e-9],
    })
}

/// Ratio of the number of points with buffers to that without.
fn grown(work: &PointTilesPlan) -> f64 {
    let squares = &work.method.squares;
    (1.0 + 2.0 * squares.buffer / squares.side).powi(2)
}

/// A few evenly spread tiles.
fn sample_tiles(spans: Spans) -> Vec<Spans> {
    let along = spans.map(|[first, last]| {
        let all = last - first + 1;
        let count = ((all + 1) / 2).clamp(1, i64::from(ALONG));
        (0..count).map(|i| first + all * (2 * i + 1) / (2 * count)).collect::<Vec<_>>()
    });
    let [columns, rows] = &along;
    rows.iter().flat_map(|row| columns.iter().map(|col| [[*col; 2], [*row; 2]])).collect()
}

/// Points that may have to be read for tiles.
fn points_near(opened: &OpenedTranslate, work: &PointTilesPlan, spans: Spans) -> Result<u64> {
    let info = opened.cloud.info();
    let near = window(&work.method.squares, spans, opened.job.reach(info)?, &info.frame);
    Ok(parts_in(&opened.cloud, &near).iter().map(|part| opened.cloud.points_of(*part)).sum())
}

/// Area of tiles within the bounds of the point cloud, in steps.
fn area(opened: &OpenedTranslate, work: &PointTilesPlan, spans: Spans) -> f64 {
    let info = opened.cloud.info();
    let [low, high] = info.bounds.unwrap_or_default();
    let cloud = SiteWindow { low: [low.x, low.y], high: [high.x, high.y] };
    let within = window(&work.method.squares, spans, -work.method.squares.buffer, &info.frame);
    within.intersection(&cloud).map_or(0.0, |part| {
        let [x, y] = [0, 1].map(|i| f64::from(part.high[i].abs_diff(part.low[i])) + 1.0);
        x * y
    })
}

/// Points that may have to be read for the largest task, if relevant.
fn heaviest(opened: &OpenedTranslate, work: &PointTilesPlan) -> Result<u64> {
    let info = opened.cloud.info();
    let needs = |points| opened.job.needed(PointPacking::Chunks, |_| info, points, true);
    if needs(0) == needs(MAX_POINTS) {
        return Ok(0);
    }
    let (blocks, reach, frame) = (&work.blocks, opened.job.reach(info)?, &info.frame);
    let windows: Vec<SiteWindow> = blocks
        .all()
        .map(|block| window(&work.method.squares, blocks.of_task(block), reach, frame))
        .collect();
    let mut points = vec![0; windows.len()];
    for part in 0..opened.cloud.parts() {
        let Some([low, high]) = opened.cloud.bounds_of(part) else { continue };
        let bounds = SiteWindow { low: [low.x, low.y], high: [high.x, high.y] };
        for (window, points) in windows.iter().zip(&mut points) {
            if window.intersection(&bounds).is_some() {
                *points += opened.cloud.points_of(part);
            }
        }
    }
    Ok(points.into_iter().max().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_squares_that_there_are() {
        for spans in [[[0, 0], [0, 0]], [[-7, 90], [3, 4]], [[5, 9], [-1, 50]]] {
            let places = sample_tiles(spans);
            let is_one = |place: &Spans| {
                (0..2).all(|i| place[i][0] >= spans[i][0] && place[i][1] <= spans[i][1])
            };
            assert!(places.iter().all(is_one) && places.len() <= 9, "{places:?}");
            let distinct = |i: usize| places[..i].iter().all(|other| *other != places[i]);
            assert!((0..places.len()).all(distinct), "{places:?}");
        }
    }
}
