//! A tile as quantized-mesh 1.0 (github.com/CesiumGS/quantized-mesh): positions and heights in 32,767 steps,
//! triangles with high-water-mark indices, edge indices, and optional normals; with the proven error in the
//! metadata extension.

use crate::border::TileSide;
use crate::globe::{EQUATOR, EllipsoidNormal, Vector};
use crate::horizon;
use crate::level::TileLevel;
use crate::terrain::TerrainSampler;
use crate::tile::{TerrainTile, TileVertex};
use crate::tiling::{self, STEPS};
use terrane_base::error::{Error, ErrorKind, Result};

/// Extension number of vertex normals.
const NORMALS: u8 = 1;
/// Extension number of the water mask.
const WATER: u8 = 2;
/// Pixels along a side of the water mask, with rows from the north; a uniform mask is one byte.
pub const MASK_SIDE: u32 = 256;
/// Value of a water pixel; land is 0.
pub const MASK_WATER: u8 = 255;
/// Extension number of metadata.
const METADATA: u8 = 4;
/// Largest number of vertices with 16-bit indices.
const SHORT: usize = 1 << 16;
/// Largest number of halvings of a level's step for a tile's own step.
const MAX_HALVINGS: u32 = 14;
/// Smallest ratio of a distance along a parallel to one along a meridian for slopes.
const NARROWEST: f64 = 0.01;
/// Steepest slope of a normal: two bytes turn it by up to a degree, and it has to point outwards.
const STEEPEST: f64 = 32.0;
/// Decimals of the error.
const PLACES: i32 = 3;

/// Quantization of a tile's heights: from the lowest height, in its own steps.
pub(crate) struct QuantizedHeights {
    /// Steps of the level.
    lowest: i32,
    /// Own steps per step of the level.
    fineness: i32,
    /// Metres.
    range: [f32; 2],
}

impl QuantizedHeights {
    /// The finest steps that cover the range of heights, so that clients know the range as precisely as
    /// possible.
    pub(crate) fn of(tile: &TerrainTile) -> Result<Self> {
        Self::fitting(tile).ok_or_else(|| {
            let tiling::GlobeTileId { level, x, y } = tile.id;
            let message = format!("heights of tile {level}/{x}/{y} exceed its quantization");
            Error::new(ErrorKind::Internal, message)
        })
    }

    fn fitting(tile: &TerrainTile) -> Option<Self> {
        let heights = tile.vertices.iter().map(|vertex| vertex.height);
        let (lowest, highest) = (heights.clone().min()?, heights.max()?);
        let halvings = (0..=MAX_HALVINGS).rev().find(|halvings| {
            let fineness = 1_i64 << halvings;
            let reach = i64::from(lowest).abs() * fineness + i64::from(STEPS);
            i64::from(highest - lowest) * fineness <= i64::from(STEPS) && reach < 1 << 24
        })?;
        let step = tile.step / f64::from(1_u32 << halvings);
        let low = f64::from(lowest) * tile.step;
        // Both are integer steps below 2^24, so they are exact.
        let range = [low as f32, (low + step * f64::from(STEPS)) as f32];
        Some(Self { lowest, fineness: 1 << halvings, range })
    }

    fn stored(&self, height: i32) -> i32 {
        (height - self.lowest) * self.fineness
    }
}

/// Data of a tile beside its surface.
#[derive(Clone, Copy, Debug, Default)]
pub struct TileExtensions<'a> {
    /// Available tiles below, as JSON.
    pub available: Option<&'a str>,
    /// Water mask: a byte for each of [`MASK_SIDE`] squared pixels, or one for all.
    pub water: Option<&'a [u8]>,
}

