//! A tile as binary glTF 2.0, the content of 3D Tiles 1.1: one mesh in earth-centred metres relative to its
//! centre, in single precision; with the metadata of the tileset.
//!
//! Vertices and the centre lie on the lattice of the level ([`TileLevel::on_lattice`]), so single precision is
//! exact, and clients decode exactly the measured surface.
//!
//! **Why compressed tiles have a coarser lattice.** Coordinates on that lattice exceed 16 bits. A lattice 512
//! times coarser fits nearly all tiles exactly, and is still a quarter of a height step. Compression saves 22 %
//! of the bytes with single-precision positions, and 61 % with 16-bit positions (a degree of SRTM, with gzip).

use crate::border::TileSide;
use crate::encode::{QuantizedHeights, in_order, normal};
use crate::globe::{EQUATOR, POLE, Vector};
use crate::gltf_buffer::{MESHOPT, TileBufferBuilder};
use crate::horizon;
use crate::level::TileLevel;
use crate::skirt::skirted;
use crate::terrain::TerrainSampler;
use crate::tile::{TerrainTile, TileVertex};
use crate::tiling::{GlobeTileId, STEPS};
use terrane_base::error::{Error, ErrorKind, Result};

/// Smallest radius of curvature of the ellipsoid: that of a meridian at the equator.
const BEND: f64 = POLE * POLE / EQUATOR;
/// Largest number of vertices with 16-bit indices; the last index is reserved.
const SHORT: usize = u16::MAX as usize;

const MAGIC: &[u8; 4] = b"glTF";
const EDGES: &str = "CESIUM_tile_edges";
const QUANTIZED: &str = "KHR_mesh_quantization";
/// Number of 16-bit values.
const SHORTS: f64 = u16::MAX as f64;
/// Single precision has 24 bits on either side of the centre of a tile; 16-bit values span the whole tile.
const COARSER: f64 = 512.0;

/// Encoding options of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub struct GlbTileOptions {
    /// Writes the vertices of its sides (CESIUM_tile_edges).
    pub edges: bool,
    /// Compresses (EXT_meshopt_compression); requires a level of [`in_shorts`].
    pub meshopt: bool,
    /// Steps of heights that its skirt hangs down; none where it has none.
    pub skirt: i32,
}

/// A level whose tiles two bytes can number the coordinates of, as far as that is fine enough for its heights; those
/// of larger tiles are written in single precision, and those of steep ground, whose vertices would be rounded across each
/// other.
pub fn in_shorts(level: TileLevel) -> TileLevel {
    if level.is_steep {
        return level;
    }
    let lattice =
        level.lattice.map(|lattice| (lattice * COARSER).min(level.step / 2.0).max(lattice));
    TileLevel { lattice, ..level }
}

/// Metadata of a tile in a tileset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileMetadata {
    /// Tile.
    pub id: GlobeTileId,
    /// Range of heights of its triangles in metres above the ellipsoid.
    pub heights: [f64; 2],
    /// Centre and radius of a bounding sphere of its triangles.
    pub sphere: (Vector, f64),
    /// Horizon occlusion point in radii of the ellipsoid: below the horizon only if the whole tile is.
    pub occlusion: Vector,
    /// Largest error of a sample in metres.
    pub error: f64,
}

impl TileMetadata {
    fn of(tile: &TerrainTile, lattice: f64, points: &[Vector]) -> Self {
        let (centre, radius) = horizon::sphere(points);
        let lowest = tile.triangles.iter().map(|corners| lowest(tile, points, *corners));
        let highest = tile.vertices.iter().map(|vertex| vertex.height).max().unwrap_or(0);
        // The ellipsoid is convex, so a triangle is nowhere higher than its corners.
        let highest = f64::from(highest) * tile.step + lattice;
        let heights = [lowest.fold(f64::INFINITY, f64::min) - lattice, highest];
        let occlusion = horizon::occlusion(centre, points, heights[0]);
        let error = tile.measure.largest;
        Self { id: tile.id, heights, sphere: (centre, radius), occlusion, error }
    }

    /// All values but the tile.
    pub fn numbers(&self) -> [f64; 10] {
        let ([low, high], ([x, y, z], radius)) = (self.heights, (self.sphere.0.0, self.sphere.1));
        let [u, v, w] = self.occlusion.0;
        [low, high, x, y, z, radius, u, v, w, self.error]
    }

    /// Metadata of a tile from these values.
    pub fn of_numbers(id: GlobeTileId, numbers: [f64; 10]) -> Self {
        let [low, high, x, y, z, radius, u, v, w, error] = numbers;
        let (sphere, occlusion) = ((Vector([x, y, z]), radius), Vector([u, v, w]));
        Self { id, heights: [low, high], sphere, occlusion, error }
    }

