//! Estimates the cost of a TIN of a grid without reading heights.

use serde::Serialize;

use super::breakline_check::BreaklineFans;
use super::layout::{TileLayout, USUAL_TILE};
use super::numbering::{VertexFlags, VertexRanks};
use super::window::HeightBuffers;
use terrane_base::geom::Point3;
use terrane_engine::{Resources, memory, plan};
use terrane_raster::GridSource;
use terrane_tin::{TileMesh, TilePosition, TileScratch, TileTriangle};

/// Share of the samples kept by a coarse and by a fine mesh.
const KEPT: [f64; 2] = [0.002, 0.05];
/// Nanoseconds of one thread for a sample of a coarse and of a fine mesh, as measured on one machine
/// with terrains of several kinds; see benches/history/2026.md, 2.
const RATES: [f64; 2] = [8.0, 100.0];
/// Bytes of a vertex in a file of the usual format, PLY, with its two triangles.
const FILE_BYTES: f64 = 50.0;
/// Rows of tiles in flight at any time.
const ROWS_IN_FLIGHT: u64 = 3;

/// Cost of a TIN of a grid with tiles of the default size, for a coarse and a fine mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TinCost {
    /// Least memory, in bytes.
    pub least_memory: u64,
    /// Memory budget, in bytes.
    pub memory: u64,
    /// Threads that fit.
    pub threads: usize,
    /// Shares of the samples that a coarse and a fine mesh keep.
    pub kept: [f64; 2],
    /// Nanoseconds a sample and thread.
    pub nanoseconds_per_sample: [f64; 2],
    /// Estimated seconds.
    pub seconds: [f64; 2],
    /// Estimated bytes of spilled data on disk.
    pub spill_bytes: [u64; 2],
    /// Estimated bytes of the mesh as PLY.
    pub mesh_bytes: [u64; 2],
}

/// The cost of a TIN of `source` within `resources`; `None` if it has no cell.
pub fn cost(source: &dyn GridSource, resources: &Resources) -> Option<TinCost> {
    let layout = TileLayout::new(source.info().width, source.info().height, USUAL_TILE).ok()?;
    let (width, height) = (u64::from(source.info().width), u64::from(source.info().height));
    let worker = worker_bytes(layout.side(), false, false);
    let least_memory = memory::least(worker, source.block_bytes());
    let memory = resources.memory.max(least_memory);
    let shares = memory::divide(memory, resources.threads, worker).ok()?;
    let in_flight = width * height.min(ROWS_IN_FLIGHT * u64::from(USUAL_TILE));
    Some(TinCost {
        least_memory,
        memory: resources.memory,
        threads: shares.threads,
        kept: KEPT,
        nanoseconds_per_sample: RATES,
        seconds: RATES.map(|rate| seconds(width * height, rate, shares.threads)),
        spill_bytes: KEPT.map(|kept| mesh_bytes(in_flight, kept).saturating_sub(shares.mesh)),
        mesh_bytes: KEPT.map(|kept| ((width * height) as f64 * kept * FILE_BYTES) as u64),
    })
}

/// Additional bytes of a worker that follows breaklines.
pub(super) fn line_bytes(cells: u32) -> u64 {
    TileScratch::line_bytes(cells + 2) + BreaklineFans::bytes(cells)
}

/// Maximum bytes of a worker for tiles of `cells` x `cells`; with `keeps_all` each sample may become a vertex.
pub(super) fn worker_bytes(cells: u32, keeps_all: bool, fit: bool) -> u64 {
    let samples = u64::from(cells + 3).pow(2);
    let face = size_of::<[u64; 3]>() + size_of::<[Point3; 3]>();
    let full_mesh = TileMesh::max_bytes(samples) + 2 * samples * face as u64;
    let mesh = if keeps_all { full_mesh } else { 0 };
    mesh + TileScratch::bytes(cells + 2, fit)
        + HeightBuffers::bytes(samples)
        + VertexFlags::bytes(cells)
        + 4 * VertexRanks::bytes(cells)
}

/// Nanoseconds of one thread for a sample of a mesh that keeps a share of them, on the line through the
/// measured rates.
pub(super) fn nanoseconds(share: f64) -> f64 {
    let slope = (RATES[1] - RATES[0]) / (KEPT[1] - KEPT[0]);
    (RATES[0] + slope * (share - KEPT[0])).max(RATES[0])
}

/// Seconds for `samples` at a rate.
pub(super) fn seconds(samples: u64, rate: f64, threads: usize) -> f64 {
    plan::shared(samples as f64 * rate * 1e-9, threads)
}

/// Bytes of a mesh of `samples`, with two triangles to a vertex.
fn mesh_bytes(samples: u64, share: f64) -> u64 {
    let vertex = 2 * size_of::<TileTriangle>() + size_of::<TilePosition>() + size_of::<f64>();
    (samples as f64 * share * vertex as f64) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_raster::{GridOpenOptions, open};

    fn cost_of(terrain: &str, threads: usize, memory: u64) -> Option<TinCost> {
        let source = open(terrain, &GridOpenOptions::default()).unwrap();
        cost(source.as_ref(), &Resources { threads, memory, temp_dir: None })
    }

    #[test]
    fn time_goes_with_samples_and_threads() {
        let small = cost_of("synth:rough,size=1001", 1, 1 << 30).unwrap();
        let large = cost_of("synth:rough,size=2001", 1, 1 << 30).unwrap();
        assert!((large.seconds[1] / small.seconds[1] - 4.0).abs() < 0.01);
        assert!(small.seconds[0] < small.seconds[1]);
        let two = cost_of("synth:rough,size=2001", 2, 1 << 30).unwrap();
        assert!((large.seconds[0] / two.seconds[0] - 1.85).abs() < 1e-9);
        assert_eq!((two.threads, two.spill_bytes), (2, [0, 0]));
    }

    #[test]
    fn threads_that_do_not_fit_are_left_out_and_too_little_memory_is_told() {
        let needed = cost_of("synth:rough,size=2001", 8, 1 << 30).unwrap().least_memory;
        let poor = cost_of("synth:rough,size=2001", 8, needed - 1).unwrap();
        assert_eq!((poor.threads, poor.memory, poor.least_memory), (1, needed - 1, needed));
        let most = cost_of("synth:rough,size=2001", 8, needed).unwrap();
        assert_eq!(most.threads, 1);
    }

    #[test]
    fn wide_fine_meshes_spill_in_little_memory() {
        let cost = cost_of("synth:rough,width=1000000,height=100000", 2, 128 << 20).unwrap();
        let [coarse, fine] = cost.spill_bytes;
        assert!(coarse < fine && fine > 1 << 30, "{cost:?}");
        assert!(cost.seconds[1] > 3600.0);
    }

    #[test]
    fn a_single_row_has_no_mesh() {
        assert_eq!(cost_of("synth:rough,width=9,height=1", 1, 1 << 30), None);
    }
}
