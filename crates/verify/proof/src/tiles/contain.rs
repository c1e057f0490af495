//! Checks the bounding sphere, the horizon occlusion point and the centre of a tile.
//!
//! Outside a sphere of radius 1, a point P at distance p is visible from the cap of angle arccos(1/p) around it.
//! If the occlusion point O is hidden, so is a vertex P whose cap lies within that of O:
//! angle(O, P) + arccos(1/p) <= arccos(1/o). Scaling the axes makes the ellipsoid such a sphere. Clients shrink the axes by
//! the lowest height of a tile below zero, so both ellipsoids are checked. Points inside the sphere count as on it.

use std::ops::RangeInclusive;

use super::decode::DecodedTile;
use super::ellipsoid::{A, B, Vector, cross, dot, height, length, minus, plus};
use super::fault::{TilesetFault, TilesetFaults};
use super::tiling::ProofTileId;

/// Rounding of the distance of a vertex from its sphere, in metres.
const SLACK: f64 = 1e-5;

/// Rounding of terrane's own spheres, centres and heights, in metres.
const LOOSE: f64 = 1e-3;

/// Relative rounding of the distance of an occlusion point.
const ROUNDING: f64 = 1e-9;
/// Relative rounding of terrane's own occlusion points.
const OF_HORIZON: f64 = 1e-7;

/// Smallest distance, in radii, of the occlusion point of a tile beyond the horizon of every point in its direction, as the
/// two roots are: it is visible from all but 0.6 degrees of its hemisphere.
const FAR: f64 = 100.0;
/// Distance of terrane's own points in that case.
const ALWAYS: f64 = 1e6;

/// Stated metadata of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StatedTileMetadata {
    /// Lowest and highest height.
    pub heights: [f64; 2],
    /// Middle and radius of the bounding sphere.
    pub sphere: ([f64; 3], f64),
    /// Horizon occlusion point, on an ellipsoid scaled to a sphere of radius 1.
    pub horizon: [f64; 3],
    /// Recorded error in metres.
    pub error: f64,
}

impl StatedTileMetadata {
    /// Whether its sphere contains that of a child, and its error is no smaller.
    pub fn holds(&self, child: &Self) -> bool {
        self.radius_with(child) <= self.sphere.1 + SLACK && self.error >= child.error
    }

    /// The radius around its middle that contains the sphere of another tile.
    pub fn radius_with(&self, other: &Self) -> f64 {
        distance(self.sphere.0, other.sphere.0) + other.sphere.1
    }
}

impl DecodedTile {
    /// The metadata of its header, which lacks the error.
    pub fn stated(&self) -> StatedTileMetadata {
        let heights = self.heights.map(f64::from);
        StatedTileMetadata { heights, sphere: self.sphere, horizon: self.horizon, error: f64::NAN }
    }
}

/// Checks the triangles of a tile and of its skirt against the stated height range, which may exceed theirs by two steps
/// of the `lattice` of coordinates.
pub fn between(
    id: ProofTileId,
    stated: &StatedTileMetadata,
    lattice: f64,
    tile: &DecodedTile,
    positions: &[Vector],
    faults: &mut TilesetFaults,
) {
    let [low, high] = stated.heights;
    let range = low - SLACK..=high + SLACK;
    let of_surface = tile.triangles.iter().map(|of| of.map(|corner| positions[corner as usize]));
    let all = of_surface.chain(tile.skirt.triangles.iter().copied());
    let outside = all.clone().filter(|corners| !is_within(*corners, &range)).count();
    faults.add(TilesetFault::Heights, outside as u64, id);
    let needed = all.map(height_range).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    let [min, max] = needed.unwrap_or([low, high]);
    let slack = 2.0 * lattice + LOOSE;
    let is_loose = low < min - slack || high > max + slack;
    faults.add(TilesetFault::LooseHeights, u64::from(is_loose), id);
}

/// Whether the corners of a triangle, the middles of its sides and its centroid are within a height range.
fn is_within([a, b, c]: [Vector; 3], range: &RangeInclusive<f64>) -> bool {
    let points = [a, b, c, mean(&[a, b]), mean(&[b, c]), mean(&[c, a]), mean(&[a, b, c])];
    points.into_iter().all(|point| range.contains(&height(point)))
}

fn mean(points: &[Vector]) -> Vector {
    let sum = points.iter().copied().fold([0.0; 3], plus);
    sum.map(|value| value / points.len() as f64)
}

/// Bounds of the heights of a triangle: those of its corners, less the sag of its longest side.
fn height_range([a, b, c]: [Vector; 3]) -> [f64; 2] {
    let heights = [a, b, c].map(height);
    let low = heights.into_iter().fold(f64::INFINITY, f64::min);
    let high = heights.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let sides = [minus(a, b), minus(b, c), minus(c, a)];
    let longest = sides.into_iter().map(|side| dot(side, side)).fold(0.0, f64::max);
    // The ellipsoid bends most along the meridian at the equator.
    [low - longest / (6.0 * (B * B / A + low.min(0.0))), high]
}

/// Checks that the lower height of a tile is that of a vertex.
pub fn lowest(id: ProofTileId, tile: &DecodedTile, faults: &mut TilesetFaults) {
    let is_lower = tile.vertices.iter().all(|vertex| vertex[2] > 0);
    faults.add(TilesetFault::LooseHeights, u64::from(is_lower), id);
}

