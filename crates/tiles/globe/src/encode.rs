//! The bytes of a tile as quantized-mesh 1.0 (github.com/CesiumGS/quantized-mesh): positions and heights in 32,767
//! steps, triangles by how long ago a vertex was new, the vertices of each border, and, if wanted, normals; and
//! what is proven of the tile, in the extension for metadata.

use crate::border::TileSide;
use crate::globe::{EQUATOR, EllipsoidNormal, Vector};
use crate::ground::GroundSampler;
use crate::horizon;
use crate::level::TileLevel;
use crate::tile::{TerrainTile, TileVertex};
use crate::tiling::{self, STEPS};
use terrane_base::error::{Error, ErrorKind, Result};

/// Number of the extension with a normal for each vertex.
const NORMALS: u8 = 1;
/// Number of the extension with which pixels are water.
const WATER: u8 = 2;
/// Pixels along a side of the mask of water, whose rows come from the north; of one kind, one byte stands for all.
pub const MASK_SIDE: u32 = 256;
/// What a pixel of water is; one of land is 0.
pub const MASK_WATER: u8 = 255;
/// Number of the extension with text about the tile.
const METADATA: u8 = 4;
/// Vertices that two bytes can number.
const SHORT: usize = 1 << 16;
/// Halvings of a level's step that a tile's own may have.
const MOST_HALVINGS: u32 = 14;
/// Part of the way along a meridian that one along a parallel has to be for slopes to be told of it.
const NARROWEST: f64 = 0.01;
/// How steep the ground may be that a normal tells of: two bytes turn it by up to a degree, and it has to point outwards
/// still.
const STEEPEST: f64 = 32.0;
/// Places that the error is told to.
const PLACES: i32 = 3;

/// The heights that a tile can hold: from the lowest one on, in its own steps.
pub(crate) struct QuantizedHeights {
    /// Steps of the level.
    lowest: i32,
    /// Own steps in a step of the level.
    fineness: i32,
    /// Metres.
    range: [f32; 2],
}

impl QuantizedHeights {
    /// The finest steps that reach from the lowest height to the highest, so that clients know the range of
    /// heights as well as they can.
    pub(crate) fn of(tile: &TerrainTile) -> Result<Self> {
        Self::fitting(tile).ok_or_else(|| {
            let tiling::GlobeTileId { level, x, y } = tile.id;
            let message = format!("heights of tile {level}/{x}/{y} exceed its quantization");
            Error::new(ErrorKind::Internal, message)
        })
    }

    fn fitting(tile: &TerrainTile) -> Option<Self> {
        let heights = || tile.vertices.iter().map(|vertex| vertex.height);
        let (lowest, highest) = (heights().min()?, heights().max()?);
        let fits = |halvings: &u32| {
            let fineness = 1_i64 << halvings;
            let reach = i64::from(lowest).abs() * fineness + i64::from(STEPS);
            i64::from(highest - lowest) * fineness <= i64::from(STEPS) && reach < 1 << 24
        };
        let halvings = (0..=MOST_HALVINGS).rev().find(fits)?;
        let own = tile.step / f64::from(1_u32 << halvings);
        let low = f64::from(lowest) * tile.step;
        // Both are whole numbers of steps below 2^24, so they are exact.
        let range = [low as f32, (low + own * f64::from(STEPS)) as f32];
        Some(Self { lowest, fineness: 1 << halvings, range })
    }

    fn stored(&self, height: i32) -> i32 {
        (height - self.lowest) * self.fineness
    }
}

/// What a tile says beside its surface.
#[derive(Clone, Copy, Debug, Default)]
pub struct TileExtensions<'a> {
    /// What tiles there are below it, as JSON.
    pub available: Option<&'a str>,
    /// The mask of water: a byte for each of [`MASK_SIDE`] times as many pixels, or one for all.
    pub water: Option<&'a [u8]>,
}

