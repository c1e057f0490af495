//! One tile of 3D Tiles from its bytes: binary glTF 2.0 with one mesh. What a client of terrain cannot take is
//! refused; what it would take and is wrong is noted as a fault.
//!
//! Vertices are earth-centred. Each says its place in the tile by its texture coordinates, in [`LAST`] steps, and its
//! height is taken for the nearest whole number of the steps of its level: then it has to be on the lattice of the
//! level, and no further from where the three put it than rounding to that lattice may move it.
//!
//! Compressed tiles have positions in whole steps, or in parts of 65,535 of a multiple of it (which is taken for the
//! step, exactly), and normals in bytes.

use super::decode::DecodedTile;
use super::ellipsoid::{ProofMeridian, ProofParallel, Vector, dot, length, minus, plus};
use super::fault::TilesetFault;
use super::glb::{
    ProofAccessorNumbers, ProofGlbFile, ProofGltfAttributes, TileEdgeAccessors, bad, refuse,
};
use super::skirt::{SkirtSplit, TileSkirt};
use super::tiling::{LAST, ProofTileId, ProofTileSide};
use terrane_base::error::Result;

/// Metres that computing a place may be off by.
const COMPUTED: f64 = 1e-7;
/// By how much the length of a normal may differ from 1.
const OF_NORMAL: f64 = 1e-5;
/// The same of one in bytes.
const OF_SHORT_NORMAL: f64 = 0.01;
/// Part of a step that a place may be beside one, being in single precision.
const OF_STEP: f64 = 0.01;

/// From y up to z up and no other turn, by columns, for positions in so many metres.
fn upwards(metres: f64) -> [[f64; 4]; 3] {
    [[metres, 0.0, 0.0, 0.0], [0.0, 0.0, -metres, 0.0], [0.0, metres, 0.0, 0.0]]
}

/// What a set says of the tiles of a level.
#[derive(Clone, Copy, Debug, Default)]
pub struct StatedTileLevel {
    /// Metres of a step of heights.
    pub step: f64,
    /// Metres of a step of coordinates.
    pub lattice: f64,
    /// Sides are listed.
    pub has_edges: bool,
    /// Metres that skirts hang down, where there are such.
    pub skirt: Option<f64>,
}

/// A tile as it is stored.
#[derive(Clone, Debug, Default)]
pub struct GlbTileContent {
    /// What positions are counted from.
    centre: Vector,
    /// Metres of what positions are counted in.
    metres: f64,
    positions: Vec<[f64; 3]>,
    places: Vec<[f64; 2]>,
    normals: Option<Vec<[f64; 3]>>,
    /// By how much the length of a normal may differ from 1.
    of_normal: f64,
    triangles: Vec<[u32; 3]>,
    /// Vertices said to be on each side, in the order of [`ProofTileSide::ALL`].
    sides: Option<[Vec<u32>; 4]>,
    /// True where the ends that the positions are said to have are not theirs.
    has_other_ends: bool,
}

