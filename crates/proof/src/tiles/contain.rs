//! Whether the bounding sphere, the horizon occlusion point and the centre of a tile are about its vertices.
//!
//! From outside of a sphere of radius 1 a point P at distance p is seen over the cap of angle arccos(1/p)
//! around it. Whoever does not see the occlusion point O sees no vertex P if the cap of P lies within that of O:
//! if angle(O, P) + arccos(1/p) <= arccos(1/o). The ellipsoid becomes such a sphere where axes are scaled;
//! clients shrink its axes by the least height of a tile below zero, so it is looked at both ways. What is inside
//! of the sphere is taken to be on it.

use super::decode::Tile;
use super::ellipsoid::{A, B, Vector, cross, dot, height, length, minus, plus};
use super::fault::{Fault, Faults};
use super::tiling::TileId;

/// Metres by which a vertex may be outside of its sphere: rounding.
const SLACK: f64 = 1e-5;

/// Relative rounding of the distance of an occlusion point.
const ROUNDING: f64 = 1e-9;

/// A tile that reaches beyond the horizon of every point of its direction, as the two roots do, has a point at
/// least so many radii away: it is seen from all but 0.6 degrees of the places that see its hemisphere.
const FAR: f64 = 100.0;

/// What is said of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct About {
    /// Heights that nothing of it is below or above.
    pub heights: [f64; 2],
    /// Middle and radius of the bounding sphere.
    pub sphere: ([f64; 3], f64),
    /// Horizon occlusion point, on an ellipsoid scaled to a sphere of radius 1.
    pub horizon: [f64; 3],
    /// The error that it records.
    pub error: f64,
}

impl About {
    /// Whether its sphere holds that of a tile below it, and its error is no smaller.
    pub fn holds(&self, part: &Self) -> bool {
        let ((middle, radius), (other, least)) = (self.sphere, part.sphere);
        length(minus(middle, other)) + least <= radius + SLACK && self.error >= part.error
    }
}

/// Holds all of the triangles of a tile, and of its skirt, to be between the heights that are said of it: the heights of
/// corners, of the middles of sides, and of the middle.
pub fn between(id: TileId, about: &About, tile: &Tile, positions: &[Vector], faults: &mut Faults) {
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
    let count = of_surface.chain(tile.skirt.triangles.iter().copied()).filter(is_out).count();
    faults.add(Fault::Heights, count as u64, id);
}

/// Looks at what is said of the places of the vertices of a tile, and where its centre is.
pub fn contain(
    id: TileId,
    tile: &About,
    centre: Vector,
    positions: &[Vector],
    faults: &mut Faults,
) {
    let (middle, radius) = tile.sphere;
    let most = radius + SLACK;
    let outside = positions.iter().filter(|&&at| length(minus(at, middle)) > most).count();
    // Not so of a radius that is no number or below zero.
    let outside = if radius >= 0.0 { outside } else { positions.len() };
    faults.add(Fault::Sphere, outside as u64, id);
    let is_near = length(minus(centre, middle)) <= 2.0 * radius + SLACK;
    faults.add(Fault::Centre, u64::from(!is_near), id);
    faults.add(Fault::Range, u64::from(tile.heights[0] > tile.heights[1]), id);
    let low = tile.heights[0].min(0.0);
    let is_seen = |&&at: &&Vector| {
        let shrunk = if low < 0.0 && -low < B { low } else { 0.0 };
        [0.0, shrunk].iter().any(|by| is_seen(tile.horizon, scaled(at, *by)))
    };
    faults.add(Fault::Horizon, positions.iter().filter(is_seen).count() as u64, id);
}

fn scaled([x, y, z]: Vector, by: f64) -> Vector {
    [x / (A + by), y / (A + by), z / (B + by)]
}

/// True when `vertex` may be seen where `point` is not.
fn is_seen(point: Vector, vertex: Vector) -> bool {
    let [far, high] = [point, vertex].map(length);
    let apart = [length(cross(point, vertex)), dot(point, vertex)].map(|part| part / (far * high));
    let [sin, cos] = apart;
    let cap = 1.0 / high.max(1.0);
    // Of the sum of the angle and the cap.
    let sum = cos * cap - sin * (1.0 - cap * cap).sqrt();
    let least = if sum > 1.0 / FAR { 1.0 / sum } else { FAR };
    far.is_nan() || least.is_nan() || far < least * (1.0 - ROUNDING)
}
