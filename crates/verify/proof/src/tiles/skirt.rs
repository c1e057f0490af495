//! Skirts of a tile: vertical walls below its sides. A triangle whose corners lie on one side belongs to the skirt.

use std::collections::HashMap;

use super::ellipsoid::Vector;
use super::tiling::LAST;

/// A vertex: steps from the west and the south, and its height in steps of the level.
pub(super) type Place = ([u16; 2], f64);

/// Skirt of a tile.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileSkirt {
    /// Earth-centred corners of its triangles.
    pub triangles: Vec<[Vector; 3]>,
}

/// The triangles of a tile, divided into surface and skirt.
pub(super) struct SkirtSplit {
    /// Triangles of the surface; indices are those of all vertices.
    pub(super) surface: Vec<[u32; 3]>,
    /// Triangles of the skirt.
    pub(super) hanging: Vec<[u32; 3]>,
    /// Whether a vertex belongs to the skirt alone.
    pub(super) is_low: Vec<bool>,
}

impl SkirtSplit {
    /// Divides the triangles of a tile.
    pub(super) fn of(places: &[Place], triangles: &[[u32; 3]]) -> Self {
        let (hanging, surface): (Vec<_>, Vec<_>) = triangles
            .iter()
            .partition(|triangle| is_on_side(triangle.map(|corner| places[corner as usize].0)));
        let mut is_low = vec![false; places.len()];
        hanging.as_flattened().iter().for_each(|corner| is_low[*corner as usize] = true);
        surface.as_flattened().iter().for_each(|corner| is_low[*corner as usize] = false);
        Self { surface, hanging, is_low }
    }

    /// Vertices of the skirt that are not `depth` steps vertically below a vertex of the rim.
    pub(super) fn off_depth(&self, places: &[Place], depth: f64) -> u64 {
        let vertices = places.iter().zip(&self.is_low);
        let rim = vertices.clone().filter(|(_, is_low)| !**is_low).map(|(place, _)| *place);
        let rim: HashMap<[u16; 2], f64> = rim.collect();
        let low = vertices.filter(|(_, is_low)| **is_low);
        low.filter(|((at, height), _)| rim.get(at).is_none_or(|above| above - height != depth))
            .count() as u64
    }

    /// Edges where the skirt is not joined to the rim or to itself. All edges are passed once in each direction, except
    /// the lower ones of the skirt, of which there are as many as of the rim.
    pub(super) fn torn(&self) -> u64 {
        let rim = open_edges(self.surface.iter()).len() as u64;
        let open = open_edges(self.surface.iter().chain(&self.hanging));
        let lower = open.iter().filter(|edge| edge.iter().all(|end| self.is_low[*end as usize]));
        let lower = lower.count() as u64;
        open.len() as u64 - lower + rim.abs_diff(lower)
    }
}

/// Whether three positions are on the same side of the tile.
fn is_on_side(corners: [[u16; 2]; 3]) -> bool {
    (0..2).any(|axis| [0, LAST].iter().any(|side| corners.iter().all(|at| at[axis] == *side)))
}

/// Directed edges that are not passed once in each direction.
fn open_edges<'a>(triangles: impl Iterator<Item = &'a [u32; 3]>) -> Vec<[u32; 2]> {
    let mut counts: HashMap<[u32; 2], u32> = HashMap::new();
    for edge in triangles.flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]) {
        *counts.entry(edge).or_default() += 1;
    }
    let all = counts.iter();
    all.filter(|([a, b], count)| **count != 1 || counts.get(&[*b, *a]) != Some(&1))
        .map(|(edge, _)| *edge)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEPTH: f64 = 3.0;

    /// A tile with a vertex in its middle, and a skirt: places and triangles.
    fn tile() -> (Vec<Place>, Vec<[u32; 3]>) {
        let corners = [[0, 0], [LAST, 0], [LAST, LAST], [0, LAST]];
        let heights = [5.0, 7.0, 6.0, 9.0];
        let rim = corners.into_iter().zip(heights);
        let low = rim.clone().map(|(at, height)| (at, height - DEPTH));
        let places = rim.chain([([99, 99], 4.0)]).chain(low).collect();
        let around = (0..4).flat_map(|a| {
            let b = (a + 1) % 4;
            [[a, b, 4], [b, a, a + 5], [b, a + 5, b + 5]]
        });
        (places, around.collect())
    }

    #[test]
    fn skirt_and_surface_are_divided() {
        let (places, triangles) = tile();
        let apart = SkirtSplit::of(&places, &triangles);
        assert_eq!((apart.surface.len(), apart.hanging.len()), (4, 8));
        assert_eq!(apart.is_low, [false, false, false, false, false, true, true, true, true]);
        assert_eq!((apart.torn(), apart.off_depth(&places, DEPTH)), (0, 0));
        assert_eq!(apart.off_depth(&places, DEPTH + 1.0), 4);
    }

    #[test]
    fn torn_and_moved_skirts_are_found() {
        let (places, triangles) = tile();
        for gone in (0..triangles.len()).filter(|i| i % 3 > 0) {
            let mut left = triangles.clone();
            left.remove(gone);
            assert!(SkirtSplit::of(&places, &left).torn() > 0, "{gone}");
            let mut turned = triangles.clone();
            turned[gone].swap(0, 1);
            assert!(SkirtSplit::of(&places, &turned).torn() > 0, "{gone}");
        }
        for moved in 5..9 {
            let mut places = places.clone();
            places[moved].1 += 1.0;
            assert_eq!(SkirtSplit::of(&places, &triangles).off_depth(&places, DEPTH), 1);
        }
        // None at all.
        let surface: Vec<_> = triangles.iter().copied().step_by(3).collect();
        assert!(SkirtSplit::of(&places, &surface).torn() > 0);
    }
}
