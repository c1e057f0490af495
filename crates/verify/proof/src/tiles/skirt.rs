//! Skirts of a tile: walls that hang straight down from its sides, told from its surface by lying upon a side.

use std::collections::HashMap;

use super::ellipsoid::Vector;
use super::tiling::LAST;

/// A vertex: steps from the west and the south, and its height in steps of the level.
type Place = ([u16; 2], f64);

/// Skirt of a tile.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileSkirt {
    /// Earth-centred corners of its triangles.
    pub triangles: Vec<[Vector; 3]>,
}

/// A tile, taken apart.
pub(super) struct SkirtSplit {
    /// Triangles of the surface, by all vertices.
    pub(super) surface: Vec<[u32; 3]>,
    /// Triangles of the skirt.
    pub(super) hanging: Vec<[u32; 3]>,
    /// Whether a vertex belongs to the skirt alone.
    pub(super) is_low: Vec<bool>,
}

impl SkirtSplit {
    /// Of all triangles: those whose corners lie on one side of the tile have no area there, and hang.
    pub(super) fn of(places: &[Place], triangles: &[[u32; 3]]) -> Self {
        let is_hanging = |triangle: &&[u32; 3]| {
            let corners = triangle.map(|corner| places[corner as usize].0);
            let on_side = |axis: usize, side: u16| corners.iter().all(|at| at[axis] == side);
            (0..2).any(|axis| on_side(axis, 0) || on_side(axis, LAST))
        };
        let (hanging, surface): (Vec<_>, Vec<_>) = triangles.iter().partition(is_hanging);
        let mut is_low = vec![false; places.len()];
        hanging.as_flattened().iter().for_each(|corner| is_low[*corner as usize] = true);
        surface.as_flattened().iter().for_each(|corner| is_low[*corner as usize] = false);
        Self { surface, hanging, is_low }
    }

    /// Vertices of the skirt that are not so many steps straight below one of the rim.
    pub(super) fn off_depth(&self, places: &[Place], depth: f64) -> u64 {
        let rim =
            || self.is_low.iter().zip(places).filter(|(low, _)| !**low).map(|(_, place)| *place);
        let heights: HashMap<[u16; 2], f64> = rim().collect();
        let is_off = |(low, (at, height)): &(&bool, &Place)| {
            **low && heights.get(at).is_none_or(|above| above - height != depth)
        };
        self.is_low.iter().zip(places).filter(is_off).count() as u64
    }

    /// Edges where the skirt is torn from the rim, or itself: all of them are passed once in each direction, but for
    /// those of its lower end, which are as many as those of the rim.
    pub(super) fn torn(&self) -> u64 {
        let edges = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        let count = |all: &[&[[u32; 3]]]| {
            let mut counts: HashMap<[u32; 2], u32> = HashMap::new();
            for edge in all.iter().copied().flatten().flat_map(edges) {
                *counts.entry(edge).or_default() += 1;
            }
            counts
        };
        let open = |counts: &HashMap<[u32; 2], u32>| -> Vec<[u32; 2]> {
            let is_open =
                |[a, b]: &[u32; 2]| counts[&[*a, *b]] != 1 || counts.get(&[*b, *a]) != Some(&1);
            counts.keys().copied().filter(is_open).collect()
        };
        let rim = open(&count(&[&self.surface])).len() as u64;
        let left = open(&count(&[&self.surface, &self.hanging]));
        let is_end = |edge: &&[u32; 2]| edge.iter().all(|end| self.is_low[*end as usize]);
        let ends = left.iter().filter(is_end).count() as u64;
        left.len() as u64 - ends + rim.abs_diff(ends)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEPTH: f64 = 3.0;

    /// A square with a vertex in its middle, and a skirt: places and triangles.
    fn square() -> (Vec<Place>, Vec<[u32; 3]>) {
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
    fn a_skirt_is_told_from_the_surface() {
        let (places, triangles) = square();
        let apart = SkirtSplit::of(&places, &triangles);
        assert_eq!((apart.surface.len(), apart.hanging.len()), (4, 8));
        assert_eq!(apart.is_low, [false, false, false, false, false, true, true, true, true]);
        assert_eq!((apart.torn(), apart.off_depth(&places, DEPTH)), (0, 0));
        assert_eq!(apart.off_depth(&places, DEPTH + 1.0), 4);
    }

    #[test]
    fn whatever_is_torn_off_or_moved_is_found() {
        let (places, triangles) = square();
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