/// The bytes of a tile; with `normals`, those of the ground at its vertices.
///
/// # Errors
/// A tile whose heights have too large a range.
pub fn quantized_mesh<G: GroundSampler>(
    tile: &TerrainTile,
    normals: Option<(&TileLevel, &G)>,
    extras: TileExtensions<'_>,
) -> Result<Vec<u8>> {
    let heights = QuantizedHeights::of(tile)?;
    let (vertices, triangles) = in_order(tile);
    let mut out = Vec::with_capacity(vertices.len() * 12 + 256);
    header(tile, &heights, &mut out);
    out.extend((vertices.len() as u32).to_le_bytes());
    let parts: [&dyn Fn(&TileVertex) -> i32; 3] =
        [&|v| v.at[0], &|v| v.at[1], &|v| heights.stored(v.height)];
    parts.iter().for_each(|part| differences(vertices.iter().map(part), &mut out));
    let is_short = vertices.len() <= SHORT;
    let index = |index: u32, out: &mut Vec<u8>| match is_short {
        true => out.extend((index as u16).to_le_bytes()),
        false => out.extend(index.to_le_bytes()),
    };
    while !is_short && out.len() % 4 != 0 {
        out.push(0);
    }
    out.extend((triangles.len() as u32).to_le_bytes());
    let mut next = 0;
    for corner in triangles.iter().flatten() {
        index(next - corner, &mut out);
        next += u32::from(*corner == next);
    }
    for side in TileSide::ALL {
        let on_side = |(i, v): (u32, &TileVertex)| side.along(v.at).map(|along| (along, i));
        let mut ends: Vec<(i32, u32)> = (0..).zip(&vertices).filter_map(on_side).collect();
        ends.sort_unstable();
        out.extend((ends.len() as u32).to_le_bytes());
        ends.iter().for_each(|(_, vertex)| index(*vertex, &mut out));
    }
    if let Some((level, ground)) = normals {
        out.push(NORMALS);
        out.extend((2 * vertices.len() as u32).to_le_bytes());
        for vertex in &vertices {
            out.extend(octants(normal(tile.id.place(vertex.at), level, ground)));
        }
    }
    if let Some(mask) = extras.water {
        out.push(WATER);
        out.extend((mask.len() as u32).to_le_bytes());
        out.extend_from_slice(mask);
    }
    metadata(stated(tile), extras.available, &mut out);
    Ok(out)
}

fn header(tile: &TerrainTile, heights: &QuantizedHeights, out: &mut Vec<u8>) {
    let points: Vec<Vector> = tile.vertices.iter().map(|vertex| tile.point(*vertex)).collect();
    let (centre, radius) = horizon::sphere(&points);
    let occlusion = horizon::occlusion(centre, &points, heights.range[0].into());
    let doubles = |out: &mut Vec<u8>, values: &[f64]| {
        out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    };
    doubles(out, &centre.0);
    out.extend(heights.range.iter().flat_map(|height| height.to_le_bytes()));
    doubles(out, &centre.0);
    doubles(out, &[radius]);
    doubles(out, &occlusion.0);
}

/// Differences from one to the next, small ones of either sign as small numbers.
fn differences(values: impl Iterator<Item = i32>, out: &mut Vec<u8>) {
    let mut last = 0;
    for value in values {
        let by = value - last;
        out.extend((((by << 1) ^ (by >> 31)) as u16).to_le_bytes());
        last = value;
    }
}

/// Triangles in an order in which neighbours follow each other, and vertices in the order in which these name
/// them.
pub(crate) fn in_order(tile: &TerrainTile) -> (Vec<TileVertex>, Vec<[u32; 3]>) {
    let mut numbers = vec![u32::MAX; tile.vertices.len()];
    let mut vertices = Vec::with_capacity(tile.vertices.len());
    let mut triangles = Vec::with_capacity(tile.triangles.len());
    for (triangle, first) in walk(&tile.triangles) {
        let mut corners = tile.triangles[triangle];
        corners.rotate_left(first);
        triangles.push(corners.map(|corner| {
            let number = &mut numbers[corner as usize];
            if *number == u32::MAX {
                *number = vertices.len() as u32;
                vertices.push(tile.vertices[corner as usize]);
            }
            *number
        }));
    }
    (vertices, triangles)
}