    /// Extends the sphere and the error of a tile to those of a child, as clients require. Heights are
    /// unchanged: the occlusion point depends on them.
    pub fn hold(&mut self, child: &Self) {
        let ((centre, radius), (of_child, child_radius)) = (self.sphere, child.sphere);
        // Rounded up, so that the sphere contains that of the child.
        let reach = ((of_child - centre).length() + child_radius) * (1.0 + f64::EPSILON);
        self.sphere.1 = radius.max(reach);
        self.error = self.error.max(child.error);
    }
}

/// Lower bound of heights in a triangle. Heights bend along a line at most as the ellipsoid does, so a position
/// is at most L^2 / 6 R lower than the corners, for the longest side L.
fn lowest(tile: &TerrainTile, points: &[Vector], corners: [u32; 3]) -> f64 {
    let heights =
        corners.map(|corner| f64::from(tile.vertices[corner as usize].height) * tile.step);
    let low = heights.into_iter().fold(f64::INFINITY, f64::min);
    let corners = corners.map(|corner| points[corner as usize]);
    let sides = [0, 1, 2].map(|k| corners[k] - corners[(k + 1) % 3]);
    let longest = sides.iter().map(|side| side.dot(*side)).fold(0.0, f64::max);
    low - longest / (6.0 * (BEND + low.min(0.0)))
}

/// Earth-centred points relative to an origin, in metres.
struct QuantizedPositions {
    from: Vector,
    metres: f64,
    numbers: PositionNumbers,
}

enum PositionNumbers {
    Single(Vec<[f32; 3]>),
    /// Integer steps, normalized on request.
    Short(Vec<[u16; 3]>, bool),
}

impl QuantizedPositions {
    /// Relative to a centre on the lattice.
    fn single(points: &[Vector], from: Vector) -> Self {
        let offsets = points.iter().map(|point| (*point - from).0.map(|value| value as f32));
        Self { from, metres: 1.0, numbers: PositionNumbers::Single(offsets.collect()) }
    }

    /// In lattice steps from the lowest coordinates, if they fit in 16 bits.
    fn short(points: &[Vector], lattice: f64, is_part: bool) -> Option<Self> {
        let from = Vector(std::array::from_fn(|axis| {
            points.iter().map(|p| p.0[axis]).fold(f64::INFINITY, f64::min)
        }));
        let steps = points.iter().map(|point| {
            let steps = (*point - from).0.map(|value| value / lattice);
            steps.iter().all(|steps| *steps <= SHORTS).then(|| steps.map(|steps| steps as u16))
        });
        let steps = steps.collect::<Option<_>>()?;
        let metres = if is_part { lattice * SHORTS } else { lattice };
        Some(Self { from, metres, numbers: PositionNumbers::Short(steps, is_part) })
    }
}

