//! Sides of triangles, and which triangle lies beyond each: across degenerate ones, and at a pole, where many vertices are
//! one place.

use super::super::ellipsoid::Vector;
use super::NONE;

/// Metres from the axis below which a vertex is at a pole: rounding.
const POLAR: f64 = 1e-6;

/// Of each half-edge, three to a triangle, the one on the other side; [`NONE`] at borders, and where more than two meet.
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
    pub(super) fn of(triangles: &[[u32; 3]], coincide: impl Fn(u32, u32) -> bool) -> Self {
        let sides = |&[a, b, c]: &[u32; 3]| {
            let sides = [coincide(a, b), coincide(b, c), coincide(c, a)];
            sides.contains(&true).then_some(sides)
        };
        Self(triangles.iter().map(sides).collect())
    }

    /// The first triangle with an area beyond a side: a triangle with one collapsed side is crossed from one of the other
    /// two sides, which coincide, to the other.
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

/// The vertices at the south pole and at the north pole.
pub(super) fn poles(positions: &[Vector]) -> [Vec<u32>; 2] {
    let is_pole = |[x, y, _]: &Vector| x.abs().max(y.abs()) < POLAR;
    let at = |is_north: bool| {
        let all = (0..).zip(positions).filter(|(_, at)| is_pole(at) && (at[2] > 0.0) == is_north);
        all.map(|(vertex, _)| vertex).collect()
    };
    [false, true].map(at)
}
