//! Neighbours of triangles across their sides, over degenerate triangles, and at a pole, where many vertices are at one
//! point.

use super::super::ellipsoid::Vector;
use super::NONE;

/// Metres from the axis below which a vertex is at a pole: rounding.
const POLAR: f64 = 1e-6;

/// Twin of each half-edge, three to a triangle; [`NONE`] at borders, and at edges of more than two triangles.
pub(super) fn twins(triangles: &[[u32; 3]]) -> Vec<u32> {
    let corners = triangles.as_flattened();
    let mut all: Vec<([u32; 2], u32)> = (0..corners.len())
        .map(|edge| {
            let next = if edge % 3 == 2 { edge - 2 } else { edge + 1 };
            let [from, to] = [corners[edge], corners[next]];
            ([from.min(to), from.max(to)], edge as u32)
        })
        .collect();
    all.sort_unstable();
    let mut twins = vec![NONE; corners.len()];
    for same in all.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, one), (_, other)] = *same {
            (twins[one as usize], twins[other as usize]) = (other, one);
        }
    }
    twins
}

/// The collapsed sides of degenerate triangles; `None` for all other triangles.
pub(super) struct CollapsedSides(pub(super) Vec<Option<[bool; 3]>>);

impl CollapsedSides {
    pub(super) fn of(triangles: &[[u32; 3]], positions: &[Vector], poles: &[Vec<u32>; 2]) -> Self {
        let sides = triangles.iter().map(|&[a, b, c]| {
            let sides = [[a, b], [b, c], [c, a]].map(|ends| coincide(ends, positions, poles));
            sides.contains(&true).then_some(sides)
        });
        Self(sides.collect())
    }

    /// The first triangle with area beyond a side. A triangle with one collapsed side is crossed between its other two
    /// sides, which coincide.
    pub(super) fn beyond(&self, twins: &[u32], triangle: usize, side: usize) -> Option<usize> {
        let mut edge = twins[3 * triangle + side];
        while edge != NONE {
            let (now, from) = (edge as usize / 3, edge as usize % 3);
            let Some(sides) = self.0[now] else { return Some(now) };
            let through = (0..3).find(|&k| k != from && !sides[k])?;
            edge = twins[3 * now + through];
        }
        None
    }
}

/// Whether two vertices have the same position, or are at the same pole.
fn coincide([a, b]: [u32; 2], positions: &[Vector], poles: &[Vec<u32>; 2]) -> bool {
    // A triangle of a broken tile that names a vertex twice is not degenerate by rounding: it is measured.
    a != b
        && (positions[a as usize] == positions[b as usize]
            || poles.iter().any(|pole| pole.contains(&a) && pole.contains(&b)))
}

/// The vertices at the south pole and at the north pole.
pub(super) fn poles(positions: &[Vector]) -> [Vec<u32>; 2] {
    let mut poles = [Vec::new(), Vec::new()];
    for (vertex, [x, y, z]) in (0..).zip(positions) {
        if x.abs().max(y.abs()) < POLAR {
            poles[usize::from(*z > 0.0)].push(vertex);
        }
    }
    poles
}