/// A tile as binary glTF with its metadata; with `normals`, those of the ground at its vertices.
///
/// Compressed positions are integer lattice steps. With edges they are fractions of 65,535, the only form
/// supported by the terrain of CesiumJS.
///
/// # Errors
/// A tile with too large a range of heights.
pub fn glb<G: TerrainSampler>(
    tile: &TerrainTile,
    normals: Option<(&TileLevel, &G)>,
    form: GlbTileOptions,
) -> Result<(Vec<u8>, TileMetadata)> {
    let lattice = tile
        .lattice
        .ok_or_else(|| Error::new(ErrorKind::Internal, "vertices of a tile are not quantized"))?;
    let skirted = (form.skirt > 0).then(|| skirted(tile, form.skirt));
    let tile = skirted.as_ref().unwrap_or(tile);
    QuantizedHeights::of(tile)?;
    let points: Vec<Vector> = tile.vertices.iter().map(|vertex| tile.point(*vertex)).collect();
    let facts = TileMetadata::of(tile, lattice, &points);
    let (vertices, triangles) = in_order(tile);
    let points: Vec<Vector> = vertices.iter().map(|vertex| tile.point(*vertex)).collect();
    let short =
        form.meshopt.then(|| QuantizedPositions::short(&points, lattice, form.edges)).flatten();
    let is_packed = short.is_some();
    let counted = short
        .unwrap_or_else(|| QuantizedPositions::single(&points, facts.sphere.0.rounded(lattice)));
    let mut parts = TileBufferBuilder::new(is_packed);
    let mut attributes = placed(&vertices, &counted, &mut parts)?;
    if let Some((level, ground)) = normals {
        let normals = vertices.iter().map(|v| normal(tile.id.place(v.at), level, ground).0);
        let normals: Vec<_> = normals.map(|normal| normal.map(|value| value as f32)).collect();
        let view = match is_packed {
            true => parts.directions(&normals)?,
            false => parts.floats("VEC3", &normals, false)?,
        };
        attributes += &format!(r#","NORMAL":{view}"#);
    }
    let is_short = vertices.len() <= SHORT;
    let indices = parts.triangles(triangles.as_flattened(), is_short)?;
    let mut extension = String::new();
    if form.edges {
        let mut lists = Vec::new();
        for (side, name) in TileSide::ALL.into_iter().zip(["left", "bottom", "right", "top"]) {
            let list = parts.vertices(&around(&vertices, side), is_short)?;
            lists.push(format!(r#""{name}":{list}"#));
        }
        extension = format!(r#","extensions":{{"{EDGES}":{{{}}}}}"#, lists.join(","));
    }
    let ([x, y, z], metres) = (counted.from.0, counted.metres);
    let json = format!(
        r#"{{"asset":{{"version":"2.0","generator":"terrane"}}{},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"matrix":[{metres},0,0,0,0,0,-{metres},0,0,{metres},0,0,{x},{z},{},1]}}],"meshes":[{{"primitives":[{{"attributes":{{{attributes}}},"indices":{indices},"material":0,"mode":4{extension}}}]}}],"materials":[{{"pbrMetallicRoughness":{{"metallicFactor":0}}}}],"accessors":[{}],"bufferViews":[{}],"buffers":[{}]}}"#,
        extensions(form.edges, is_packed),
        0.0 - y,
        parts.accessors.join(","),
        parts.views.join(","),
        parts.buffers(),
    );
    Ok((chunks(json, parts.bytes), facts))
}

/// Adds positions and tile coordinates; returns the attributes.
fn placed(
    vertices: &[TileVertex],
    counted: &QuantizedPositions,
    parts: &mut TileBufferBuilder,
) -> Result<String> {
    // From the top, as in images.
    let steps = vertices.iter().map(|v| [v.at[0], STEPS - v.at[1]]);
    let [position, place] = match &counted.numbers {
        PositionNumbers::Single(offsets) => {
            let places: Vec<_> =
                steps.map(|steps| steps.map(|at| at as f32 / STEPS as f32)).collect();
            [parts.floats("VEC3", offsets, true)?, parts.floats("VEC2", &places, false)?]
        }
        PositionNumbers::Short(counts, is_part) => {
            let places: Vec<_> = steps.map(|steps| steps.map(|at| at as i16)).collect();
            [parts.positions(counts, *is_part)?, parts.shares(&places)?]
        }
    };
    Ok(format!(r#""POSITION":{position},"TEXCOORD_0":{place}"#))
}

/// Used and required extensions of a file.
fn extensions(edges: bool, is_packed: bool) -> String {
    let required: &[&str] = if is_packed { &[MESHOPT, QUANTIZED] } else { &[] };
    let used: Vec<&str> = edges.then_some(EDGES).iter().chain(required).copied().collect();
    name_list("extensionsUsed", &used) + &name_list("extensionsRequired", required)
}

/// A property with a list of names, after others; empty without names.
fn name_list(key: &str, names: &[&str]) -> String {
    match names.is_empty() {
        true => String::new(),
        false => format!(r#","{key}":["{}"]"#, names.join(r#"",""#)),
    }
}

/// Vertices of a side in the order of a walk around the tile with the tile on the right, as clients build
/// skirts; of a vertex and its skirt vertex, the upper one.
fn around(vertices: &[TileVertex], side: TileSide) -> Vec<u32> {
    // Upper vertices first, so that skirt vertices are removed as duplicates.
    let mut on_side: Vec<(i32, i32, u32)> = (0..)
        .zip(vertices)
        .filter_map(|(i, v)| side.along(v.at).map(|along| (along, -v.height, i)))
        .collect();
    on_side.sort_unstable();
    on_side.dedup_by_key(|(along, ..)| *along);
    if matches!(side, TileSide::South | TileSide::East) {
        on_side.reverse();
    }
    on_side.into_iter().map(|(_, _, vertex)| vertex).collect()
}

/// The two chunks of a file.
fn chunks(json: String, mut bytes: Vec<u8>) -> Vec<u8> {
    let mut text = json.into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let length = 12 + 8 + text.len() + 8 + bytes.len();
    let mut out = Vec::with_capacity(length);
    out.extend_from_slice(MAGIC);
    out.extend([2, length as u32, text.len() as u32].map(u32::to_le_bytes).as_flattened());
    out.extend_from_slice(b"JSON");
    out.extend(text);
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend_from_slice(b"BIN\0");
    out.extend(bytes);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_bytes_hold_coordinates_exactly_or_not_at_all() {
        let lattice = 0.0625;
        let low = Vector([4_321_000.5, -7.5, -612.0]);
        let at = |steps: [f64; 3]| low + Vector(steps) * lattice;
        let points = [at([0.0, 65_535.0, 1.0]), at([7.0, 0.0, 3.0]), at([2.0, 5.0, 0.0])];
        for is_part in [false, true] {
            let found = QuantizedPositions::short(&points, lattice, is_part).unwrap();
            let PositionNumbers::Short(steps, told) = found.numbers else {
                panic!("no whole numbers")
            };
            assert!(told == is_part && found.from == low);
            assert_eq!(steps, [[0, 65_535, 1], [7, 0, 3], [2, 5, 0]]);
            // Clients multiply it by the largest number's part.
            assert_eq!(found.metres, if is_part { 4095.9375 } else { lattice });
        }
        let far = [points[0], at([0.0, -1.0, 0.0])];
        assert!(QuantizedPositions::short(&far, lattice, false).is_none());
    }
}
