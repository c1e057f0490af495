//! Decodes a tile of 3D Tiles: binary glTF 2.0 with one mesh. Content that terrain clients do not support is refused; wrong
//! content that they would accept is a fault.
//!
//! Vertices are earth-centred. Texture coordinates give the position in the tile, in [`LAST`] steps, and the height is
//! rounded to the height step of the level. The vertex must be on the lattice of the level, and no further from the position
//! by these three numbers than rounding to the lattice explains.
//!
//! Compressed tiles have positions in steps, or in 1/65,535 of a multiple of the step (which counts as the step, exactly),
//! and normals in bytes.

use super::decode::DecodedTile;
use super::ellipsoid::{ProofMeridian, ProofParallel, Vector, dot, length, minus, plus};
use super::fault::TilesetFault;
use super::glb::{
    ProofAccessorNumbers, ProofGlbFile, ProofGltfAttributes, TileEdgeAccessors, bad, refuse,
};
use super::skirt::{Place, SkirtSplit, TileSkirt};
use super::structure::along;
use super::tiling::{LAST, ProofTileId, ProofTileSide};
use terrane_base::error::Result;

/// Rounding of computed positions in metres.
const COMPUTED: f64 = 1e-7;
/// Tolerance of the length of a normal.
const OF_NORMAL: f64 = 1e-5;
/// Tolerance of the length of a normal in bytes.
const OF_SHORT_NORMAL: f64 = 0.01;
/// Tolerance of texture coordinates in steps: they are in single precision.
const OF_STEP: f64 = 0.01;

/// Columns of the matrix that turns y up to z up and scales by `metres`.
fn upwards(metres: f64) -> [[f64; 4]; 3] {
    [[metres, 0.0, 0.0, 0.0], [0.0, 0.0, -metres, 0.0], [0.0, metres, 0.0, 0.0]]
}

/// Stated metadata of the tiles of a level.
#[derive(Clone, Copy, Debug, Default)]
pub struct StatedTileLevel {
    /// Metres of a step of heights.
    pub step: f64,
    /// Metres of a step of coordinates.
    pub lattice: f64,
    /// Tiles list the vertices of their sides.
    pub has_edges: bool,
    /// Depth of skirts in metres, if tiles have them.
    pub skirt: Option<f64>,
}

/// A tile as it is stored.
#[derive(Clone, Debug, Default)]
pub struct GlbTileContent {
    /// Origin of positions.
    centre: Vector,
    /// Unit of positions in metres.
    metres: f64,
    positions: Vec<[f64; 3]>,
    places: Vec<[f64; 2]>,
    normals: Option<Vec<[f64; 3]>>,
    /// Tolerance of the length of a normal.
    of_normal: f64,
    triangles: Vec<[u32; 3]>,
    /// Vertices said to be on each side, in the order of [`ProofTileSide::ALL`].
    sides: Option<[Vec<u32>; 4]>,
    /// Stated minimum or maximum of positions is wrong.
    has_other_ends: bool,
}

