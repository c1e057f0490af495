//! The reference polygons of water masks, on the globe.
//!
//! Each side is cut into so many equal parts that it is straight in longitudes and latitudes, too, far nearer than a
//! pixel of the finest level.

use super::georeference::GlobeRaster;
use super::memory_shares::TilesProofMemory;
use terrane_base::error::{Error, Result};
use terrane_proof::tiles::{ProofTileId, UNCLEAR, WaterBank, WaterShore};
use terrane_raster::Water;

/// Pixels of a mask along the side of a tile.
const PIXELS: f64 = 256.0;
/// Share of the unjudged width by which the middle of a part may deviate.
const OFF: f64 = 0.1;
/// Most parts of a side.
const MAX_PARTS: f64 = 65_536.0;

/// Of the polygons that meet a raster, for tiles down to the level `finest`.
///
/// # Errors
/// A polygon that cannot be projected onto the globe; more sides than fit into memory.
pub(super) fn shore(
    water: &Water,
    places: &GlobeRaster<'_>,
    finest: u8,
    room: &TilesProofMemory,
) -> Result<WaterShore> {
    let of_file = |e: Error| e.in_file(water.path());
    let [west, _, east, _] = ProofTileId { level: finest, y: 0, x: 0 }.bounds();
    let off = (east - west) / PIXELS * UNCLEAR * OFF;
    let most = room.sides();
    let (mut banks, mut beside, mut count) = (Vec::new(), None, 0);
    for (polygon, ring) in water.rings() {
        // What is beside the raster is told by the ring around a polygon; those of its holes come after it.
        let is_beside = match beside {
            Some((of, is_beside)) if of == polygon => is_beside,
            _ => !places.may_meet(ring),
        };
        beside = Some((polygon, is_beside));
        if is_beside {
            continue;
        }
        for side in ring.windows(2) {
            let to = |part: f64| {
                let at = [0, 1]
                    .map(|axis: usize| side[0][axis] + (side[1][axis] - side[0][axis]) * part);
                places.bring(at).map_err(of_file)
            };
            let parts = parts([to(0.0)?, to(0.25)?, to(0.5)?, to(0.75)?, to(1.0)?], off);
            // Of what does not fit all is counted.
            count += u64::from(parts);
            if count > most {
                continue;
            }
            let mut last = to(0.0)?;
            for part in 1..=parts {
                let next =
                    if part == parts { to(1.0)? } else { to(f64::from(part) / f64::from(parts))? };
                banks.push(WaterBank::new(last, next, polygon));
                last = next;
            }
        }
    }
    room.check_sides(count).map_err(of_file)?;
    Ok(WaterShore::new(banks))
}

/// Number of parts of a side with these positions at its quarters: the deviation of the arc falls with its
/// square.
fn parts(places: [[f64; 2]; 5], off: f64) -> u32 {
    let [first, .., last] = places;
    let apart = |(number, place): (usize, [f64; 2])| {
        let part = number as f64 / 4.0;
        let [x, y] =
            [0, 1].map(|axis: usize| first[axis] + (last[axis] - first[axis]) * part - place[axis]);
        x.hypot(y)
    };
    let worst = places.into_iter().enumerate().map(apart).fold(0.0, f64::max);
    (worst / off).sqrt().mul_add(2.0, 1.0).clamp(1.0, MAX_PARTS) as u32
}
