//! A triangle of a tile's surface, and its view from a sample.

use crate::globe::{EastNorthUpFrame, Vector};

/// A triangle of the surface.
pub(crate) struct TileFacet {
    pub(crate) corners: [Vector; 3],
    /// Normal; its length is twice the area.
    pub(crate) across: Vector,
    area: f64,
    /// Neighbours opposite each corner.
    pub(crate) twins: [u32; 3],
    /// Whether the side opposite each corner lies on a parallel.
    pub(crate) on_parallel: [bool; 3],
}

impl TileFacet {
    /// From corners, their positions in the tile, and the opposite neighbours.
    pub(crate) fn new(corners: [Vector; 3], at: [[i32; 2]; 3], twins: [u32; 3]) -> Self {
        let across = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let on_parallel = [0, 1, 2].map(|k| at[(k + 1) % 3][1] == at[(k + 2) % 3][1]);
        Self { corners, across, area: across.length(), twins, on_parallel }
    }

    /// View from a sample.
    #[inline]
    pub(crate) fn view_from(&self, frame: &EastNorthUpFrame) -> FacetView {
        let corners = self.corners.map(|corner| frame.local(corner));
        let parts = [0, 1, 2].map(|k| {
            let ([ax, ay, _], [bx, by, _]) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
            ax * by - ay * bx
        });
        FacetView { corners, parts, square: frame.square, area: self.area }
    }
}

/// A triangle viewed from a sample.
pub(crate) struct FacetView {
    /// Corners, as from [`EastNorthUpFrame::local`].
    pub(crate) corners: [[f64; 3]; 3],
    /// For each corner, twice the area between the sample and the opposite side, from above, times `square`.
    pub(crate) parts: [f64; 3],
    square: f64,
    /// Twice the area of the triangle.
    area: f64,
}

impl FacetView {
    /// Vertical distance of the sample from the plane, and slope of the plane in metres per metre.
    pub(crate) fn plane(&self) -> [f64; 2] {
        let ([a, b, c], [p, q, r]) = (self.corners, self.parts);
        let flat = (p + q + r).abs();
        [(p * a[2] + q * b[2] + r * c[2]).abs() / flat, self.area * self.square / flat]
    }

    /// Distance of the sample from the plane, for a position uncertain by this many metres.
    pub(crate) fn off(&self, doubt: f64) -> f64 {
        let [off, steep] = self.plane();
        off + steep * doubt
    }

    /// Whether the sample is closer to the side opposite a corner than its position is certain.
    pub(crate) fn is_beside(&self, corner: usize, doubt: f64) -> bool {
        let [[ax, ay, _], [bx, by, _]] = [1, 2].map(|k| self.corners[(corner + k) % 3]);
        let [x, y] = [bx - ax, by - ay];
        self.parts[corner].powi(2) <= (x * x + y * y) * self.square * doubt * doubt
    }
}
