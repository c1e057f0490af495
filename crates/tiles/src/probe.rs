//! Estimates the size of tiles from a sample of them.

use std::sync::Mutex;

use super::artifact::{ENTRY, FACTS};
use super::folder::TileFile;
use super::grid_levels::ScannedGrid;
use super::input::OpenedTilesGrid;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::{Cancel, workers};
use terrane_files::{lock, unlocked};
use terrane_globe::GlobeTileId;

/// Number of sampled tiles, with all tiles in them.
const PROBES: u64 = 16;
/// Levels of the sampled tiles below regions.
const BELOW: u8 = 2;
/// Safety factor.
const MARGIN: f64 = 1.1;
/// Approximate size in bytes of a tile that contains regions.
const FAR: f64 = 8192.0;
/// Block size of a disk in bytes.
const DISK_BLOCK: u64 = 4096;

/// Sampled tiles: count, size in objects, and size as files.
#[derive(Clone, Copy, Default)]
struct TileProbe {
    tiles: f64,
    bytes: f64,
    on_disk: f64,
}

impl TileProbe {
    fn add(&mut self, made: &TileFile) {
        let bytes = made.bytes.len() as u64;
        let facts = if made.facts.is_some() { 8 * FACTS } else { 0 };
        self.tiles += 1.0;
        self.bytes += (bytes + (ENTRY + facts) as u64) as f64;
        self.on_disk += bytes.next_multiple_of(DISK_BLOCK) as f64;
    }
}

/// Size in bytes of all tiles in objects, and as files.
pub(super) fn expect(opened: &OpenedTilesGrid) -> Result<[u64; 2]> {
    let division = &opened.division;
    let formats = opened.job.tiles.format.len() as f64;
    if division.near > division.last {
        let above = division.above(division.far_end()).len() as f64 * formats;
        return Ok([above * FAR, above * FAR].map(|bytes| bytes as u64));
    }
    let level = division.near.saturating_add(BELOW).min(division.last);
    let all = division.level(level);
    let count = all.len().min(PROBES);
    let numbers = (0..count).map(|i| (2 * i + 1) * all.len() / (2 * count));
    let tiles: Vec<GlobeTileId> = numbers.flat_map(|at| all.slice(at..at + 1)).collect();
    let mut gathered = opened.survey.clone().gather();
    let mut heights = Vec::new();
    for id in &tiles {
        let rect = blocks(opened, *id);
        if !rect.is_empty() {
            opened.read(rect, &mut heights)?;
            gathered.add(gathered.plan().summarize(rect, &heights));
        }
    }
    // The sampled part may be void by chance.
    let Some(overview) = gathered.finish() else { return Ok([0; 2]) };
    let ground = ScannedGrid::new(opened, &overview);
    let probes = Mutex::new([TileProbe::default(); 2]);
    let cancel = Cancel::default();
    workers::run(
        opened.shares.threads,
        count,
        &cancel,
        || (),
        |(), i| {
            let mut add = |made: TileFile| {
                lock(&probes)[usize::from(made.id.level == level)].add(&made);
                Ok(())
            };
            ground.region(tiles[i as usize], &mut add, &cancel)
        },
        Ok,
    )?;
    let [below, top] = unlocked(probes);
    let samples: u64 = tiles.iter().map(|id| division.samples(&id.bounds())).sum();
    let [width, height] = division.place.size.map(f64::from);
    let share = width * height / samples.max(1) as f64;
    // Parents are about as large as the largest sampled tiles.
    let above = division.above(level).len() as f64 * formats;
    let above = above / top.tiles.max(1.0);
    let sizes = [[below.bytes, top.bytes], [below.on_disk, top.on_disk]];
    Ok(sizes.map(|[below, top]| (((below + top) * share + top * above) * MARGIN) as u64))
}

/// Blocks with the samples of a tile.
fn blocks(opened: &OpenedTilesGrid, id: GlobeTileId) -> Rect {
    let (chart, side) = (opened.survey.chart(), opened.survey.blocks.side);
    let ranges = chart.range(&id.bounds());
    let [cols, rows] = [0, 1].map(|axis: usize| {
        let (count, [low, high]) = (chart.size()[axis], ranges[axis]);
        let low = low.floor().clamp(0.0, f64::from(count)) as u32;
        let high = (high.ceil() + 1.0).clamp(0.0, f64::from(count)) as u32;
        [low / side * side, high.next_multiple_of(side).min(count)]
    });
    Rect::new(cols[0], rows[0], cols[1] - cols[0], rows[1] - rows[0])
}
