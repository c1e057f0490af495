//! Checks that the triangles of a tile cover it once, and that its lists of vertices of sides are right.
//!
//! If triangles have area, each inner edge is passed once in both directions, and the open edges are the four sides from
//! vertex to vertex, then the mesh covers the tile a whole number of times; the sum of areas proves that it is once.

use super::decode::DecodedTile;
use super::ellipsoid::{ProofMeridian, ProofParallel, dot};
use super::fault::{TilesetFault, TilesetFaults};
use super::tiling::{LAST, ProofTileId, ProofTileSide};

/// Checks the mesh of a tile. O(n log n).
pub fn structure(id: ProofTileId, tile: &DecodedTile, faults: &mut TilesetFaults) {
    areas(id, tile, faults);
    let open = edges(id, tile, faults);
    sides(id, tile, &open, faults);
    vertices(id, tile, faults);
    for side in ProofTileSide::ALL {
        let is_right = list(tile, &tile.sides[side as usize], side);
        faults.add(TilesetFault::SideLists, u64::from(!is_right), id);
    }
    let turned = tile.normals.iter().flatten().zip(&tile.vertices);
    let turned = turned.filter(|(normal, vertex)| !is_outward(id, **vertex, **normal)).count();
    faults.add(TilesetFault::Normals, turned as u64, id);
}

fn areas(id: ProofTileId, tile: &DecodedTile, faults: &mut TilesetFaults) {
    let mut sum = 0;
    for triangle in &tile.triangles {
        let [a, b, c] = triangle.map(|corner| tile.vertices[corner as usize].map(i64::from));
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        faults.add(TilesetFault::Clockwise, u64::from(area < 0), id);
        faults.add(TilesetFault::Flat, u64::from(area == 0), id);
        sum += i128::from(area);
    }
    let expected = 2 * i128::from(LAST) * i128::from(LAST);
    faults.add(TilesetFault::Uncovered, u64::from(sum != expected), id);
}

/// An edge, with the lower vertex first, and whether it was passed the other way.
fn directed(from: u32, to: u32) -> ([u32; 2], bool) {
    ([from.min(to), from.max(to)], from > to)
}

/// The edges of a single triangle.
fn edges(id: ProofTileId, tile: &DecodedTile, faults: &mut TilesetFaults) -> Vec<[u32; 2]> {
    let mut all: Vec<_> = tile
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [directed(a, b), directed(b, c), directed(c, a)])
        .collect();
    all.sort_unstable();
    let mut open = Vec::new();
    for same in all.chunk_by(|a, b| a.0 == b.0) {
        match same {
            [(ends, _)] => open.push(*ends),
            [(_, false), (_, true)] => (),
            _ => faults.add(TilesetFault::Tangled, 1, id),
        }
    }
    open
}

/// Step of a vertex along a side.
pub(super) fn along(vertex: [u16; 3], side: ProofTileSide) -> u16 {
    if side.is_meridian() { vertex[1] } else { vertex[0] }
}

/// Checks that the open edges are those from each vertex of a side to the next.
fn sides(id: ProofTileId, tile: &DecodedTile, open: &[[u32; 2]], faults: &mut TilesetFaults) {
    let mut cracks = open.len();
    for side in ProofTileSide::ALL {
        let ends = open.iter().map(|edge| edge.map(|end| tile.vertices[end as usize]));
        let on_it = ends.filter(|ends| ends.iter().all(|&end| DecodedTile::is_on(end, side)));
        let mut edges: Vec<[u16; 2]> = on_it.map(|ends| ends.map(|end| along(end, side))).collect();
        cracks -= edges.len().min(cracks);
        edges.iter_mut().for_each(|ends| ends.sort_unstable());
        edges.sort_unstable();
        let on_it = tile.vertices.iter().filter(|&&vertex| DecodedTile::is_on(vertex, side));
        let mut stops: Vec<u16> = on_it.map(|&vertex| along(vertex, side)).collect();
        stops.sort_unstable();
        stops.dedup();
        let steps = stops.windows(2).map(|two| [two[0], two[1]]);
        let has_corners = stops.first() == Some(&0) && stops.last() == Some(&LAST);
        let is_followed = has_corners && steps.eq(edges.iter().copied());
        faults.add(TilesetFault::BrokenSides, u64::from(!is_followed), id);
    }
    faults.add(TilesetFault::Cracks, cracks as u64, id);
}

fn vertices(id: ProofTileId, tile: &DecodedTile, faults: &mut TilesetFaults) {
    let mut places: Vec<_> = tile.vertices.iter().map(|&[u, v, _]| [u, v]).collect();
    places.sort_unstable();
    let twice = places.windows(2).filter(|two| two[0] == two[1]).count();
    faults.add(TilesetFault::Duplicates, twice as u64, id);
    let mut is_used = vec![false; tile.vertices.len()];
    tile.triangles.as_flattened().iter().for_each(|&corner| is_used[corner as usize] = true);
    let unused = is_used.iter().filter(|used| !**used).count();
    faults.add(TilesetFault::Unused, unused as u64, id);
}

/// True when a list names the vertices of a side, each once, in any order.
fn list(tile: &DecodedTile, list: &[u32], side: ProofTileSide) -> bool {
    let mut named = list.to_vec();
    named.sort_unstable();
    let on_it =
        tile.vertices.iter().zip(0u32..).filter(|(vertex, _)| DecodedTile::is_on(**vertex, side));
    on_it.map(|(_, index)| index).eq(named)
}

fn is_outward(id: ProofTileId, vertex: [u16; 3], normal: [u8; 2]) -> bool {
    let [longitude, latitude] = DecodedTile::place(id, vertex);
    let up = ProofParallel::at(latitude).normal(ProofMeridian::at(longitude));
    dot(unpacked(normal), up) > 0.0
}

/// Decodes an oct-encoded direction; it is not normalized.
fn unpacked([x, y]: [u8; 2]) -> [f64; 3] {
    let [x, y] = [x, y].map(|byte| f64::from(byte) / 255.0 * 2.0 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    match z < 0.0 {
        true => [(1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y), z],
        false => [x, y, z],
    }
}
