//! Whether the triangles of a tile cover its square once, and its lists say what they should.
//!
//! Triangles with area, each edge inside passed once in both directions, and open edges that are the four sides
//! from vertex to vertex: such a mesh covers the square some whole number of times, and its area says that this
//! is once.

use super::decode::DecodedTile;
use super::ellipsoid::{ProofMeridian, ProofParallel, dot};
use super::fault::{TilesetFault, TilesetFaults};
use super::tiling::{LAST, ProofTileId, ProofTileSide};

/// Looks at a tile by itself. O(n log n).
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
    let mut whole = 0;
    for triangle in &tile.triangles {
        let [a, b, c] = triangle.map(|corner| tile.vertices[corner as usize].map(i64::from));
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        faults.add(TilesetFault::Clockwise, u64::from(area < 0), id);
        faults.add(TilesetFault::Flat, u64::from(area == 0), id);
        whole += i128::from(area);
    }
    let square = 2 * i128::from(LAST) * i128::from(LAST);
    faults.add(TilesetFault::Uncovered, u64::from(whole != square), id);
}

/// An edge, with the lower vertex first, and whether it was passed the other way.
fn directed(from: u32, to: u32) -> ([u32; 2], bool) {
    ([from.min(to), from.max(to)], from > to)
}

/// The edges of one triangle alone.
fn edges(id: ProofTileId, tile: &DecodedTile, faults: &mut TilesetFaults) -> Vec<[u32; 2]> {
    let around = |&[a, b, c]: &[u32; 3]| [directed(a, b), directed(b, c), directed(c, a)];
    let mut all: Vec<_> = tile.triangles.iter().flat_map(around).collect();
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

/// Where along a side a vertex is.
pub(super) fn along(vertex: [u16; 3], side: ProofTileSide) -> u16 {
    if side.is_meridian() { vertex[1] } else { vertex[0] }
}

/// Holds open edges to be those from each vertex of a side to the next.
fn sides(id: ProofTileId, tile: &DecodedTile, open: &[[u32; 2]], faults: &mut TilesetFaults) {
    let mut left = open.len();
    for side in ProofTileSide::ALL {
        let ends = |edge: &[u32; 2]| {
            let ends = edge.map(|end| tile.vertices[end as usize]);
            ends.iter()
                .all(|&end| DecodedTile::is_on(end, side))
                .then(|| ends.map(|end| along(end, side)))
        };
        let mut found: Vec<[u16; 2]> = open.iter().filter_map(ends).collect();
        left -= found.len().min(left);
        found.iter_mut().for_each(|ends| ends.sort_unstable());
        found.sort_unstable();
        let on_it = tile.vertices.iter().filter(|&&vertex| DecodedTile::is_on(vertex, side));
        let mut stops: Vec<u16> = on_it.map(|&vertex| along(vertex, side)).collect();
        stops.sort_unstable();
        stops.dedup();
        let steps = stops.windows(2).map(|two| [two[0], two[1]]);
        let is_whole = stops.first() == Some(&0) && stops.last() == Some(&LAST);
        let is_followed = is_whole && steps.eq(found.iter().copied());
        faults.add(TilesetFault::BrokenSides, u64::from(!is_followed), id);
    }
    faults.add(TilesetFault::Cracks, left as u64, id);
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

/// A direction from its place on an octahedron laid flat; of any length.
fn unpacked([x, y]: [u8; 2]) -> [f64; 3] {
    let [x, y] = [x, y].map(|part| f64::from(part) / 255.0 * 2.0 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let sign = |value: f64| if value < 0.0 { -1.0 } else { 1.0 };
    match z < 0.0 {
        true => [(1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y), z],
        false => [x, y, z],
    }
}
