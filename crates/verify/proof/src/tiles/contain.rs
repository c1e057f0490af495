//! Whether the bounding sphere, the horizon occlusion point and the centre of a tile are about its vertices.
//!
//! From outside of a sphere of radius 1 a point P at distance p is seen over the cap of angle arccos(1/p)
//! around it. Whoever does not see the occlusion point O sees no vertex P if the cap of P lies within that of O:
//! if angle(O, P) + arccos(1/p) <= arccos(1/o). The ellipsoid becomes such a sphere where axes are scaled;
//! clients shrink its axes by the least height of a tile below zero, so it is looked at both ways. What is inside
//! of the sphere is taken to be on it.

use super::decode::DecodedTile;
use super::ellipsoid::{A, B, Vector, cross, dot, height, length, minus, plus};
use super::fault::{TilesetFault, TilesetFaults};
use super::tiling::ProofTileId;

/// Metres by which a vertex may be outside of its sphere: rounding.
const SLACK: f64 = 1e-5;

/// Metres that terrane's own spheres, centres and heights may be beside or beyond what they should be.
const LOOSE: f64 = 1e-3;

/// Relative rounding of the distance of an occlusion point.
const ROUNDING: f64 = 1e-9;
/// Part that terrane's own may be beside or beyond where it should be.
const OF_HORIZON: f64 = 1e-7;

/// A tile that reaches beyond the horizon of every point of its direction, as the two roots do, has a point at
/// least so many radii away: it is seen from all but 0.6 degrees of the places that see its hemisphere.
const FAR: f64 = 100.0;
/// How far terrane's own is in that case.
const ALWAYS: f64 = 1e6;

/// What is said of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StatedTileMetadata {
    /// Heights that nothing of it is below or above.
    pub heights: [f64; 2],
    /// Middle and radius of the bounding sphere.
    pub sphere: ([f64; 3], f64),
    /// Horizon occlusion point, on an ellipsoid scaled to a sphere of radius 1.
    pub horizon: [f64; 3],
    /// The error that it records.
    pub error: f64,
}

impl StatedTileMetadata {
    /// Whether its sphere holds that of a tile below it, and its error is no smaller.
    pub fn holds(&self, part: &Self) -> bool {
        let ((middle, radius), (other, least)) = (self.sphere, part.sphere);
        length(minus(middle, other)) + least <= radius + SLACK && self.error >= part.error
    }

    /// The radius around its middle that holds the sphere of another.
    pub fn reach_of(&self, part: &Self) -> f64 {
        length(minus(self.sphere.0, part.sphere.0)) + part.sphere.1
    }
}

impl DecodedTile {
    /// What it says of itself, but its error.
    pub fn about(&self) -> StatedTileMetadata {
        let heights = self.heights.map(f64::from);
        StatedTileMetadata { heights, sphere: self.sphere, horizon: self.horizon, error: f64::NAN }
    }
}

/// Holds all of the triangles of a tile, and of its skirt, to be between the heights that are said of it: the heights of
/// corners, of the middles of sides, and of the middle. They say so of no more than their triangles may reach, to two
/// steps of the lattice of coordinates.
pub fn between(
    id: ProofTileId,
    (about, lattice): (&StatedTileMetadata, f64),
    tile: &DecodedTile,
    positions: &[Vector],
    faults: &mut TilesetFaults,
) {
    let [low, high] = about.heights;
    let is_out = |[a, b, c]: &[Vector; 3]| {
        let [a, b, c] = [*a, *b, *c];
        let middle = |of: &[Vector]| {
            let sum = of.iter().copied().fold([0.0; 3], plus);
            sum.map(|value| value / of.len() as f64)
        };
        let places =
            [a, b, c, middle(&[a, b]), middle(&[b, c]), middle(&[c, a]), middle(&[a, b, c])];
        let is_in = |place: Vector| (low - SLACK..=high + SLACK).contains(&height(place));
        !places.into_iter().all(is_in)
    };
    let of_surface = tile.triangles.iter().map(|of| of.map(|corner| positions[corner as usize]));
    let all = of_surface.chain(tile.skirt.triangles.iter().copied());
    faults.add(TilesetFault::Heights, all.clone().filter(is_out).count() as u64, id);
    let needed = all.map(reach).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    let [least, most] = needed.unwrap_or([low, high]);
    let slack = 2.0 * lattice + LOOSE;
    let is_loose = low < least - slack || high > most + slack;
    faults.add(TilesetFault::LooseHeights, u64::from(is_loose), id);
}

/// Heights that no place of a triangle is beyond: those of its corners, less what the longest side of it bends.
fn reach(corners: [Vector; 3]) -> [f64; 2] {
    let heights = corners.map(height);
    let low = heights.into_iter().fold(f64::INFINITY, f64::min);
    let high = heights.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let side = |k: usize| minus(corners[k], corners[(k + 1) % 3]);
    let longest = (0..3).map(|k| dot(side(k), side(k))).fold(0.0, f64::max);
    // The ellipsoid bends most along the meridian at the equator.
    [low - longest / (6.0 * (B * B / A + low.min(0.0))), high]
}