impl GlbTileContent {
    /// Reads a tile. `check_vertices` is called with the number of vertices before memory is allocated for them.
    ///
    /// # Errors
    /// Bad input: bytes of another format, and inconsistent ones. Unsupported: content that terrain clients do not support.
    /// Errors of `check_vertices`.
    pub fn read(bytes: &[u8], check_vertices: impl FnOnce(usize) -> Result<()>) -> Result<Self> {
        let file = ProofGlbFile::of(bytes)?;
        let node = file.node()?;
        let matrix = node.matrix.ok_or_else(|| refuse("node without a matrix"))?;
        let (columns, _) = matrix.as_chunks::<4>();
        let scale = columns[0][0];
        let is_turned = columns[..3] != upwards(scale) || scale <= 0.0 || columns[3][3] != 1.0;
        if is_turned || matrix.iter().any(|value| !value.is_finite()) {
            return Err(refuse("node matrix is not a uniform scale from y up to z up"));
        }
        let primitive = file.primitive(node)?;
        let ProofGltfAttributes { position, place, normal } = primitive.attributes;
        let count = file.accessor(position)?.count;
        check_vertices(count)?;
        let place = place.ok_or_else(|| refuse("texture coordinates are missing"))?;
        let indices = primitive.indices.ok_or_else(|| refuse("triangles without indices"))?;
        let corners = file.indices(indices, count)?;
        let (triangles, rest) = corners.as_chunks::<3>();
        if !rest.is_empty() {
            let count = corners.len();
            return Err(bad(format!("{count} indices, expected three for each triangle")));
        }
        let sides = match &primitive.extensions.edges {
            Some(TileEdgeAccessors { left, bottom, right, top }) => {
                let [west, south, east, north] =
                    [*left, *bottom, *right, *top].map(|accessor| file.indices(accessor, count));
                Some([west?, south?, east?, north?])
            }
            None => None,
        };
        let positions = file.vectors::<3>(position, "VEC3", count)?;
        let normals = normal.map(|normal| file.vectors(normal, "VEC3", count)).transpose()?;
        let is_short = normals.as_ref().is_some_and(|normals| normals.unit.is_some());
        Ok(Self {
            centre: [columns[3][0], -columns[3][2], columns[3][1]],
            has_other_ends: !file.accessor(position)?.has_ends(&positions.stored),
            metres: positions.unit.map_or(scale, |unit| scale / unit),
            positions: positions.stored,
            places: file.vectors(place, "VEC2", count)?.into_values(),
            normals: normals.map(ProofAccessorNumbers::into_values),
            of_normal: if is_short { OF_SHORT_NORMAL } else { OF_NORMAL },
            triangles: triangles.to_vec(),
            sides,
        })
    }

    /// Rounds the vertices to the steps of a level.
    ///
    /// # Errors
    /// A height range that exceeds [`LAST`] steps.
    pub fn tile(self, id: ProofTileId, level: StatedTileLevel) -> Result<DecodedTile> {
        let StatedTileLevel { step, lattice, has_edges, skirt } = level;
        let scaled = self.positions.iter().map(|at| at.map(|value| value * self.metres));
        let placed: Vec<Vector> = scaled.map(|offset| plus(self.centre, offset)).collect();
        let (places, off_place) = self.rounded(id, level, &placed);
        let off_lattice =
            placed.iter().filter(|at| at.iter().any(|value| (value / lattice).fract() != 0.0));
        let off_lattice = off_lattice.count() as u64;
        let lowest = places.iter().map(|(_, height)| *height).fold(f64::INFINITY, f64::min);
        let mut vertices: Vec<[u16; 3]> = Vec::with_capacity(places.len());
        for &([u, v], height) in &places {
            let steps = height - lowest;
            if steps.is_nan() || steps > f64::from(LAST) {
                return Err(bad(format!("height range exceeds {LAST} steps of the level")));
            }
            vertices.push([u, v, steps as u16]);
        }
        let split = skirt.map(|_| SkirtSplit::of(&places, &self.triangles));
        let depth = skirt.map(|depth| depth / step);
        let off_depth =
            split.iter().zip(depth).map(|(split, depth)| split.off_depth(&places, depth)).sum();
        let lacks_edges = has_edges && self.sides.is_none();
        let faults = vec![
            (TilesetFault::SkirtDepth, off_depth),
            (TilesetFault::SkirtTorn, split.iter().map(SkirtSplit::torn).sum()),
            (TilesetFault::OffPlace, off_place),
            (TilesetFault::OffCoordinates, off_lattice),
            (TilesetFault::Ends, u64::from(self.has_other_ends)),
            (TilesetFault::Normals, self.wrong_normals(id, &vertices)),
            (TilesetFault::NoEdges, u64::from(lacks_edges)),
            (TilesetFault::Unannounced, u64::from(!has_edges && self.sides.is_some())),
            (TilesetFault::WalkedOtherwise, self.unordered_sides(&vertices)),
        ];
        let is_low: &[bool] = match &split {
            Some(split) => &split.is_low,
            None => &[],
        };
        let low = lowest * step;
        let tile = DecodedTile {
            centre: self.centre,
            heights: [low as f32, (low + step * f64::from(LAST)) as f32],
            triangles: self.triangles,
            sides: self.sides.unwrap_or_else(|| {
                ProofTileSide::ALL.map(|side| vertices_of_side(&vertices, is_low, side))
            }),
            normals: self.normals.map(|_| Vec::new()),
            vertices,
            placed,
            faults,
            ..DecodedTile::default()
        };
        Ok(match split {
            Some(split) => without_skirt(tile, split),
            None => tile,
        })
    }