/// Checks that the metadata of terrane's own tiles is tight: sphere and centre in the middle of the bounding box, and the
/// horizon occlusion point above it, no higher than necessary. Returns the required radius of the sphere.
pub fn tight(
    id: ProofTileId,
    tile: &StatedTileMetadata,
    centre: Option<Vector>,
    positions: &[Vector],
    faults: &mut TilesetFaults,
) -> f64 {
    let middle = middle_of_box(positions);
    let is_off = distance(tile.sphere.0, middle) > LOOSE;
    faults.add(TilesetFault::OffSphere, u64::from(is_off), id);
    let is_off = centre.is_some_and(|centre| distance(centre, middle) > LOOSE);
    faults.add(TilesetFault::Centre, u64::from(is_off), id);
    let radius = positions.iter().map(|&at| distance(at, middle)).fold(0.0, f64::max);
    let is_loose = centre.is_some() && tile.sphere.1 > radius + LOOSE;
    faults.add(TilesetFault::LooseSphere, u64::from(is_loose), id);
    let up = scaled(middle, shrinkage(tile));
    let far = length(tile.horizon);
    let sine = length(cross(tile.horizon, up)) / (far * length(up));
    let is_tight = sine < OF_HORIZON
        && dot(tile.horizon, up) > 0.0
        && far > min_horizon(tile, positions, -SLACK) * (1.0 - OF_HORIZON)
        && far < min_horizon(tile, positions, SLACK) * (1.0 + OF_HORIZON);
    faults.add(TilesetFault::FarHorizon, u64::from(!is_tight), id);
    radius
}

/// Middle of the bounding box of positions.
fn middle_of_box(positions: &[Vector]) -> Vector {
    std::array::from_fn(|axis| {
        let along = positions.iter().map(|at| at[axis]);
        let low = along.clone().reduce(f64::min).unwrap_or_default();
        low.midpoint(along.reduce(f64::max).unwrap_or_default())
    })
}

/// Distance of the nearest point in the direction of the horizon occlusion point that hides all positions, lifted by so
/// many metres.
fn min_horizon(tile: &StatedTileMetadata, positions: &[Vector], lift: f64) -> f64 {
    let both = [0.0, shrinkage(tile)];
    let vertices = positions.iter().flat_map(|&at| both.map(|by| lifted(scaled(at, by), lift)));
    vertices.map(|vertex| min_distance(tile.horizon, vertex, ALWAYS)).fold(1.0, f64::max)
}

/// Checks the bounding sphere, the height range and the horizon occlusion point of a tile against its vertices, and its
/// centre against the sphere.
pub fn contain(
    id: ProofTileId,
    tile: &StatedTileMetadata,
    centre: Option<Vector>,
    positions: &[Vector],
    faults: &mut TilesetFaults,
) {
    let (middle, radius) = tile.sphere;
    let max = radius + SLACK;
    let outside = positions.iter().filter(|&&at| distance(at, middle) > max).count();
    // A radius below zero or NaN contains nothing.
    let outside = if radius >= 0.0 { outside } else { positions.len() };
    faults.add(TilesetFault::Sphere, outside as u64, id);
    let is_far = centre.is_some_and(|centre| distance(centre, middle) > 2.0 * radius + SLACK);
    faults.add(TilesetFault::Centre, u64::from(is_far), id);
    faults.add(TilesetFault::Range, u64::from(tile.heights[0] > tile.heights[1]), id);
    let both = [0.0, shrinkage(tile)];
    let visible = positions
        .iter()
        .filter(|&&at| both.iter().any(|by| is_visible(tile.horizon, scaled(at, *by))));
    faults.add(TilesetFault::Horizon, visible.count() as u64, id);
}

fn distance(a: Vector, b: Vector) -> f64 {
    length(minus(a, b))
}

/// Metres that clients shrink the axes by (added, so at most 0): the lowest height, if that is below zero.
fn shrinkage(tile: &StatedTileMetadata) -> f64 {
    let low = tile.heights[0];
    if low < 0.0 && -low < B { low } else { 0.0 }
}

fn scaled([x, y, z]: Vector, by: f64) -> Vector {
    [x / (A + by), y / (A + by), z / (B + by)]
}

/// A position `by` metres higher. The angle to the horizon is proportional to the root of the height, so rounding of
/// heights near zero is amplified.
fn lifted(at: Vector, by: f64) -> Vector {
    at.map(|axis| axis * (1.0 + by / B))
}

/// True if `vertex` is visible from somewhere where `point` is hidden.
fn is_visible(point: Vector, vertex: Vector) -> bool {
    let (far, min) = (length(point), min_distance(point, lifted(vertex, -SLACK), FAR));
    far.is_nan() || min.is_nan() || far < min * (1.0 - ROUNDING)
}

/// Smallest distance of a point in the direction of `point` that is visible wherever a vertex is; at most `max`.
fn min_distance(point: Vector, vertex: Vector, max: f64) -> f64 {
    let [far, high] = [point, vertex].map(length);
    let [sin, cos] =
        [length(cross(point, vertex)), dot(point, vertex)].map(|product| product / (far * high));
    let cap = 1.0 / high.max(1.0);
    // Cosine of the sum of the angle and the cap.
    let sum = cos * cap - sin * (1.0 - cap * cap).sqrt();
    if sum > 1.0 / max { 1.0 / sum } else { max }
}
