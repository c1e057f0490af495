//! The bytes of a tile as binary glTF 2.0, the content of 3D Tiles 1.1: one mesh in earth-centred metres from its
//! middle, in single precision; and what the set has to tell of it.
//!
//! Vertices lie on the lattice of the level ([`Level::on_lattice`]), and so does the middle that they are counted
//! from: single precision is exact, and what was measured is what clients decode.

use crate::border::Side;
use crate::encode::{Heights, in_order, normal};
use crate::globe::{EQUATOR, POLE, Vector};
use crate::ground::Ground;
use crate::horizon;
use crate::level::Level;
use crate::surface::{Tile, Vertex};
use crate::tiling::{STEPS, TileId};
use terrane_base::error::{Error, ErrorKind, Result};

/// The least radius of the ellipsoid's bend: that of a meridian at the equator.
const BEND: f64 = POLE * POLE / EQUATOR;
/// Vertices that two bytes can number: the last number stands for none.
const SHORT: usize = u16::MAX as usize;

const MAGIC: &[u8; 4] = b"glTF";
const ARRAYS: u32 = 34962;
const INDICES: u32 = 34963;
const FLOAT: u32 = 5126;
const U16: u32 = 5123;
const U32: u32 = 5125;

/// What a set of tiles tells of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facts {
    /// Which.
    pub id: TileId,
    /// Metres from the ellipsoid that no place of its triangles is below or above.
    pub heights: [f64; 2],
    /// Middle and radius of a sphere around its triangles.
    pub sphere: (Vector, f64),
    /// The point that is below the horizon only where all of the tile is, in radii of the ellipsoid.
    pub occlusion: Vector,
    /// Metres that no sample is further from it.
    pub error: f64,
}

impl Facts {
    fn of(tile: &Tile, lattice: f64, points: &[Vector]) -> Self {
        let (centre, radius) = horizon::sphere(points);
        let lowest = tile.triangles.iter().map(|corners| lowest(tile, points, *corners));
        let highest = tile.vertices.iter().map(|vertex| vertex.height).max().unwrap_or(0);
        // The ellipsoid is convex, so nothing of a triangle is higher than its corners.
        let highest = f64::from(highest) * tile.step + lattice;
        let heights = [lowest.fold(f64::INFINITY, f64::min) - lattice, highest];
        let occlusion = horizon::occlusion(centre, points, heights[0]);
        let error = tile.measure.largest;
        Self { id: tile.id, heights, sphere: (centre, radius), occlusion, error }
    }

    /// All but the tile, as numbers.
    pub fn numbers(&self) -> [f64; 10] {
        let ([low, high], ([x, y, z], radius)) = (self.heights, (self.sphere.0.0, self.sphere.1));
        let [u, v, w] = self.occlusion.0;
        [low, high, x, y, z, radius, u, v, w, self.error]
    }

    /// Those of a tile, of such numbers.
    pub fn of_numbers(id: TileId, numbers: [f64; 10]) -> Self {
        let [low, high, x, y, z, radius, u, v, w, error] = numbers;
        let (sphere, occlusion) = ((Vector([x, y, z]), radius), Vector([u, v, w]));
        Self { id, heights: [low, high], sphere, occlusion, error }
    }

    /// Makes the sphere of a tile hold that of one of its parts, and its error no smaller than that of the part, as
    /// clients expect of them. Heights stay its own: the occlusion point is one for them.
    pub fn hold(&mut self, part: &Self) {
        let ((centre, radius), (beside, least)) = (self.sphere, part.sphere);
        self.sphere.1 = radius.max(((beside - centre).length() + least) * (1.0 + f64::EPSILON));
        self.error = self.error.max(part.error);
    }
}

/// A height that no place of a triangle is below. Heights bend along a line by no more than the ellipsoid does, so a
/// place is lower than its corners by L^2 / 6 R at the most, of the longest side.
fn lowest(tile: &Tile, points: &[Vector], corners: [u32; 3]) -> f64 {
    let heights =
        corners.map(|corner| f64::from(tile.vertices[corner as usize].height) * tile.step);
    let low = heights.into_iter().fold(f64::INFINITY, f64::min);
    let side = |k: usize| points[corners[k] as usize] - points[corners[(k + 1) % 3] as usize];
    let longest = (0..3).map(|k| side(k).dot(side(k))).fold(0.0, f64::max);
    low - longest / (6.0 * (BEND + low.min(0.0)))
}

