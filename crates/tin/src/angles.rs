//! Minimum angle: for a triangle with a smaller one, the sample nearest to its circumcentre becomes a vertex (Ruppert
//! 1995).
//!
//! The nearest sample is at most half the diagonal of a cell from the centre, and so inside the circle, where
//! no vertex is, unless the triangle is half a cell: each insertion makes an end of the triangle it is for, and
//! where nothing stands in the way samples run out at the latest when all triangles are half cells. What
//! stands in the way is the border of the mesh. Where the centre lies beyond it, or a sample so near to it
//! that what comes between is thin again, the edge is split in the middle; one that is frozen is left to the
//! patches of the seams, and what these cannot mend, to a larger patch.

use super::lattice_position::TilePosition;
use super::mesh::{LatticeMesh, NONE, TriangleScanState};
use terrane_base::geom::predicates::Lattice;

/// Minimum angle of triangles, in plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MinimumAngle {
    degrees: f64,
    /// Cosine of the angle plus a tolerance: differences by rounding are ignored.
    cosine: f64,
    /// Squared lengths of a column and a row, with their dot product in between.
    metric: [f64; 3],
}

impl MinimumAngle {
    /// Tolerance for rounding.
    const ROUNDING: f64 = 1e-12;

    /// A minimum angle in degrees; `col` and `row` are the vectors of one column and one row.
    pub fn new(degrees: f64, col: [f64; 2], row: [f64; 2]) -> Self {
        let metric = [[col, col], [col, row], [row, row]].map(|[a, b]| a[0] * b[0] + a[1] * b[1]);
        Self { degrees, cosine: degrees.to_radians().cos() + Self::ROUNDING, metric }
    }

    /// The angle in degrees.
    pub fn degrees(&self) -> f64 {
        self.degrees
    }

    /// The cosine of the smallest angle of a triangle, if it is too small.
    pub(crate) fn excess(&self, corners: [TilePosition; 3]) -> Option<f64> {
        let cosine = self.cosine_of(corners);
        (cosine > self.cosine).then_some(cosine)
    }

    /// True if no angle of a triangle is too small.
    pub fn holds(&self, corners: [TilePosition; 3]) -> bool {
        self.excess(corners).is_none()
    }

    /// The smallest angle of a triangle, in degrees.
    pub fn smallest(&self, corners: [TilePosition; 3]) -> f64 {
        self.cosine_of(corners).min(1.0).acos().to_degrees()
    }

    fn cosine_of(&self, [a, b, c]: [TilePosition; 3]) -> f64 {
        let [xx, xy, yy] = self.metric;
        let mut squares = [[a, b], [b, c], [c, a]].map(|[from, to]| {
            let [dx, dy] = [
                f64::from(to.col()) - f64::from(from.col()),
                f64::from(to.row()) - f64::from(from.row()),
            ];
            xx * dx * dx + 2.0 * xy * dx * dy + yy * dy * dy
        });
        squares.sort_unstable_by(f64::total_cmp);
        // The smallest is opposite the shortest side.
        let [short, middle, long] = squares;
        (middle + long - short) / (2.0 * (middle * long).sqrt())
    }
}

/// A triangle with too small an angle, and its cosine.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThinTriangle {
    id: u32,
    corners: [TilePosition; 3],
    cosine: f64,
}

/// Inserts samples until no mendable triangle has too small an angle. After each round, smallest angles first, `settle`
/// restores the other promises of the mesh. A sample in a triangle is inserted if `may` allows it. Each round is linear
/// in the triangles.
pub(super) fn insert(
    bound: &MinimumAngle,
    mesh: &mut LatticeMesh,
    may: impl Fn(&LatticeMesh, u32, TilePosition) -> bool,
    mut settle: impl FnMut(&mut LatticeMesh),
) {
    let mut star = Vec::new();
    let mut insert = |mesh: &mut LatticeMesh, holder: u32, at: TilePosition| {
        star.clear();
        may(mesh, holder, at) && mesh.insert(holder, at, &mut star)
    };
    loop {
        let mut is_done = true;
        for thin in thin(bound, mesh) {
            is_done &= !mend(mesh, &thin, &mut insert);
        }
        if is_done {
            return;
        }
        settle(mesh);
    }
}

/// The triangles of the surface with too small an angle, the smallest first.
pub(super) fn thin(bound: &MinimumAngle, mesh: &LatticeMesh) -> Vec<ThinTriangle> {
    let tris = mesh.ids().map(|id| (id, &mesh.tris[id as usize]));
    let surface = tris.filter(|(_, tri)| tri.state != TriangleScanState::Outside);
    let thin = surface.filter_map(|(id, tri)| {
        let cosine = bound.excess(tri.corners)?;
        Some(ThinTriangle { id, corners: tri.corners, cosine })
    });
    let mut thin: Vec<_> = thin.collect();
    // Ties by number: the order of insertions decides the mesh.
    thin.sort_unstable_by(|a, b| b.cosine.total_cmp(&a.cosine).then(a.id.cmp(&b.id)));
    thin
}

