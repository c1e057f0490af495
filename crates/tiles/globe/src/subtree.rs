//! Subtrees of 3D Tiles 1.1: available tiles below a tile for a number of levels, with their metadata.
//!
//! Bits are ordered by level and along a Morton curve within a level; metadata is a table with a row per
//! available tile, in the same order.

use crate::gltf::TileMetadata;
use crate::tiling::GlobeTileId;

/// Levels of a subtree.
pub const SUBTREE_LEVELS: u8 = 7;

/// Metadata class of a tile in the schema: properties with type and meaning.
pub const CLASS: [(&str, &str, &str); 5] = [
    ("minimumHeight", r#""type":"SCALAR""#, "TILE_MINIMUM_HEIGHT"),
    ("maximumHeight", r#""type":"SCALAR""#, "TILE_MAXIMUM_HEIGHT"),
    ("boundingSphere", r#""type":"SCALAR","array":true,"count":4"#, "TILE_BOUNDING_SPHERE"),
    ("horizonOcclusionPoint", r#""type":"VEC3""#, "TILE_HORIZON_OCCLUSION_POINT"),
    ("geometricError", r#""type":"SCALAR""#, "TILE_GEOMETRIC_ERROR"),
];

/// Root of the subtree of a tile.
pub fn subtree_of(id: GlobeTileId) -> GlobeTileId {
    let by = id.level % SUBTREE_LEVELS;
    GlobeTileId { level: id.level - by, x: id.x >> by, y: id.y >> by }
}

/// Metadata of a tile as values.
type Column = fn(&TileMetadata) -> Vec<f64>;

/// The subtree with root `root`: its tiles in any order, and the roots of child subtrees.
pub fn subtree(root: GlobeTileId, tiles: &[TileMetadata], below: &[GlobeTileId]) -> Vec<u8> {
    let mut rows: Vec<(usize, &TileMetadata)> = tiles
        .iter()
        .map(|facts| {
            (tiles_above(facts.id.level - root.level) + along_curve(root, facts.id), facts)
        })
        .collect();
    rows.sort_unstable_by_key(|(number, _)| *number);
    let mut buffer = SubtreeBuffer::default();
    let here = bits(tiles_above(SUBTREE_LEVELS), rows.iter().map(|(number, _)| *number));
    let (here, count) = (buffer.add(&here), rows.len());
    let here = format!(r#"{{"bitstream":{here},"availableCount":{count}}}"#);
    let children = match below.len() {
        0 => r#"{"constant":0}"#.to_owned(),
        count => {
            let all = below.iter().map(|id| along_curve(root, *id));
            let bits = buffer.add(&bits(1 << (2 * SUBTREE_LEVELS), all));
            format!(r#"{{"bitstream":{bits},"availableCount":{count}}}"#)
        }
    };
    let columns: [Column; 5] = [
        |facts| vec![facts.heights[0]],
        |facts| vec![facts.heights[1]],
        |facts| [&facts.sphere.0.0[..], &[facts.sphere.1]].concat(),
        |facts| facts.occlusion.0.to_vec(),
        |facts| vec![facts.error],
    ];
    let properties: Vec<String> = CLASS
        .iter()
        .zip(columns)
        .map(|((name, ..), column)| {
            let values = rows.iter().flat_map(|(_, facts)| column(facts));
            let bytes: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
            format!(r#""{name}":{{"values":{}}}"#, buffer.add(&bytes))
        })
        .collect();
    let json = format!(
        r#"{{"buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"propertyTables":[{{"class":"tile","count":{count},"properties":{{{}}}}}],"tileMetadata":0,"tileAvailability":{here},"contentAvailability":[{here}],"childSubtreeAvailability":{children}}}"#,
        buffer.bytes.len(),
        buffer.views.join(","),
        properties.join(","),
    );
    file(json, &buffer.bytes)
}

/// Number of tiles of all levels above a level of a quadtree.
fn tiles_above(level: u8) -> usize {
    ((1 << (2 * level)) - 1) / 3
}

/// Morton index of a tile in its level below `root`: interleaved bits of column and row.
fn along_curve(root: GlobeTileId, id: GlobeTileId) -> usize {
    let by = id.level - root.level;
    let [x, y] = [id.x - (root.x << by), id.y - (root.y << by)].map(|at| at as usize);
    (0..by).map(|bit| (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1)).sum()
}

/// A bit array.
fn bits(count: usize, set: impl Iterator<Item = usize>) -> Vec<u8> {
    let mut bits = vec![0; count.div_ceil(8)];
    set.for_each(|bit| bits[bit / 8] |= 1 << (bit % 8));
    bits
}

/// The buffer and its views.
#[derive(Default)]
struct SubtreeBuffer {
    bytes: Vec<u8>,
    views: Vec<String>,
}

impl SubtreeBuffer {
    /// Adds a view; returns its index.
    fn add(&mut self, bytes: &[u8]) -> usize {
        let (offset, length) = (self.bytes.len(), bytes.len());
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#));
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
        self.views.len() - 1
    }
}

fn file(json: String, bytes: &[u8]) -> Vec<u8> {
    let mut text = json.into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    let mut out = Vec::with_capacity(24 + text.len() + bytes.len());
    out.extend_from_slice(b"subt");
    out.extend(1_u32.to_le_bytes());
    out.extend(
        [text.len(), bytes.len()].map(|length| (length as u64).to_le_bytes()).as_flattened(),
    );
    out.extend(text);
    out.extend_from_slice(bytes);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By quarters of quarters, as the curve is defined.
    #[test]
    fn the_curve_goes_through_quarters_in_turn() {
        let root = GlobeTileId { level: 3, x: 5, y: 2 };
        let mut open = vec![root];
        for level in 0..4 {
            let numbers: Vec<usize> = open.iter().map(|id| along_curve(root, *id)).collect();
            assert_eq!(numbers, (0..1 << (2 * level)).collect::<Vec<_>>());
            open = open.into_iter().flat_map(GlobeTileId::children).collect();
        }
        assert_eq!(
            subtree_of(GlobeTileId { level: 9, x: 700, y: 300 }),
            GlobeTileId { level: 7, x: 175, y: 75 }
        );
    }
}
