//! A triangle of the surface of a tile, and how it is seen from a sample.

use crate::globe::{EastNorthUpFrame, Vector};

/// A triangle of the surface.
pub(crate) struct TileFacet {
    pub(crate) corners: [Vector; 3],
    /// At right angles to it; its length is twice the area.
    pub(crate) across: Vector,
    area: f64,
    /// Those across from each corner.
    pub(crate) twins: [u32; 3],
    /// Whether the side across from each corner lies on a parallel.
    pub(crate) on_parallel: [bool; 3],
}

impl TileFacet {
    /// Of corners, their positions in the tile, and the triangles across from each.
    pub(crate) fn new(corners: [Vector; 3], at: [[i32; 2]; 3], twins: [u32; 3]) -> Self {
        let across = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let on_parallel = [0, 1, 2].map(|k| at[(k + 1) % 3][1] == at[(k + 2) % 3][1]);
        Self { corners, across, area: across.length(), twins, on_parallel }
    }

    /// As it is seen from a sample.
    #[inline]
    pub(crate) fn seen_from(&self, frame: &EastNorthUpFrame) -> FacetView {
        let corners = self.corners.map(|corner| frame.look(corner));
        let part = |k: usize| {
            let ([ax, ay, _], [bx, by, _]) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
            ax * by - ay * bx
        };
        FacetView {
            corners,
            parts: [part(0), part(1), part(2)],
            square: frame.square,
            area: self.area,
        }
    }
}

/// A triangle as it is seen from a sample.
pub(crate) struct FacetView {
    /// As [`EastNorthUpFrame::look`] has them.
    pub(crate) corners: [[f64; 3]; 3],
    /// Of each corner, twice the area between the sample and the side across from it, from above, times `square`.
    pub(crate) parts: [f64; 3],
    square: f64,
    /// Twice the area of the triangle.
    area: f64,
}

impl FacetView {
    /// How far the sample is from the plane, along what is upright there, and metres up the plane for one along it.
    pub(crate) fn plane(&self) -> [f64; 2] {
        let ([a, b, c], [p, q, r]) = (self.corners, self.parts);
        let flat = (p + q + r).abs();
        [(p * a[2] + q * b[2] + r * c[2]).abs() / flat, self.area * self.square / flat]
    }

    /// How far the sample, whose place may be off by so many metres, is from the plane.
    pub(crate) fn off(&self, doubt: f64) -> f64 {
        let [off, steep] = self.plane();
        off + steep * doubt
    }

    /// Whether the sample is nearer to the side across from a corner than its place may be off by.
    pub(crate) fn is_beside(&self, corner: usize, doubt: f64) -> bool {
        let [[ax, ay, _], [bx, by, _]] = [1, 2].map(|k| self.corners[(corner + k) % 3]);
        let [x, y] = [bx - ax, by - ay];
        self.parts[corner].powi(2) <= (x * x + y * y) * self.square * doubt * doubt
    }
}