/// A tile as binary glTF, and what the set tells of it; with `normals`, those of the ground at its vertices, and with
/// `edges`, the vertices of its sides (CESIUM_tile_edges).
///
/// # Errors
/// A tile whose heights have too large a range.
pub fn glb<G: Ground>(
    tile: &Tile,
    normals: Option<(&Level, &G)>,
    edges: bool,
) -> Result<(Vec<u8>, Facts)> {
    let lattice = tile.lattice.ok_or_else(|| {
        Error::new(ErrorKind::Internal, "vertices of a tile are on no lattice of coordinates")
    })?;
    Heights::of(tile)?;
    let points: Vec<Vector> = tile.vertices.iter().map(|vertex| tile.point(*vertex)).collect();
    let facts = Facts::of(tile, lattice, &points);
    let centre = facts.sphere.0.rounded(lattice);
    let (vertices, triangles) = in_order(tile);
    let offset = |vertex: &Vertex| (tile.point(*vertex) - centre).0.map(|value| value as f32);
    let mut parts = Parts::default();
    let positions: Vec<[f32; 3]> = vertices.iter().map(offset).collect();
    let position = parts.vectors("VEC3", &positions, true);
    let part = |at: i32| at as f32 / STEPS as f32;
    // From the top, as images have them.
    let places: Vec<[f32; 2]> =
        vertices.iter().map(|v| [part(v.at[0]), part(STEPS - v.at[1])]).collect();
    let place = parts.vectors("VEC2", &places, false);
    let mut attributes = format!(r#""POSITION":{position},"TEXCOORD_0":{place}"#);
    if let Some((level, ground)) = normals {
        let at = |v: &Vertex| normal(tile.id.place(v.at), level, ground).0.map(|x| x as f32);
        let found: Vec<[f32; 3]> = vertices.iter().map(at).collect();
        attributes += &format!(r#","NORMAL":{}"#, parts.vectors("VEC3", &found, false));
    }
    let is_short = vertices.len() <= SHORT;
    let indices = parts.indices(triangles.as_flattened(), is_short, INDICES);
    let [used, extension] = match edges {
        true => {
            let [left, bottom, right, top] =
                Side::ALL.map(|side| parts.indices(&around(&vertices, side), is_short, 0));
            let lists = format!(r#""left":{left},"bottom":{bottom},"right":{right},"top":{top}"#);
            [
                r#","extensionsUsed":["CESIUM_tile_edges"]"#.to_owned(),
                format!(r#","extensions":{{"CESIUM_tile_edges":{{{lists}}}}}"#),
            ]
        }
        false => [String::new(), String::new()],
    };
    let [x, y, z] = centre.0;
    let json = format!(
        r#"{{"asset":{{"version":"2.0","generator":"terrane"}}{used},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"matrix":[1,0,0,0,0,0,-1,0,0,1,0,0,{x},{z},{},1]}}],"meshes":[{{"primitives":[{{"attributes":{{{attributes}}},"indices":{indices},"material":0,"mode":4{extension}}}]}}],"materials":[{{"pbrMetallicRoughness":{{"metallicFactor":0}}}}],"accessors":[{}],"bufferViews":[{}],"buffers":[{{"byteLength":{}}}]}}"#,
        0.0 - y,
        parts.accessors.join(","),
        parts.views.join(","),
        parts.bytes.len(),
    );
    Ok((chunks(json, parts.bytes), facts))
}

/// The vertices of a side in the order of a walk around the tile with the tile on the right, as clients hang skirts.
fn around(vertices: &[Vertex], side: Side) -> Vec<u32> {
    let on_side = |(i, v): (u32, &Vertex)| side.along(v.at).map(|along| (along, i));
    let mut found: Vec<(i32, u32)> = (0..).zip(vertices).filter_map(on_side).collect();
    found.sort_unstable();
    if matches!(side, Side::South | Side::East) {
        found.reverse();
    }
    found.into_iter().map(|(_, vertex)| vertex).collect()
}

/// The buffer, and what is said of its parts.
#[derive(Default)]
struct Parts {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Parts {
    /// Adds an accessor of all of a new view; its number.
    fn add(&mut self, bytes: &[u8], target: u32, what: String) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let target = if target == 0 { String::new() } else { format!(r#","target":{target}"#) };
        let (offset, length, number) = (self.bytes.len(), bytes.len(), self.views.len());
        self.views
            .push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}{target}}}"#));
        self.accessors.push(format!(r#"{{"bufferView":{number},{what}}}"#));
        self.bytes.extend_from_slice(bytes);
        number
    }

    fn vectors<const N: usize>(
        &mut self,
        kind: &str,
        values: &[[f32; N]],
        has_ends: bool,
    ) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        let end = |choose: fn(f32, f32) -> f32| {
            let along = |axis: usize| values.iter().map(|v| v[axis]).reduce(choose).unwrap_or(0.0);
            std::array::from_fn::<String, N, _>(|axis| along(axis).to_string()).join(",")
        };
        let ends = match has_ends {
            true => format!(r#","min":[{}],"max":[{}]"#, end(f32::min), end(f32::max)),
            false => String::new(),
        };
        let count = values.len();
        let what = format!(r#""componentType":{FLOAT},"count":{count},"type":"{kind}"{ends}"#);
        self.add(&bytes, ARRAYS, what)
    }

    fn indices(&mut self, indices: &[u32], is_short: bool, target: u32) -> usize {
        let bytes: Vec<u8> = match is_short {
            true => indices.iter().flat_map(|index| (*index as u16).to_le_bytes()).collect(),
            false => indices.iter().flat_map(|index| index.to_le_bytes()).collect(),
        };
        let (kind, count) = (if is_short { U16 } else { U32 }, indices.len());
        self.add(
            &bytes,
            target,
            format!(r#""componentType":{kind},"count":{count},"type":"SCALAR""#),
        )
    }
}

/// The two chunks of a file.
fn chunks(json: String, mut bytes: Vec<u8>) -> Vec<u8> {
    let mut text = json.into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let whole = 12 + 8 + text.len() + 8 + bytes.len();
    let mut out = Vec::with_capacity(whole);
    out.extend_from_slice(MAGIC);
    out.extend([2, whole as u32, text.len() as u32].map(u32::to_le_bytes).as_flattened());
    out.extend_from_slice(b"JSON");
    out.extend(text);
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend_from_slice(b"BIN\0");
    out.extend(bytes);
    out
}