/// Removes a thin triangle; false if this is not possible, or if it is already gone.
fn mend(
    mesh: &mut LatticeMesh,
    thin: &ThinTriangle,
    insert: &mut impl FnMut(&mut LatticeMesh, u32, TilePosition) -> bool,
) -> bool {
    let tri = &mesh.tris[thin.id as usize];
    if tri.state == TriangleScanState::Free || tri.corners != thin.corners {
        return false;
    }
    let centre = centre(thin.corners);
    match walk(mesh, thin.id, centre) {
        WalkEnd::Border(half_edge) => split(mesh, half_edge, insert),
        WalkEnd::Triangle(holder) => {
            let near = (4 * holder..4 * holder + 3).find(|&edge| encroaches(mesh, centre, edge));
            if near.is_some_and(|half_edge| split(mesh, half_edge, insert)) {
                return true;
            }
            let [col, row] = centre.map(|c| c as u32);
            insert(mesh, holder, TilePosition::new(col, row))
        }
    }
}

/// The sample nearest to the circumcentre of three samples.
fn centre([a, b, c]: [TilePosition; 3]) -> Lattice {
    let origin = a.lattice();
    let [[bx, by], [cx, cy]] = [b, c].map(|p| {
        let [col, row] = p.lattice();
        [f64::from(col - origin[0]), f64::from(row - origin[1])]
    });
    let double = 2.0 * (bx * cy - by * cx);
    let (bb, cc) = (bx * bx + by * by, cx * cx + cy * cy);
    let at = [(cy * bb - by * cc) / double, (bx * cc - cx * bb) / double];
    [0, 1].map(|axis| origin[axis] + (at[axis] + 0.5).floor() as i32)
}

/// The end of a walk towards a position.
pub(super) enum WalkEnd {
    /// The triangle that contains it.
    Triangle(u32),
    /// A border on the way.
    Border(u32),
}

/// Walks from triangle `start` towards a position, as far as the surface goes.
pub(super) fn walk(mesh: &LatticeMesh, start: u32, target: Lattice) -> WalkEnd {
    let mut at = start;
    loop {
        let beyond = (4 * at..4 * at + 3).filter(|&half_edge| !mesh.is_left(half_edge, target));
        let (mut on, mut border) = (None, None);
        for half_edge in beyond {
            match mesh.twin(half_edge) {
                NONE => border = border.or(Some(half_edge)),
                twin if mesh.tris[(twin >> 2) as usize].state == TriangleScanState::Outside => {
                    border = border.or(Some(half_edge));
                }
                twin => on = on.or(Some(twin >> 2)),
            }
        }
        match (on, border) {
            (Some(other), _) => at = other,
            (None, Some(half_edge)) => return WalkEnd::Border(half_edge),
            (None, None) => return WalkEnd::Triangle(at),
        }
    }
}

/// True if an edge of the border is seen from `at` under more than a right angle.
fn encroaches(mesh: &LatticeMesh, at: Lattice, half_edge: u32) -> bool {
    let ends = [mesh.origin(half_edge), mesh.end(half_edge)].map(TilePosition::lattice);
    let [from, to] = ends.map(|end| [0, 1].map(|axis| i64::from(end[axis] - at[axis])));
    mesh.twin(half_edge) == NONE && from[0] * to[0] + from[1] * to[1] < 0
}

/// Splits an edge of the border at its middle, if allowed.
fn split(
    mesh: &mut LatticeMesh,
    half_edge: u32,
    insert: &mut impl FnMut(&mut LatticeMesh, u32, TilePosition) -> bool,
) -> bool {
    let [a, b] = [mesh.origin(half_edge), mesh.end(half_edge)];
    let middle = TilePosition::new(a.col().midpoint(b.col()), a.row().midpoint(b.row()));
    mesh.twin(half_edge) == NONE && insert(mesh, half_edge >> 2, middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_of_a_circle_is_as_far_from_all_corners() {
        for corners in
            [[(0, 0), (7, 1), (2, 9)], [(5, 5), (5, 6), (40, 5)], [(9, 0), (12, 4), (0, 3)]]
        {
            let corners = corners.map(|(col, row)| TilePosition::new(col, row));
            let at = centre(corners);
            let far = corners.map(|p| {
                let [x, y] = p.lattice();
                f64::from(x - at[0]).hypot(f64::from(y - at[1]))
            });
            let spread = far.iter().fold(0.0_f64, |most, one| most.max((one - far[0]).abs()));
            // Rounding moves it by less than half the diagonal of a cell.
            assert!(spread < 2.0_f64.sqrt(), "{corners:?}: {far:?}");
        }
    }
}