/// Triangles, each with the corner to begin at, so that most share an edge with the one before.
fn walk(triangles: &[[u32; 3]]) -> Vec<(usize, usize)> {
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(triangles.len() * 3);
    for (number, corners) in (0..).zip(triangles) {
        edges.extend((0..3).map(|k| ([corners[k], corners[(k + 1) % 3]], number)));
    }
    edges.sort_unstable();
    let beyond = |from: u32, to: u32| {
        let found = edges.binary_search_by_key(&[to, from], |(edge, _)| *edge);
        found.ok().map(|i| edges[i].1 as usize)
    };
    let mut is_done = vec![false; triangles.len()];
    let mut order = Vec::with_capacity(triangles.len());
    let mut open = vec![(0, 0)];
    while let Some((triangle, first)) = open.pop() {
        if std::mem::replace(&mut is_done[triangle], true) {
            continue;
        }
        order.push((triangle, first));
        let corners = triangles[triangle];
        // Across the edge that it came over there is nothing left.
        for k in [(first + 2) % 3, (first + 1) % 3, first] {
            let [from, to] = [corners[k], corners[(k + 1) % 3]];
            if let Some(next) = beyond(from, to).filter(|next| !is_done[*next]) {
                let corner = triangles[next].iter().position(|corner| *corner == to).unwrap_or(0);
                open.push((next, corner));
            }
        }
    }
    order
}

/// What is at right angles to the ground at a place: a function of the ground alone, so that tiles beside each
/// other are lit alike.
pub(crate) fn normal(place: [f64; 2], level: &TileLevel, ground: &impl GroundSampler) -> Vector {
    let by = level.slope;
    let upright = EllipsoidNormal::at(place);
    let [east, north] = upright.across();
    let here = ground.height(place);
    let slope = |axis: usize| {
        let mut ends = [place; 2];
        ends[0][axis] -= by;
        ends[1][axis] += by;
        let found = ends.map(|end| ground.height(end));
        let rise = match (found, here) {
            ([Some(low), Some(high)], _) => high - low,
            ([None, Some(high)], Some(here)) => 2.0 * (high - here),
            ([Some(low), None], Some(here)) => 2.0 * (here - low),
            _ => return 0.0,
        };
        let length = (EllipsoidNormal::at(ends[1]).point(0.0)
            - EllipsoidNormal::at(ends[0]).point(0.0))
        .length();
        // Meridians meet at the poles.
        let least = 2.0 * by.to_radians() * EQUATOR * NARROWEST;
        if length > least { rise / length } else { 0.0 }
    };
    let slopes = [slope(0), slope(1)];
    let share = (STEEPEST / slopes[0].hypot(slopes[1])).min(1.0);
    (upright.normal - east * (slopes[0] * share) - north * (slopes[1] * share)).unit()
}

/// A direction in two bytes: its octahedron, unfolded (Cigolle et al. 2014, "A Survey of Efficient Representations
/// for Independent Unit Vectors").
fn octants(direction: Vector) -> [u8; 2] {
    let [x, y, z] = direction.0;
    let size = x.abs() + y.abs() + z.abs();
    let [mut x, mut y] = [x / size, y / size];
    if z < 0.0 {
        let sign = |value: f64| if value < 0.0 { -1.0 } else { 1.0 };
        [x, y] = [(1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)];
    }
    [x, y].map(|value| ((value.clamp(-1.0, 1.0) * 0.5 + 0.5) * 255.0).round() as u8)
}

/// The error of a tile, rounded up, but not beyond what clients assume.
fn stated(tile: &TerrainTile) -> f64 {
    let (error, scale) = (tile.measure.largest, 10_f64.powi(PLACES));
    let rounded = (error * scale).ceil() / scale;
    if rounded <= tiling::level_error(tile.id.level) { rounded } else { error }
}

/// Tells the error, and what tiles there are below.
fn metadata(error: f64, available: Option<&str>, out: &mut Vec<u8>) {
    let below = available.map_or(String::new(), |text| format!(r#","available":{text}"#));
    let text = format!(r#"{{"error":{error}{below}}}"#);
    out.push(METADATA);
    out.extend((text.len() as u32 + 4).to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}
