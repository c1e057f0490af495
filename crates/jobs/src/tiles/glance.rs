//! The first look at a grid, all of it once.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::near;
use super::place::Place;
use crate::workers;
use crate::{Cancel, Progress};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_files::lock;
use terrane_raster::GridSource;
use terrane_tiles::{Blocks, Overview, Plan, TileId, degrees};

/// Metres below which there is no ground.
const LOWEST: f64 = -1e6;

/// Samples that are looked at at a time, about.
const WINDOW: u32 = 1 << 20;

/// What is to be seen of a grid whose tiles of levels before `near` are made of that.
pub(super) fn plan(place: &Place, near: u8) -> Plan {
    let lines = lines(place, near);
    Plan::new(place.whole, place.map, [&lines[0], &lines[1]])
}

/// Bytes that a worker takes, of near levels or of far ones: two samples of each block with what is kept of each,
/// and a row of blocks.
pub(super) fn worker_bytes(place: &Place, plan: &Plan) -> u64 {
    /// Two points in a list that grows, and the place of the next of each.
    const BLOCK: u64 = 2 * (2 * 12 + 4);
    let Blocks { side, counts, .. } = plan.blocks;
    let blocks = counts.map(u64::from).iter().product::<u64>();
    let row = u64::from(place.whole[0]) * u64::from(side) * 8;
    near::WORKER_BYTES.max((8 << 20) + blocks * BLOCK + row)
}

/// Looks at a grid.
///
/// # Errors
/// A grid without a sample or with absurd heights, and what reading finds.
pub(super) fn look(
    grid: &dyn GridSource,
    place: &Place,
    plan: &Plan,
    threads: usize,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Overview> {
    let rects = rects(place.whole, plan.blocks.side, grid.info().block);
    let seen = Mutex::new(plan.begin());
    progress.begin("look", rects.iter().map(|rect| rect.len() as u64).sum());
    workers::run(
        threads,
        rects.len() as u64,
        cancel,
        Vec::new,
        |heights: &mut Vec<f64>, i| {
            let rect = rects[i as usize];
            read(grid, place, rect, heights)?;
            let glance = plan.look(rect, heights);
            grid.copied(rect);
            lock(&seen).add(glance);
            progress.advance(rect.len() as u64);
            Ok(())
        },
        |_| Ok(()),
    )?;
    progress.end();
    let seen = seen.into_inner().unwrap_or_else(PoisonError::into_inner);
    let refuse = |error: Error, remedy: &str| error.in_file(Path::new(&place.name)).remedy(remedy);
    let overview = seen.end().ok_or_else(|| {
        let remedy = "check its nodata value, or choose another --band";
        refuse(Error::bad_input("the grid has no valid sample"), remedy)
    })?;
    let [lowest, _] = overview.range;
    if lowest < LOWEST {
        let stored = lowest / place.metres;
        let remedy = format!("if it stands for nodata, pass --nodata {stored:e}");
        return Err(refuse(Error::bad_input(format!("the height {stored:e} is absurd")), &remedy));
    }
    Ok(overview)
}

/// Reads heights in metres.
pub(super) fn read(
    grid: &dyn GridSource,
    place: &Place,
    rect: Rect,
    heights: &mut Vec<f64>,
) -> Result<()> {
    heights.clear();
    heights.resize(rect.len(), 0.0);
    grid.read_f64(rect, heights)?;
    if place.metres != 1.0 {
        heights.iter_mut().for_each(|height| *height *= place.metres);
    }
    Ok(())
}

/// Meridians and parallels that are borders of tiles of levels before `near`.
fn lines(place: &Place, near: u8) -> [Vec<f64>; 2] {
    let Some(level) = near.checked_sub(1) else { return [Vec::new(), Vec::new()] };
    let [cols, rows] = TileId::meeting(level, &place.bounds);
    let width = degrees(level);
    [(cols, -180.0), (rows, -90.0)].map(|([first, last], from)| {
        (first..=last + 1).map(|i| from + f64::from(i) * width).collect()
    })
}

/// Windows of whole blocks, along those of the file.
fn rects([width, height]: [u32; 2], side: u32, block: (u32, u32)) -> Vec<Rect> {
    let whole = |samples: u32, most: u32| {
        samples.max(1).next_multiple_of(side).min(most.next_multiple_of(side))
    };
    let rows = whole(block.1.min(1024), height).max(side);
    let cols = whole(WINDOW / rows, width).max(side);
    let starts = |end: u32, step: u32| (0..end).step_by(step as usize);
    let rect =
        |(col, row): (u32, u32)| Rect::new(col, row, cols.min(width - col), rows.min(height - row));
    starts(height, rows)
        .flat_map(|row| starts(width, cols).map(move |col| (col, row)))
        .map(rect)
        .collect()
}