impl GlbTileContent {
    /// Reads a tile, whose number of vertices `fit` is asked about before there is room for them.
    ///
    /// # Errors
    /// Bad input: bytes that are no binary glTF, and what does not fit together in one. Unsupported: what clients of
    /// terrain do not take. Those of `fit`.
    pub fn read(bytes: &[u8], fit: impl FnOnce(usize) -> Result<()>) -> Result<Self> {
        let file = ProofGlbFile::of(bytes)?;
        let node = file.node()?;
        let matrix = node.matrix.ok_or_else(|| refuse("has a node without a matrix"))?;
        let (columns, _) = matrix.as_chunks::<4>();
        let scale = columns[0][0];
        let is_turned = columns[..3] != upwards(scale) || scale <= 0.0 || columns[3][3] != 1.0;
        if is_turned || matrix.iter().any(|value| !value.is_finite()) {
            return Err(refuse("has a node that is turned or scaled other than from y up"));
        }
        let primitive = file.primitive(node)?;
        let ProofGltfAttributes { position, place, normal } = primitive.attributes;
        let count = file.accessor(position)?.count;
        fit(count)?;
        let place = place.ok_or_else(|| refuse("has no texture coordinates, which say places"))?;
        let indices = primitive.indices.ok_or_else(|| refuse("has triangles without indices"))?;
        let corners = file.indices(indices, count)?;
        let (triangles, rest) = corners.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(bad(format!("has {} corners, which are no triangles", corners.len())));
        }
        let side = |accessor: usize| file.indices(accessor, count);
        let sides = match &primitive.extensions.edges {
            Some(TileEdgeAccessors { left, bottom, right, top }) => {
                Some([side(*left)?, side(*bottom)?, side(*right)?, side(*top)?])
            }
            None => None,
        };
        let positions = file.vectors::<3>(position, "VEC3", count)?;
        let normals = normal.map(|normal| file.vectors(normal, "VEC3", count)).transpose()?;
        let is_whole = normals.as_ref().is_some_and(|normals| normals.whole.is_some());
        Ok(Self {
            centre: [columns[3][0], -columns[3][2], columns[3][1]],
            has_other_ends: !file.accessor(position)?.has_ends(&positions.stored),
            metres: positions.whole.map_or(scale, |whole| scale / whole),
            positions: positions.stored,
            places: file.vectors(place, "VEC2", count)?.into_values(),
            normals: normals.map(ProofAccessorNumbers::into_values),
            of_normal: if is_whole { OF_SHORT_NORMAL } else { OF_NORMAL },
            triangles: triangles.to_vec(),
            sides,
        })
    }

    /// The tile as a level says it is.
    ///
    /// # Errors
    /// Heights further apart than a tile may have.
    pub fn tile(self, id: ProofTileId, as_said: StatedTileLevel) -> Result<DecodedTile> {
        let StatedTileLevel { step, lattice, has_edges, skirt } = as_said;
        let at = |offset: &Vector| plus(self.centre, offset.map(|value| value * self.metres));
        let placed: Vec<Vector> = self.positions.iter().map(at).collect();
        let mut off_place = 0;
        let mut found: Vec<([u16; 2], f64)> = Vec::with_capacity(placed.len());
        for (place, at) in self.places.iter().zip(&placed) {
            let [u, v] = place.map(|part| part * f64::from(LAST));
            let stops = [u, f64::from(LAST) - v];
            let is_stop = stops.iter().all(|stop| {
                (stop - stop.round()).abs() < OF_STEP
                    && (0.0..=f64::from(LAST)).contains(&stop.round())
            });
            let stop = stops.map(|stop| stop.round() as u16);
            let [longitude, latitude] = DecodedTile::place(id, [stop[0], stop[1], 0]);
            let (parallel, meridian) = (ProofParallel::at(latitude), ProofMeridian::at(longitude));
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
        let apart = skirt.map(|_| SkirtSplit::of(&found, &self.triangles));
        let depth = skirt.map(|depth| depth / step);
        let off_depth =
            apart.iter().zip(depth).map(|(apart, depth)| apart.off_depth(&found, depth)).sum();
        let faults = vec![
            (TilesetFault::SkirtDepth, off_depth),
            (TilesetFault::SkirtTorn, apart.iter().map(SkirtSplit::torn).sum()),
            (TilesetFault::OffPlace, off_place),
            (TilesetFault::OffCoordinates, off_lattice),
            (TilesetFault::Ends, u64::from(self.has_other_ends)),
            (TilesetFault::Normals, turned),
            (TilesetFault::NoEdges, u64::from(lacks_edges)),
            (TilesetFault::Unannounced, u64::from(!has_edges && self.sides.is_some())),
            (TilesetFault::WalkedOtherwise, self.walked_otherwise(&vertices)),
        ];
        let is_rim =
            |number: &u32| apart.as_ref().is_none_or(|apart| !apart.is_low[*number as usize]);
        let on_side = |side: ProofTileSide| {
            let all = (0..).zip(&vertices).filter(|(_, vertex)| DecodedTile::is_on(**vertex, side));
            all.map(|(number, _)| number).filter(is_rim).collect()
        };
        let low = lowest * step;
        let tile = DecodedTile {
            centre: self.centre,
            heights: [low as f32, (low + step * f64::from(LAST)) as f32],
            triangles: self.triangles,
            sides: self.sides.unwrap_or_else(|| ProofTileSide::ALL.map(on_side)),
            normals: self.normals.map(|_| Vec::new()),
            vertices,
            placed,
            faults,
            ..DecodedTile::default()
        };
        Ok(apart.map_or(tile.clone(), |apart| without_skirt(tile, apart)))
    }

    /// Normals that are not outward, or not of length 1.
    fn turned(&self, id: ProofTileId, vertices: &[[u16; 3]]) -> u64 {
        let is_turned = |(normal, vertex): &(&Vector, &[u16; 3])| {
            let [longitude, latitude] = DecodedTile::place(id, **vertex);
            let up = ProofParallel::at(latitude).normal(ProofMeridian::at(longitude));
            let is_unit = (length(**normal) - 1.0).abs() < self.of_normal;
            !is_unit || dot(**normal, up) <= 0.0
        };
        self.normals.iter().flatten().zip(vertices).filter(is_turned).count() as u64
    }

    /// Lists of sides that do not run around the tile with the tile on the right, as clients expect that hang skirts.
    fn walked_otherwise(&self, vertices: &[[u16; 3]]) -> u64 {
        let Some(sides) = &self.sides else { return 0 };
        let is_other = |side: &ProofTileSide| {
            let along = |vertex: &u32| {
                let [u, v, _] = vertices[*vertex as usize];
                if side.is_meridian() { v } else { u }
            };
            let mut stops: Vec<u16> = sides[*side as usize].iter().map(along).collect();
            if matches!(side, ProofTileSide::South | ProofTileSide::East) {
                stops.reverse();
            }
            !stops.is_sorted()
        };
        ProofTileSide::ALL.iter().filter(|side| is_other(side)).count() as u64
    }
}

/// A tile whose vertices and triangles are those of its surface, with its skirt apart.
fn without_skirt(tile: DecodedTile, apart: SkirtSplit) -> DecodedTile {
    let mut numbers = vec![u32::MAX; tile.vertices.len()];
    let kept: Vec<usize> = (0..numbers.len()).filter(|vertex| !apart.is_low[*vertex]).collect();
    for (number, vertex) in (0..).zip(&kept) {
        numbers[*vertex] = number;
    }
    // A side that names a vertex of the skirt names none that is there.
    let renumbered = |vertex: &u32| numbers[*vertex as usize];
    let of_skirt = |corners: &[u32; 3]| corners.map(|corner| tile.placed[corner as usize]);
    DecodedTile {
        skirt: TileSkirt { triangles: apart.hanging.iter().map(of_skirt).collect() },
        vertices: kept.iter().map(|vertex| tile.vertices[*vertex]).collect(),
        placed: kept.iter().map(|vertex| tile.placed[*vertex]).collect(),
        triangles: apart.surface.iter().map(|corners| corners.each_ref().map(renumbered)).collect(),
        sides: tile.sides.each_ref().map(|side| side.iter().map(renumbered).collect()),
        ..tile
    }
}