/// The encoded tile; with `normals`, those of the ground at its vertices.
///
/// # Errors
/// A tile with too large a range of heights.
pub fn quantized_mesh<G: TerrainSampler>(
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
    // Indices of 32 bits begin at a multiple of four bytes (IndexData32).
    while !is_short && out.len() % 4 != 0 {
        out.push(0);
    }
    out.extend((triangles.len() as u32).to_le_bytes());
    let mut next = 0;
    for corner in triangles.iter().flatten() {
        // High-water mark: the distance of a vertex below the next new one, which has 0.
        put_index(next - corner, is_short, &mut out);
        next += u32::from(*corner == next);
    }
    for side in TileSide::ALL {
        let numbered = (0..).zip(&vertices);
        let on_side = numbered.filter_map(|(i, v)| side.along(v.at).map(|along| (along, i)));
        let mut on_side: Vec<(i32, u32)> = on_side.collect();
        on_side.sort_unstable();
        out.extend((on_side.len() as u32).to_le_bytes());
        on_side.iter().for_each(|(_, vertex)| put_index(*vertex, is_short, &mut out));
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
    put_doubles(&centre.0, out);
    out.extend(heights.range.iter().flat_map(|height| height.to_le_bytes()));
    put_doubles(&centre.0, out);
    put_doubles(&[radius], out);
    put_doubles(&occlusion.0, out);
}

fn put_doubles(values: &[f64], out: &mut Vec<u8>) {
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

fn put_index(index: u32, is_short: bool, out: &mut Vec<u8>) {
    match is_short {
        true => out.extend((index as u16).to_le_bytes()),
        false => out.extend(index.to_le_bytes()),
    }
}

/// Differences of successive values, zigzag-encoded.
fn differences(values: impl Iterator<Item = i32>, out: &mut Vec<u8>) {
    let mut last = 0;
    for value in values {
        let by = value - last;
        out.extend((((by << 1) ^ (by >> 31)) as u16).to_le_bytes());
        last = value;
    }
}

/// Triangles reordered so that neighbours follow each other, and vertices in order of first use.
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

/// Triangles with their first corner, so that most share an edge with the one before.
fn walk(triangles: &[[u32; 3]]) -> Vec<(usize, usize)> {
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(triangles.len() * 3);
    for (number, corners) in (0..).zip(triangles) {
        edges.extend((0..3).map(|k| ([corners[k], corners[(k + 1) % 3]], number)));
    }
    edges.sort_unstable();
    let mut is_done = vec![false; triangles.len()];
    let mut order = Vec::with_capacity(triangles.len());
    let mut open = vec![(0, 0)];
    while let Some((triangle, first)) = open.pop() {
        if std::mem::replace(&mut is_done[triangle], true) {
            continue;
        }
        order.push((triangle, first));
        let corners = triangles[triangle];
        // Nothing is left across the edge that it came from.
        for k in [(first + 2) % 3, (first + 1) % 3, first] {
            let [from, to] = [corners[k], corners[(k + 1) % 3]];
            let twin = edges.binary_search_by_key(&[to, from], |(edge, _)| *edge).ok();
            let next = twin.map(|i| edges[i].1 as usize);
            if let Some(next) = next.filter(|next| !is_done[*next]) {
                let corner = triangles[next].iter().position(|corner| *corner == to).unwrap_or(0);
                open.push((next, corner));
            }
        }
    }
    order
}

/// Normal of the ground at a position: a function of the ground only, so that neighbouring tiles are lit alike.
pub(crate) fn normal(place: [f64; 2], level: &TileLevel, ground: &impl TerrainSampler) -> Vector {
    let upright = EllipsoidNormal::at(place);
    let [east, north] = upright.across();
    let height = ground.height(place);
    let slopes = [0, 1].map(|axis| slope(place, height, axis, level.slope, ground));
    let share = (STEEPEST / slopes[0].hypot(slopes[1])).min(1.0);
    (upright.normal - east * (slopes[0] * share) - north * (slopes[1] * share)).unit()
}

/// Slope at a position with a height, to the east or to the north, between positions `by` degrees away; 0 where
/// it is unknown.
fn slope(
    place: [f64; 2],
    height: Option<f64>,
    axis: usize,
    by: f64,
    ground: &impl TerrainSampler,
) -> f64 {
    let mut ends = [place; 2];
    ends[0][axis] -= by;
    ends[1][axis] += by;
    let rise = match (ends.map(|end| ground.height(end)), height) {
        ([Some(low), Some(high)], _) => high - low,
        ([None, Some(high)], Some(here)) => 2.0 * (high - here),
        ([Some(low), None], Some(here)) => 2.0 * (here - low),
        _ => return 0.0,
    };
    let [from, to] = ends.map(|end| EllipsoidNormal::at(end).point(0.0));
    let length = (to - from).length();
    // Meridians meet at the poles.
    let min_length = 2.0 * by.to_radians() * EQUATOR * NARROWEST;
    if length > min_length { rise / length } else { 0.0 }
}

/// A direction in two bytes: octahedral encoding (Cigolle et al. 2014, "A Survey of Efficient Representations
/// for Independent Unit Vectors").
fn octants(direction: Vector) -> [u8; 2] {
    let [x, y, z] = direction.0;
    let size = x.abs() + y.abs() + z.abs();
    let [mut x, mut y] = [x / size, y / size];
    if z < 0.0 {
        // Not `signum`: it is -1 for negative zero.
        let signs = [x, y].map(|value| if value < 0.0 { -1.0 } else { 1.0 });
        [x, y] = [(1.0 - y.abs()) * signs[0], (1.0 - x.abs()) * signs[1]];
    }
    [x, y].map(|value| ((value.clamp(-1.0, 1.0) * 0.5 + 0.5) * 255.0).round() as u8)
}

/// Error of a tile, rounded up, but not above the geometric error of the level.
fn stated(tile: &TerrainTile) -> f64 {
    let (error, scale) = (tile.measure.largest, 10_f64.powi(PLACES));
    let rounded = (error * scale).ceil() / scale;
    if rounded <= tiling::level_error(tile.id.level) { rounded } else { error }
}

/// Metadata: error, and available tiles below.
fn metadata(error: f64, available: Option<&str>, out: &mut Vec<u8>) {
    let below = available.map_or(String::new(), |text| format!(r#","available":{text}"#));
    let text = format!(r#"{{"error":{error}{below}}}"#);
    out.push(METADATA);
    out.extend((text.len() as u32 + 4).to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}
