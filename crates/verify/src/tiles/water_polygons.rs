//! The reference polygons of water masks, on the globe.
//!
//! Each side is divided into equal segments, enough of them to be straight in longitude and latitude within a fraction of
//! a pixel of the finest level.

use super::georeference::GlobeRaster;
use super::memory_shares::TilesProofMemory;
use terrane_base::error::{Error, Result};
use terrane_proof::tiles::{ProofTileId, UNCLEAR, WaterBank, WaterShore};
use terrane_raster::Water;

/// Pixels of a mask along the side of a tile.
const PIXELS: f64 = 256.0;
/// Share of the unjudged width by which the middle of a segment may deviate.
const TOLERANCE: f64 = 0.1;
/// Limit of the segments of a side.
const MAX_SEGMENTS: f64 = 65_536.0;

/// The banks of the polygons that meet a raster, for tiles down to the level `finest`.
///
/// # Errors
/// A polygon that cannot be projected onto the globe; more segments than fit into memory.
pub(super) fn shore(
    water: &Water,
    raster: &GlobeRaster<'_>,
    finest: u8,
    memory: &TilesProofMemory,
) -> Result<WaterShore> {
    banks(water, raster, finest, memory)
        .map(WaterShore::new)
        .map_err(|e: Error| e.in_file(water.path()))
}

fn banks(
    water: &Water,
    raster: &GlobeRaster<'_>,
    finest: u8,
    memory: &TilesProofMemory,
) -> Result<Vec<WaterBank>> {
    let [west, _, east, _] = ProofTileId { level: finest, y: 0, x: 0 }.bounds();
    let tolerance = (east - west) / PIXELS * UNCLEAR * TOLERANCE;
    let max = memory.segments();
    let (mut banks, mut outside, mut count) = (Vec::new(), None, 0);
    for (polygon, ring) in water.rings() {
        // The outer ring decides for a polygon; the rings of its holes come after it.
        let is_outside = match outside {
            Some((of, is_outside)) if of == polygon => is_outside,
            _ => !raster.may_meet(ring),
        };
        outside = Some((polygon, is_outside));
        if is_outside {
            continue;
        }
        for side in ring.windows(2) {
            let side = [side[0], side[1]];
            let quarters = [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| between(side, share));
            let [a, b, c, d, e] = quarters.map(|at| raster.to_globe(at));
            let segments = segments([a?, b?, c?, d?, e?], tolerance);
            // Beyond the limit, segments are only counted, for the error.
            count += u64::from(segments);
            if count > max {
                continue;
            }
            let mut last = raster.to_globe(side[0])?;
            for number in 1..=segments {
                let share = f64::from(number) / f64::from(segments);
                let next = raster.to_globe(between(side, share))?;
                banks.push(WaterBank::new(last, next, polygon));
                last = next;
            }
        }
    }
    memory.check_segments(count)?;
    Ok(banks)
}

/// The point at a share of the way from one point to another.
fn between([from, to]: [[f64; 2]; 2], share: f64) -> [f64; 2] {
    [0, 1].map(|axis: usize| from[axis] + (to[axis] - from[axis]) * share)
}

/// Number of segments of a side with these positions at its quarters: the deviation of an arc falls with the square of
/// their number.
fn segments(quarters: [[f64; 2]; 5], tolerance: f64) -> u32 {
    let [first, .., last] = quarters;
    let mut worst = 0.0_f64;
    for (number, position) in quarters.into_iter().enumerate() {
        let [x, y] = between([first, last], number as f64 / 4.0);
        worst = worst.max((x - position[0]).hypot(y - position[1]));
    }
    (worst / tolerance).sqrt().mul_add(2.0, 1.0).clamp(1.0, MAX_SEGMENTS) as u32
}