    /// Steps and height steps of the vertices, and the number of vertices that are elsewhere.
    fn rounded(
        &self,
        id: ProofTileId,
        level: StatedTileLevel,
        placed: &[Vector],
    ) -> (Vec<Place>, u64) {
        let StatedTileLevel { step, lattice, .. } = level;
        let (mut places, mut elsewhere) = (Vec::with_capacity(placed.len()), 0);
        for (place, at) in self.places.iter().zip(placed) {
            let [u, v] = place.map(|share| share * f64::from(LAST));
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
            elsewhere += u64::from(!(is_stop && is_near));
            places.push((stop, height));
        }
        (places, elsewhere)
    }

    /// Number of normals that do not point outwards, or are not of length 1.
    fn wrong_normals(&self, id: ProofTileId, vertices: &[[u16; 3]]) -> u64 {
        let mut count = 0;
        for (normal, vertex) in self.normals.iter().flatten().zip(vertices) {
            let [longitude, latitude] = DecodedTile::place(id, *vertex);
            let up = ProofParallel::at(latitude).normal(ProofMeridian::at(longitude));
            let is_unit = (length(*normal) - 1.0).abs() < self.of_normal;
            count += u64::from(!is_unit || dot(*normal, up) <= 0.0);
        }
        count
    }

    /// Number of lists of sides that do not run around the tile with the tile on the right, as clients that add skirts
    /// expect.
    fn unordered_sides(&self, vertices: &[[u16; 3]]) -> u64 {
        let Some(sides) = &self.sides else { return 0 };
        let mut count = 0;
        for side in ProofTileSide::ALL {
            let vertices = sides[side as usize].iter().map(|&vertex| vertices[vertex as usize]);
            let mut stops: Vec<u16> = vertices.map(|vertex| along(vertex, side)).collect();
            if matches!(side, ProofTileSide::South | ProofTileSide::East) {
                stops.reverse();
            }
            count += u64::from(!stops.is_sorted());
        }
        count
    }
}

/// The vertices of a side, without those of the skirt.
fn vertices_of_side(vertices: &[[u16; 3]], is_low: &[bool], side: ProofTileSide) -> Vec<u32> {
    let all = (0..).zip(vertices).filter(|(_, vertex)| DecodedTile::is_on(**vertex, side));
    all.map(|(number, _)| number)
        .filter(|number: &u32| !is_low.get(*number as usize).copied().unwrap_or_default())
        .collect()
}

/// Moves the vertices and triangles of the skirt to the skirt of the tile.
fn without_skirt(tile: DecodedTile, split: SkirtSplit) -> DecodedTile {
    // A vertex of the skirt in a list of a side becomes an index that does not exist: a fault.
    let mut numbers = vec![u32::MAX; tile.vertices.len()];
    let surface: Vec<usize> = (0..numbers.len()).filter(|vertex| !split.is_low[*vertex]).collect();
    for (number, vertex) in (0..).zip(&surface) {
        numbers[*vertex] = number;
    }
    let renumbered = |vertex: u32| numbers[vertex as usize];
    let hanging = split.hanging.iter();
    DecodedTile {
        skirt: TileSkirt {
            triangles: hanging.map(|of| of.map(|corner| tile.placed[corner as usize])).collect(),
        },
        vertices: surface.iter().map(|vertex| tile.vertices[*vertex]).collect(),
        placed: surface.iter().map(|vertex| tile.placed[*vertex]).collect(),
        triangles: split.surface.iter().map(|corners| corners.map(renumbered)).collect(),
        sides: tile.sides.map(|side| side.into_iter().map(renumbered).collect()),
        ..tile
    }
}
