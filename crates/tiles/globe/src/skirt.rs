//! Skirts: a vertical wall below each side of a tile hides gaps between tiles of different levels.
//!
//! A tile with a skirt is an ordinary tile with more vertices, so lattice, spheres and encoding are the same.

use std::collections::BTreeMap;

use crate::tile::{TerrainTile, TileVertex};

/// The tile with a skirt this many height steps deep: one vertex below each border vertex, and two triangles
/// below each border edge, facing outwards.
pub(crate) fn skirted(tile: &TerrainTile, depth: i32) -> TerrainTile {
    let mut skirted = tile.clone();
    let mut below = BTreeMap::new();
    for [a, b] in rim(&tile.triangles) {
        let [low_a, low_b] = [a, b].map(|vertex| {
            *below.entry(vertex).or_insert_with(|| {
                let TileVertex { at, height } = tile.vertices[vertex as usize];
                skirted.vertices.push(TileVertex { at, height: height - depth });
                skirted.vertices.len() as u32 - 1
            })
        });
        skirted.triangles.extend([[b, a, low_a], [b, low_a, low_b]]);
    }
    skirted
}

/// Edges with a triangle on the left and none on the right.
fn rim(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let edges = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let mut edges: Vec<[u32; 2]> = edges.collect();
    edges.sort_unstable();
    let is_open = |[a, b]: &&[u32; 2]| edges.binary_search(&[*b, *a]).is_err();
    edges.iter().filter(is_open).copied().collect()
}
