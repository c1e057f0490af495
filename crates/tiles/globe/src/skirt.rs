//! Skirts: from each side of a tile a wall hangs straight down, so that nothing is seen between tiles of different
//! levels.
//!
//! A tile with a skirt is a tile with more vertices, so lattice, spheres and bytes are made as those of any tile.

use std::collections::BTreeMap;

use crate::tile::{TerrainTile, TileVertex};

/// The tile with its skirt, which hangs so many steps of heights down: below each vertex of its rim one more, and two
/// triangles below each edge of it, seen from outside.
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

/// Edges that a triangle is on the left of and none on the right.
fn rim(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let edges = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
    let mut all: Vec<[u32; 2]> = triangles.iter().flat_map(edges).collect();
    all.sort_unstable();
    let is_open = |[a, b]: &[u32; 2]| all.binary_search(&[*b, *a]).is_err();
    all.iter().copied().filter(is_open).collect()
}