/// Holds the lower of the two heights of a tile to be that of a vertex.
pub fn lowest(id: ProofTileId, tile: &DecodedTile, faults: &mut TilesetFaults) {
    let is_lower = tile.vertices.iter().all(|vertex| vertex[2] > 0);
    faults.add(TilesetFault::LooseHeights, u64::from(is_lower), id);
}

/// Holds what terrane says of its own tiles to be the nearest: sphere and centre in the middle of the box around the
/// vertices, and the horizon occlusion point above that, no higher than it has to be. The radius that the sphere needs.
pub fn tight(
    id: ProofTileId,
    tile: &StatedTileMetadata,
    centre: Option<Vector>,
    positions: &[Vector],
    faults: &mut TilesetFaults,
) -> f64 {
    let end = |axis: usize, choose: fn(f64, f64) -> f64| {
        positions.iter().map(|at| at[axis]).reduce(choose).unwrap_or_default()
    };
    let middle: Vector =
        std::array::from_fn(|axis| end(axis, f64::min).midpoint(end(axis, f64::max)));
    let is_off = |at: Vector| length(minus(at, middle)) > LOOSE;
    faults.add(TilesetFault::OffSphere, u64::from(is_off(tile.sphere.0)), id);
    faults.add(TilesetFault::Centre, u64::from(centre.is_some_and(is_off)), id);
    let radius = positions.iter().map(|&at| length(minus(at, middle))).fold(0.0, f64::max);
    let is_loose = centre.is_some() && tile.sphere.1 > radius + LOOSE;
    faults.add(TilesetFault::LooseSphere, u64::from(is_loose), id);
    let shrunk = by_least(tile);
    let up = scaled(middle, shrunk);
    let far = length(tile.horizon);
    let apart = length(cross(tile.horizon, up)) / (far * length(up));
    let needed = |lift: f64| {
        let both = positions.iter().flat_map(|&at| [0.0, shrunk].map(|by| scaled(at, by)));
        both.map(|at| least(tile.horizon, lifted(at, lift), ALWAYS)).fold(1.0, f64::max)
    };
    let is_there = apart < OF_HORIZON
        && dot(tile.horizon, up) > 0.0
        && far > needed(-SLACK) * (1.0 - OF_HORIZON)
        && far < needed(SLACK) * (1.0 + OF_HORIZON);
    faults.add(TilesetFault::FarHorizon, u64::from(!is_there), id);
    radius
}

/// Looks at what is said of the places of the vertices of a tile, and where its centre is.
pub fn contain(
    id: ProofTileId,
    tile: &StatedTileMetadata,
    centre: Option<Vector>,
    positions: &[Vector],
    faults: &mut TilesetFaults,
) {
    let (middle, radius) = tile.sphere;
    let most = radius + SLACK;
    let outside = positions.iter().filter(|&&at| length(minus(at, middle)) > most).count();
    // Not so of a radius that is no number or below zero.
    let outside = if radius >= 0.0 { outside } else { positions.len() };
    faults.add(TilesetFault::Sphere, outside as u64, id);
    let is_far = |centre: Vector| length(minus(centre, middle)) > 2.0 * radius + SLACK;
    faults.add(TilesetFault::Centre, u64::from(centre.is_some_and(is_far)), id);
    faults.add(TilesetFault::Range, u64::from(tile.heights[0] > tile.heights[1]), id);
    let shrunk = by_least(tile);
    let is_seen =
        |&&at: &&Vector| [0.0, shrunk].iter().any(|by| is_seen(tile.horizon, scaled(at, *by)));
    faults.add(TilesetFault::Horizon, positions.iter().filter(is_seen).count() as u64, id);
}

/// What clients shrink the axes by: the least height, where that is below zero.
fn by_least(tile: &StatedTileMetadata) -> f64 {
    let low = tile.heights[0];
    if low < 0.0 && -low < B { low } else { 0.0 }
}

fn scaled([x, y, z]: Vector, by: f64) -> Vector {
    [x / (A + by), y / (A + by), z / (B + by)]
}

/// A place so many metres higher. The angle to the horizon goes with the root of the height, so what rounding does
/// to heights near zero is many times as much there.
fn lifted(at: Vector, by: f64) -> Vector {
    at.map(|axis| axis * (1.0 + by / B))
}

/// True when `vertex` may be seen where `point` is not.
fn is_seen(point: Vector, vertex: Vector) -> bool {
    let (far, least) = (length(point), least(point, lifted(vertex, -SLACK), FAR));
    far.is_nan() || least.is_nan() || far < least * (1.0 - ROUNDING)
}

/// How far out a point in a direction has to be so that a vertex is hidden wherever it is; so far at the most.
fn least(point: Vector, vertex: Vector, most: f64) -> f64 {
    let [far, high] = [point, vertex].map(length);
    let apart = [length(cross(point, vertex)), dot(point, vertex)].map(|part| part / (far * high));
    let [sin, cos] = apart;
    let cap = 1.0 / high.max(1.0);
    // Of the sum of the angle and the cap.
    let sum = cos * cap - sin * (1.0 - cap * cap).sqrt();
    if sum > 1.0 / most { 1.0 / sum } else { most }
}
