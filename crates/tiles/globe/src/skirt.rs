//! Skirts: a vertical wall below each side of a tile hides gaps between tiles of different levels.
//!
//! A tile with a skirt is an ordinary tile with more vertices, so lattice, spheres and encoding are the same.

use std::collections::BTreeMap;

use crate::tile::{TerrainTile, TileVertex};

/// The tile with a skirt this many height steps deep: one vertex below each border vertex, and two triangles
/// below each border edge, facing outwards.
pub(crate) fn skirted(tile: &TerrainTile, depth: i32) -> TerrainTile {
    let mut whole = tile.clone();
    let mut below = BTreeMap::new();
    let mut hang = |vertex: u32| {
        *below.entry(vertex).or_insert_with(|| {
            let TileVertex { at, height } = tile.vertices[vertex as usize];
            whole.vertices.push(TileVertex { at, height: height - depth });
            whole.vertices.len() as u32 - 1
        })
    };
    for [a, b] in rim(&tile.triangles) {
        let [low_a, low_b] = [hang(a), hang(b)];
        whole.triangles.extend([[b, a, low_a], [b, low_a, low_b]]);
    }
    whole
}

/// Edges with a triangle on the left and none on the right.
fn rim(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let edges = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
    let mut all: Vec<[u32; 2]> = triangles.iter().flat_map(edges).collect();
    all.sort_unstable();
    let is_open = |[a, b]: &[u32; 2]| all.binary_search(&[*b, *a]).is_err();
    all.iter().copied().filter(is_open).collect()
}
