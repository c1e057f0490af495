//! The plane of a triangle with corners at whole steps, and distances of points from it, in whole numbers.

use crate::sections::floor;
use crate::{ProofTriangle, ProofVertex};
use terrane_base::geom::Point;

/// Positions are from 0 to below this many steps, heights at most this many from 0: products of
/// differences then fit `i64`.
const REACH: i64 = 1 << 30;
/// Below this doubled area even the product of an area and a difference of heights fits `i64`.
const NARROW: i64 = 1 << 30;

/// A triangle with an area and corners at whole steps, counter-clockwise.
#[derive(Clone, Copy, Debug)]
pub(super) struct ProofFacet {
    origin: [i64; 3],
    /// From the origin to the other corners.
    arms: [[i64; 3]; 2],
    /// Doubled.
    pub(super) area: i64,
}

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FacetHit {
    /// How far the point is above the plane, times the doubled area.
    pub(super) off: i128,
    /// The distance in steps.
    pub(super) distance: f64,
    /// On no edge.
    pub(super) is_strict: bool,
}

impl ProofFacet {
    /// `None` when the triangle has no area or its corners are not all at whole steps within reach.
    pub(super) fn new(triangle: &ProofTriangle) -> Option<Self> {
        let [a, b, c] = triangle.corners.map(|corner| whole(&corner));
        let (a, b, c) = (a?, b?, c?);
        let [b, c] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
        let area = b[0] * c[1] - b[1] * c[0];
        let arms = if area < 0 { [c, b] } else { [b, c] };
        (area != 0).then_some(Self { origin: a, arms, area: area.abs() })
    }

    /// The position of a point relative to the triangle; `None` outside of it.
    #[inline]
    pub(super) fn hit(&self, point: Point) -> Option<FacetHit> {
        let [x0, y0, z0] = self.origin;
        let [b, c] = self.arms;
        let (x, y) = (i64::from(point.x) - x0, i64::from(point.y) - y0);
        let towards_b = x * c[1] - y * c[0];
        let towards_c = b[0] * y - b[1] * x;
        let rest = self.area - towards_b - towards_c;
        if towards_b | towards_c | rest < 0 {
            return None;
        }
        let is_strict = towards_b > 0 && towards_c > 0 && rest > 0;
        let z = i64::from(point.z) - z0;
        if self.area < NARROW {
            let off = self.area * z - towards_b * b[2] - towards_c * c[2];
            let distance = off.unsigned_abs() as f64 / self.area as f64;
            return Some(FacetHit { off: i128::from(off), distance, is_strict });
        }
        let off = wide_product(self.area, z)
            - wide_product(towards_b, b[2])
            - wide_product(towards_c, c[2]);
        let distance = off.unsigned_abs() as f64 / self.area as f64;
        Some(FacetHit { off, distance, is_strict })
    }
}

#[inline]
fn wide_product(a: i64, b: i64) -> i128 {
    i128::from(a) * i128::from(b)
}

/// Position and height of a vertex, when they are whole steps within reach.
fn whole(vertex: &ProofVertex) -> Option<[i64; 3]> {
    let (col, row) = (floor(vertex.at.col), floor(vertex.at.row));
    let is_near = (0..REACH).contains(&col) && (0..REACH).contains(&row);
    let is_level = vertex.z.fract() == 0.0 && vertex.z.abs() <= REACH as f64;
    (is_near && is_level && vertex.at.is_sample()).then_some([col, row, vertex.z as i64])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ProofPosition;

    fn triangle(corners: [[i64; 3]; 3]) -> ProofTriangle {
        ProofTriangle {
            corners: corners
                .map(|[x, y, z]| ProofVertex { at: ProofPosition::sample(x, y), z: z as f64 }),
        }
    }

    #[test]
    fn distances_in_narrow_and_wide_triangles() {
        for side in [10, REACH - 1] {
            let corners = [[0, 0, 0], [side, 0, 0], [0, side, side]];
            for turned in [corners, [corners[1], corners[0], corners[2]]] {
                let plane = ProofFacet::new(&triangle(turned)).unwrap();
                let hit = |x, y, z| plane.hit(Point::new(x, y, z));
                assert_eq!(plane.area, side * side);
                assert_eq!(hit(2, 3, 3).unwrap().off, 0);
                let FacetHit { off, distance, is_strict } = hit(1, 1, -4).unwrap();
                assert_eq!((off, distance), (-5 * i128::from(side * side), 5.0));
                assert!(is_strict && !hit(0, 1, 0).unwrap().is_strict);
                assert!(hit(-1, 1, 0).is_none() && hit(1, side as i32, 0).is_none());
            }
        }
    }

    #[test]
    fn only_triangles_at_whole_steps_have_a_plane_in_whole_numbers() {
        assert!(ProofFacet::new(&triangle([[0, 0, 0], [1, 1, 0], [2, 2, 5]])).is_none());
        assert!(ProofFacet::new(&triangle([[0, 0, 0], [REACH, 1, 0], [2, 3, 5]])).is_none());
        let mut free = triangle([[0, 0, 0], [9, 1, 0], [2, 3, 5]]);
        assert!(ProofFacet::new(&free).is_some());
        free.corners[1].z = 0.5;
        assert!(ProofFacet::new(&free).is_none());
        free.corners[1].z = f64::INFINITY;
        assert!(ProofFacet::new(&free).is_none());
        free.corners[1] = ProofVertex { at: ProofPosition::nearest(9.5, 1.0), z: 0.0 };
        assert!(ProofFacet::new(&free).is_none());
    }
}
