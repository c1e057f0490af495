//! One tile of 3D Tiles from its bytes: binary glTF 2.0 with one mesh. What a client of terrain cannot take is
//! refused; what it would take and is wrong is noted as a fault.
//!
//! Vertices are earth-centred. Each says its place in the tile by its texture coordinates, in [`LAST`] steps, and its
//! height is taken for the nearest whole number of the steps of its level: then it has to be on the lattice of the
//! level, and no further from where the three put it than rounding to that lattice may move it.

use serde::Deserialize;

use super::decode::{LAST, Tile};
use super::ellipsoid::{Meridian, Parallel, Vector, dot, length, minus, plus};
use super::fault::Fault;
use super::tiling::{Side, TileId};
use terrane_base::error::{Error, ErrorKind, Result};

/// Metres that computing a place may be off by.
const COMPUTED: f64 = 1e-7;
/// By how much the length of a normal may differ from 1.
const OF_NORMAL: f64 = 1e-5;
/// Part of a step that a place may be beside one, being in single precision.
const OF_STEP: f64 = 0.01;

const FLOAT: u32 = 5126;
const U16: u32 = 5123;
const U32: u32 = 5125;

/// From y up to z up and no other turn, by columns.
const UP: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0]];

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Gltf {
    asset: Asset,
    #[serde(default)]
    extensions_required: Vec<String>,
    #[serde(default)]
    scene: usize,
    scenes: Vec<Scene>,
    nodes: Vec<Node>,
    meshes: Vec<Mesh>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<View>,
    buffers: Vec<Buffer>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

#[derive(Deserialize)]
struct Scene {
    nodes: Vec<usize>,
}

#[derive(Deserialize)]
struct Node {
    mesh: Option<usize>,
    matrix: Option<[f64; 16]>,
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    mode: Option<u32>,
    #[serde(default)]
    extensions: Extensions,
}

#[derive(Deserialize)]
#[serde(rename_all = "UPPERCASE")]
struct Attributes {
    position: usize,
    #[serde(rename = "TEXCOORD_0")]
    place: Option<usize>,
    normal: Option<usize>,
}

#[derive(Default, Deserialize)]
struct Extensions {
    #[serde(rename = "CESIUM_tile_edges")]
    edges: Option<Edges>,
}

#[derive(Deserialize)]
struct Edges {
    left: usize,
    bottom: usize,
    right: usize,
    top: usize,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    count: usize,
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    normalized: bool,
    sparse: Option<serde::de::IgnoredAny>,
    min: Option<Vec<f64>>,
    max: Option<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Buffer {
    byte_length: usize,
    uri: Option<String>,
}

/// The two parts of a file, and what the first says of the second.
struct File<'a> {
    gltf: Gltf,
    bytes: &'a [u8],
}

/// A tile as it is stored.
#[derive(Clone, Debug, Default)]
pub struct Content {
    /// What positions are counted from.
    centre: Vector,
    positions: Vec<[f32; 3]>,
    places: Vec<[f32; 2]>,
    normals: Option<Vec<[f32; 3]>>,
    triangles: Vec<[u32; 3]>,
    /// Vertices said to be on each side, in the order of [`Side::ALL`].
    sides: Option<[Vec<u32>; 4]>,
    /// True where the ends that the positions are said to have are not theirs.
    has_other_ends: bool,
}

impl Content {
    /// Reads a tile of `most` vertices at the most.
    ///
    /// # Errors
    /// Bad input: bytes that are no binary glTF, and what does not fit together in one. Unsupported: what clients of
    /// terrain do not take. Resource: more vertices.
    pub fn read(bytes: &[u8], most: usize) -> Result<Self> {
        let file = File::of(bytes)?;
        let node = file.node()?;
        let matrix = node.matrix.ok_or_else(|| refuse("has a node without a matrix"))?;
        let (columns, _) = matrix.as_chunks::<4>();
        let is_turned = columns[..3] != UP || columns[3][3] != 1.0;
        if is_turned || matrix.iter().any(|value| !value.is_finite()) {
            return Err(refuse("has a node that is turned or scaled other than from y up"));
        }
        let primitive = file.primitive(node)?;
        let Attributes { position, place, normal } = primitive.attributes;
        let count = file.accessor(position)?.count;
        if count > most {
            let message = format!("has {count} vertices, and {most} fit into memory");
            return Err(Error::new(ErrorKind::Resource, message).remedy("raise --memory"));
        }
        let place = place.ok_or_else(|| refuse("has no texture coordinates, which say places"))?;
        let indices = primitive.indices.ok_or_else(|| refuse("has triangles without indices"))?;
        let corners = file.indices(indices, count)?;
        let (triangles, rest) = corners.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(bad(format!("has {} corners, which are no triangles", corners.len())));
        }
        let side = |accessor: usize| file.indices(accessor, count);
        let sides = match &primitive.extensions.edges {
            Some(Edges { left, bottom, right, top }) => {
                Some([side(*left)?, side(*bottom)?, side(*right)?, side(*top)?])
            }
            None => None,
        };
        let positions = file.vectors::<3>(position, "VEC3", count)?;
        Ok(Self {
            centre: [columns[3][0], -columns[3][2], columns[3][1]],
            has_other_ends: !file.accessor(position)?.has_ends(&positions),
            places: file.vectors(place, "VEC2", count)?,
            normals: normal.map(|normal| file.vectors(normal, "VEC3", count)).transpose()?,
            triangles: triangles.to_vec(),
            sides,
            positions,
        })
    }

    /// The tile, of a level with these steps of heights and of coordinates; with `has_edges`, its sides are to be
    /// listed.
    ///
    /// # Errors
    /// Heights further apart than a tile may have.
    pub fn tile(self, id: TileId, (step, lattice): (f64, f64), has_edges: bool) -> Result<Tile> {
        let at = |offset: &[f32; 3]| plus(self.centre, offset.map(f64::from));
        let placed: Vec<Vector> = self.positions.iter().map(at).collect();
        let mut off_place = 0;
        let mut found: Vec<([u16; 2], f64)> = Vec::with_capacity(placed.len());
        for (place, at) in self.places.iter().zip(&placed) {
            let [u, v] = place.map(|part| f64::from(part) * f64::from(LAST));
            let stops = [u, f64::from(LAST) - v];
            let is_stop = stops.iter().all(|stop| {
                (stop - stop.round()).abs() < OF_STEP
                    && (0.0..=f64::from(LAST)).contains(&stop.round())
            });
            let stop = stops.map(|stop| stop.round() as u16);
            let [longitude, latitude] = Tile::place(id, [stop[0], stop[1], 0]);
            let (parallel, meridian) = (Parallel::at(latitude), Meridian::at(longitude));
            let up = dot(minus(*at, parallel.position(meridian, 0.0)), parallel.normal(meridian));
            let height = (up / step).round();
            let off = minus(*at, parallel.position(meridian, height * step));
            let is_near = off.iter().all(|off| off.abs() <= lattice / 2.0 + COMPUTED);
            off_place += u64::from(!(is_stop && is_near));
            found.push((stop, height));
        }
        let is_off = |at: &&Vector| at.iter().any(|value| (value / lattice).fract() != 0.0);
        let off_lattice = placed.iter().filter(is_off).count() as u64;
        let lowest = found.iter().map(|(_, height)| *height).fold(f64::INFINITY, f64::min);
        let vertex = |&([u, v], height): &([u16; 2], f64)| {
            let steps = height - lowest;
            let fits = steps <= f64::from(LAST);
            fits.then_some([u, v, steps as u16])
        };
        let vertices: Option<Vec<[u16; 3]>> = found.iter().map(vertex).collect();
        let vertices =
            vertices.ok_or_else(|| bad("has heights too far apart for its level".to_owned()))?;
        let turned = self.turned(id, &vertices);
        let lacks_edges = has_edges && self.sides.is_none();
        let faults = vec![
            (Fault::OffPlace, off_place),
            (Fault::OffCoordinates, off_lattice),
            (Fault::Ends, u64::from(self.has_other_ends)),
            (Fault::Normals, turned),
            (Fault::NoEdges, u64::from(lacks_edges)),
            (Fault::WalkedOtherwise, self.walked_otherwise(&vertices)),
        ];
        let on_side = |side: Side| {
            let all = (0..).zip(&vertices).filter(|(_, vertex)| Tile::is_on(**vertex, side));
            all.map(|(number, _)| number).collect()
        };
        let low = lowest * step;
        Ok(Tile {
            centre: self.centre,
            heights: [low as f32, (low + step * f64::from(LAST)) as f32],
            triangles: self.triangles,
            sides: self.sides.unwrap_or_else(|| Side::ALL.map(on_side)),
            normals: self.normals.map(|_| Vec::new()),
            vertices,
            placed,
            faults,
            ..Tile::default()
        })
    }

    /// Normals that are not outward, or not of length 1.
    fn turned(&self, id: TileId, vertices: &[[u16; 3]]) -> u64 {
        let is_turned = |(normal, vertex): &(&[f32; 3], &[u16; 3])| {
            let [longitude, latitude] = Tile::place(id, **vertex);
            let up = Parallel::at(latitude).normal(Meridian::at(longitude));
            let normal = normal.map(f64::from);
            let is_unit = (length(normal) - 1.0).abs() < OF_NORMAL;
            !is_unit || dot(normal, up) <= 0.0
        };
        self.normals.iter().flatten().zip(vertices).filter(is_turned).count() as u64
    }

    /// Lists of sides that do not run around the tile with the tile on the right, as clients expect that hang skirts.
    fn walked_otherwise(&self, vertices: &[[u16; 3]]) -> u64 {
        let Some(sides) = &self.sides else { return 0 };
        let is_other = |side: &Side| {
            let along = |vertex: &u32| {
                let [u, v, _] = vertices[*vertex as usize];
                if side.is_meridian() { v } else { u }
            };
            let mut stops: Vec<u16> = sides[*side as usize].iter().map(along).collect();
            if matches!(side, Side::South | Side::East) {
                stops.reverse();
            }
            !stops.is_sorted()
        };
        Side::ALL.iter().filter(|side| is_other(side)).count() as u64
    }
}

impl<'a> File<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self> {
        let number = |at: usize| {
            let found = bytes.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
            found.map(|bytes| u32::from_le_bytes(bytes) as usize)
        };
        if bytes.get(..4) != Some(b"glTF") || number(4) != Some(2) {
            return Err(bad("is no binary glTF 2.0".to_owned()));
        }
        if number(8) != Some(bytes.len()) {
            return Err(bad(format!("has {} bytes, and says otherwise", bytes.len())));
        }
        let chunk = |at: usize, kind: &[u8]| {
            let end = number(at)?.checked_add(at + 8)?;
            let is_kind = bytes.get(at + 4..at + 8) == Some(kind);
            bytes.get(at + 8..end).filter(|_| is_kind)
        };
        let torn = || bad("has not the two chunks that it should".to_owned());
        let text = chunk(12, b"JSON").ok_or_else(torn)?;
        let at = 20 + text.len();
        let buffer = chunk(at, b"BIN\0").ok_or_else(torn)?;
        if at + 8 + buffer.len() != bytes.len() || !text.len().is_multiple_of(4) {
            return Err(torn());
        }
        let gltf: Gltf = serde_json::from_slice(text)
            .map_err(|e| bad(format!("has a text that is not understood: {e}")))?;
        let file = Self { gltf, bytes: buffer };
        file.check()?;
        Ok(file)
    }

    fn check(&self) -> Result<()> {
        if !self.gltf.asset.version.starts_with("2.") {
            return Err(refuse("is of another version than 2"));
        }
        if let Some(name) = self.gltf.extensions_required.first() {
            return Err(refuse(&format!("needs the extension {name:?}")));
        }
        match &self.gltf.buffers[..] {
            [Buffer { byte_length, uri: None }]
                if byte_length.next_multiple_of(4) == self.bytes.len() =>
            {
                Ok(())
            }
            _ => Err(bad("has another buffer than its second chunk".to_owned())),
        }
    }

    fn node(&self) -> Result<&Node> {
        let gltf = &self.gltf;
        let is_one = gltf.nodes.len() == 1 && gltf.meshes.len() == 1;
        let is_shown = gltf.scenes.get(gltf.scene).is_some_and(|scene| scene.nodes == [0]);
        match is_one && is_shown {
            true => Ok(&gltf.nodes[0]),
            false => Err(refuse("has not one node with one mesh")),
        }
    }

    fn primitive(&self, node: &Node) -> Result<&Primitive> {
        let mesh = node.mesh.and_then(|mesh| self.gltf.meshes.get(mesh));
        match mesh.map(|mesh| &mesh.primitives[..]) {
            Some([primitive]) if primitive.mode.is_none_or(|mode| mode == 4) => Ok(primitive),
            _ => Err(refuse("has not one mesh of one set of triangles")),
        }
    }

    fn accessor(&self, number: usize) -> Result<&Accessor> {
        let none = || bad(format!("names accessor {number} of {}", self.gltf.accessors.len()));
        self.gltf.accessors.get(number).ok_or_else(none)
    }

    /// The bytes of an accessor whose elements lie one after another.
    fn elements(&self, number: usize, (kind, bytes): (&str, usize)) -> Result<&[u8]> {
        let accessor = self.accessor(number)?;
        if accessor.kind != kind || accessor.normalized || accessor.sparse.is_some() {
            return Err(refuse(&format!("has an accessor {number} of another kind than {kind}")));
        }
        let view = accessor.buffer_view.and_then(|view| self.gltf.buffer_views.get(view));
        let view = view.ok_or_else(|| bad(format!("has accessor {number} in no buffer view")))?;
        if view.byte_stride.is_some_and(|stride| stride != bytes) {
            return Err(refuse(&format!("has an accessor {number} with gaps")));
        }
        let found = || {
            let end = view.byte_offset.checked_add(view.byte_length)?;
            let view = self.bytes.get(view.byte_offset..end).filter(|_| view.buffer == 0)?;
            let length = accessor.count.checked_mul(bytes)?;
            view.get(accessor.byte_offset..accessor.byte_offset.checked_add(length)?)
        };
        found().ok_or_else(|| bad(format!("has accessor {number} outside of its buffer")))
    }

    fn vectors<const N: usize>(
        &self,
        number: usize,
        kind: &str,
        count: usize,
    ) -> Result<Vec<[f32; N]>> {
        let accessor = self.accessor(number)?;
        if accessor.component_type != FLOAT {
            return Err(refuse(&format!("has an accessor {number} that is not of floats")));
        }
        if accessor.count != count {
            let found = accessor.count;
            return Err(bad(format!("has {found} elements in accessor {number}, not {count}")));
        }
        let bytes = self.elements(number, (kind, 4 * N))?;
        let (floats, _) = bytes.as_chunks::<4>();
        let floats: Vec<f32> = floats.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        if floats.iter().any(|value| !value.is_finite()) {
            return Err(bad(format!("has a number in accessor {number} that is not finite")));
        }
        Ok(floats.as_chunks().0.to_vec())
    }

    fn indices(&self, number: usize, count: usize) -> Result<Vec<u32>> {
        let found: Vec<u32> = match self.accessor(number)?.component_type {
            U16 => {
                let (all, _) = self.elements(number, ("SCALAR", 2))?.as_chunks::<2>();
                all.iter().map(|bytes| u16::from_le_bytes(*bytes).into()).collect()
            }
            U32 => {
                let (all, _) = self.elements(number, ("SCALAR", 4))?.as_chunks::<4>();
                all.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect()
            }
            _ => return Err(refuse(&format!("has indices of another type in accessor {number}"))),
        };
        match found.iter().find(|&&index| index as usize >= count) {
            Some(index) => Err(bad(format!("names vertex {index} of {count}"))),
            None => Ok(found),
        }
    }
}

impl Accessor {
    /// Whether it says the ends of its elements.
    fn has_ends(&self, elements: &[[f32; 3]]) -> bool {
        let along = |axis: usize| elements.iter().map(move |element| element[axis]);
        let is = |said: &Option<Vec<f64>>, choose: fn(f32, f32) -> f32| {
            let said = said.as_deref().unwrap_or_default();
            let found = (0..3).map(|axis| along(axis).reduce(choose));
            said.len() == 3 && found.zip(said).all(|(end, said)| end == Some(*said as f32))
        };
        is(&self.min, f32::min) && is(&self.max, f32::max)
    }
}

fn bad(message: String) -> Error {
    Error::bad_input(message)
}

fn refuse(message: &str) -> Error {
    Error::unsupported(message.to_owned())
}
