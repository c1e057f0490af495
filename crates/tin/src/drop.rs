//! The drop pass: removes vertices whose star can be filled with other triangles within the tolerance.
//!
//! Greedy insertion leaves vertices that later ones made redundant. For each vertex, the hole that it would leave is
//! filled with Delaunay triangles. The vertex is removed if every sample under these is within the tolerance, and if
//! their circumcircles are not larger than the limit that keeps changes at a seam near it (see `tile`).
//!
//! Measured: dropping vertices in the order of the error they leave, instead of that of the sweep, changes their
//! number by less than 0.1 %. Rounds of greedy and drop at 1.1 to 4 times the tolerance before the last one leave 1
//! to 2.4 % fewer vertices for 20 to 110 % more time.
//!
//! If the mesh need not be Delaunay, a hole may be filled with any triangles: see `refill`.

use super::adjust::AdjustScratch;
use super::angles::MinimumAngle;
use super::facet::double_area;
use super::heights::HeightField;
use super::lattice_position::TilePosition;
use super::mesh::{LatticeMesh, LatticeTriangle, NONE, TriangleScanState, next};
use super::refill::{self, RefillBuffers};
use super::tolerance::InsertionCriteria;
use terrane_base::bits::BitSet;
use terrane_base::geom::predicates::{in_circle, orient};

/// Stars with more triangles than this are skipped, as the time to fill one is cubic in their number.
const MAX_DEGREE: usize = 24;

/// Settings and buffers of the drop pass.
#[derive(Debug, Default)]
pub(super) struct DropScratch {
    /// Vertices that are never dropped, by sample.
    fixed: BitSet,
    /// Fixed vertices, and vertices that could not be dropped and whose star has not changed since, by sample.
    settled: BitSet,
    /// Triangles of the star, counter-clockwise. Their slots in the mesh are reused by the new triangles.
    star: Vec<u32>,
    /// Outline of the hole, counter-clockwise: a vertex, and the half-edge beyond the edge from it to the next one.
    ring: Vec<(TilePosition, u32)>,
    /// New triangles that fill the hole.
    fill: Vec<LatticeTriangle>,
    /// Maximum squared radius of a new triangle's circumcircle, in cells.
    max_square_radius: f64,
    /// Minimum angle of new triangles.
    min_angle: Option<MinimumAngle>,
    /// New triangles need not be Delaunay.
    allows_any: bool,
    any_fill: RefillBuffers,
}

/// Tries to drop every vertex that is not settled, in one sweep over the corners of all triangles. A drop unsettles the
/// corners of its new triangles; the sweep tries them again if it has not passed all their triangles. Expected time
/// linear in the vertices and the samples of their stars.
pub(super) fn drop_redundant(
    judge: &InsertionCriteria<'_>,
    mesh: &mut LatticeMesh,
    scratch: &mut DropScratch,
) {
    for half_edge in (0..mesh.tris.len() as u32).flat_map(|id| 4 * id..4 * id + 3) {
        if judge.field.is_stopped_in(half_edge as usize) {
            return;
        }
        let state = mesh.tris[(half_edge >> 2) as usize].state;
        if !matches!(state, TriangleScanState::Free | TriangleScanState::Outside)
            && scratch.settled.insert(judge.field.index(mesh.origin(half_edge)))
            && scratch.try_drop(judge, mesh, half_edge).is_some()
        {
            scratch.unsettle_filled(judge.field);
        }
    }
}

impl DropScratch {
    /// Begins a new mesh: all vertices except `fixed` may be dropped.
    pub(super) fn settle(&mut self, field: &HeightField, fixed: &[TilePosition]) {
        let samples = field.width() as usize * field.height() as usize;
        self.fixed.reset(samples);
        self.settled.reset(samples);
        for &p in fixed {
            self.fixed.insert(field.index(p));
            self.settled.insert(field.index(p));
        }
    }

    /// Unsettles the corners of triangles that have changed since the mesh was loaded.
    pub(super) fn unsettle_changed(&mut self, field: &HeightField, mesh: &LatticeMesh) {
        for tri in mesh.ids().map(|id| &mesh.tris[id as usize]).filter(|tri| tri.source == NONE) {
            self.unsettle_corners(tri, field);
        }
    }

    /// Unsettles the corners of triangles with a corner that has moved since this was last called.
    pub(super) fn unsettle_moved(
        &mut self,
        field: &HeightField,
        mesh: &LatticeMesh,
        adjust: &mut AdjustScratch,
    ) {
        for tri in mesh.ids().map(|id| &mesh.tris[id as usize]) {
            if adjust.has_moved(field, tri) {
                self.unsettle_corners(tri, field);
            }
        }
        adjust.forget_moves(field);
    }

    /// Limits circumcircles of new triangles to that of a square with sides of `spacing` cells.
    pub(super) fn limit_circles(&mut self, spacing: u32) {
        self.max_square_radius = f64::from(spacing).powi(2) / 2.0;
    }

    /// Sets the minimum angle of new triangles.
    pub(super) fn limit_angles(&mut self, bound: Option<MinimumAngle>) {
        self.min_angle = bound;
    }

    /// Sets whether new triangles may be any triangles, or only Delaunay ones.
    pub(super) fn allow_any(&mut self, any: bool) {
        self.allows_any = any;
    }

    /// True if the circumcircle of a triangle is within the limit.
    fn has_small_circle(&self, tri: &LatticeTriangle) -> bool {
        let [a, b, c] = tri.corners;
        // With sides a, b, c and double area D the radius is abc / 2D. It is squared to avoid square roots.
        let double_area = double_area(tri.corners) as f64;
        a.square_distance(b) * b.square_distance(c) * c.square_distance(a)
            <= 4.0 * double_area * double_area * self.max_square_radius
    }

    /// True if no angle of a triangle is below the minimum.
    fn has_wide_angles(&self, tri: &LatticeTriangle) -> bool {
        self.min_angle.is_none_or(|bound| bound.holds(tri.corners))
    }

    /// Unsettles the corners of the triangles that filled the last hole: their stars have changed.
    fn unsettle_filled(&mut self, field: &HeightField) {
        for i in 0..self.fill.len() {
            let tri = self.fill[i];
            self.unsettle_corners(&tri, field);
        }
    }

    fn unsettle_corners(&mut self, tri: &LatticeTriangle, field: &HeightField) {
        for at in tri.corners.map(|p| field.index(p)) {
            if !self.fixed.contains(at) {
                self.settled.remove(at);
            }
        }
    }

    /// Removes the vertex from which `half_edge` starts if the hole can be filled within the tolerance and the other
    /// limits. Returns the new triangles; `None`, with the mesh unchanged, if the vertex stays.
    pub(super) fn try_drop(
        &mut self,
        judge: &InsertionCriteria<'_>,
        mesh: &mut LatticeMesh,
        half_edge: u32,
    ) -> Option<&[u32]> {
        let vertex = mesh.origin(half_edge);
        let is_droppable = self.collect_star(mesh, half_edge)
            && if self.allows_any {
                self.refill_by_any(judge, vertex)
            } else {
                self.refill_by_ears(judge, vertex)
            };
        is_droppable.then(|| self.replace_star(mesh))
    }

    /// Fills the hole with Delaunay triangles. True if all requirements hold; the cheap ones are tested first.
    fn refill_by_ears(&mut self, judge: &InsertionCriteria<'_>, vertex: TilePosition) -> bool {
        self.cut_ears()
            && self.fill.iter().all(|tri| self.has_small_circle(tri) && self.has_wide_angles(tri))
            // The vertex itself is the sample most likely to exceed the tolerance, and needs no scan.
            && self.fill.iter().find_map(|tri| judge.stays_within(tri.corners, vertex))
                == Some(true)
            && self.are_diagonals_within(judge)
            && self.fill.iter().all(|tri| judge.candidate(tri.corners, 0).is_none())
    }

    /// Fills the hole with the best triangles that meet all requirements. True if there are any.
    fn refill_by_any(&mut self, judge: &InsertionCriteria<'_>, vertex: TilePosition) -> bool {
        let Self { any_fill, min_angle, ring, star, fill, .. } = self;
        any_fill.fill(judge, *min_angle, vertex, ring, star, fill)
    }

    /// Collects the triangles around the vertex from which `half_edge` starts, and the outline of the hole. False if
    /// the vertex lies on a border or has too many triangles.
    fn collect_star(&mut self, mesh: &LatticeMesh, half_edge: u32) -> bool {
        let max_degree = if self.allows_any { refill::MAX_DEGREE } else { MAX_DEGREE };
        if !mesh.star(half_edge, max_degree, &mut self.star) {
            return false;
        }
        self.ring.clear();
        // `star` has half-edges that leave the vertex; the next edge of each triangle is on the outline.
        for at in &mut self.star {
            self.ring.push(mesh.tris[(*at >> 2) as usize].side(next(*at & 3)));
            *at >>= 2;
        }
        self.star.len() >= 3
    }

    /// Cuts Delaunay ears off the hole until it is filled (Devillers 1999, without the priority queue, as stars are
    /// small). The n-th triangle will take the slot of the n-th triangle of the star. False if there is no ear.
    fn cut_ears(&mut self) -> bool {
        self.fill.clear();
        while self.ring.len() > 3 {
            let Some(ear) = self.find_ear() else { return false };
            let [before, _, after] = self.around(ear);
            let ((a, ab), (b, bc), (c, _)) = (self.ring[before], self.ring[ear], self.ring[after]);
            // Edge 2 of the ear, from c to a, now lies beyond the edge from a to c of the smaller outline.
            let diagonal = 4 * self.star[self.fill.len()] + 2;
            self.fill.push(LatticeTriangle::new([a, b, c], [ab, bc, NONE]));
            self.ring[before].1 = diagonal;
            self.ring.remove(ear);
        }
        let [(a, ab), (b, bc), (c, ca)] = [self.ring[0], self.ring[1], self.ring[2]];
        self.fill.push(LatticeTriangle::new([a, b, c], [ab, bc, ca]));
        orient(a.lattice(), b.lattice(), c.lattice()) > 0
    }

    /// Indices of the outline vertices before `i`, at `i` and after `i`.
    fn around(&self, i: usize) -> [usize; 3] {
        let n = self.ring.len();
        [if i == 0 { n - 1 } else { i - 1 }, i, if i + 1 == n { 0 } else { i + 1 }]
    }

    /// The first vertex of the outline that forms a counter-clockwise triangle with its neighbours whose circumcircle
    /// contains no other vertex of the outline.
    fn find_ear(&self) -> Option<usize> {
        (0..self.ring.len()).find(|&ear| {
            let around = self.around(ear);
            let [a, b, c] = around.map(|i| self.ring[i].0.lattice());
            orient(a, b, c) > 0
                && self
                    .ring
                    .iter()
                    .enumerate()
                    .all(|(i, (d, _))| around.contains(&i) || in_circle(a, b, c, d.lattice()) <= 0)
        })
    }

    /// True if the edges between new triangles are within the tolerance between samples, or if that is not requested.
    fn are_diagonals_within(&self, judge: &InsertionCriteria<'_>) -> bool {
        // Each ear has one new edge, from its last corner to its first; the last triangle has none.
        let ears = &self.fill[..self.fill.len() - 1];
        ears.iter().all(|ear| judge.edge_keeps([ear.corners[2], ear.corners[0]]))
    }

    /// Puts the new triangles into slots of the star, and frees the two slots that are left.
    fn replace_star(&mut self, mesh: &mut LatticeMesh) -> &[u32] {
        // All triangles are stored before any edge is linked, as new triangles are neighbours of each other.
        for (&id, &tri) in self.star.iter().zip(&self.fill) {
            mesh.tris[id as usize] = LatticeTriangle { state: TriangleScanState::Passed(0), ..tri };
        }
        for (&id, tri) in self.star.iter().zip(&self.fill) {
            (0..3).filter(|&i| tri.twins[i as usize] != NONE).for_each(|i| {
                mesh.link(4 * id + i, tri.twins[i as usize]);
            });
        }
        self.star[self.fill.len()..].iter().for_each(|&id| mesh.remove(id));
        &self.star[..self.fill.len()]
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::greedy::{WorkLists, fit};
    use crate::heights::HeightWindow;
    use crate::scan::available;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    const SIDE: u32 = 24;

    /// The corners of all triangles around a vertex.
    fn star(mesh: &LatticeMesh, p: TilePosition) -> BTreeSet<[TilePosition; 3]> {
        let around = mesh.ids().map(|id| mesh.tris[id as usize].corners);
        around.filter(|corners| corners.contains(&p)).collect()
    }

    proptest! {
        /// A reference sweep tries a vertex again whenever its triangles differ from those of all earlier failures.
        #[test]
        fn a_vertex_is_tried_again_when_its_star_has_changed(
            z in prop::collection::vec(0..24_u8, (SIDE * SIDE) as usize), tolerance in 6..16_u8,
            fixed in prop::collection::vec((0..SIDE, 0..SIDE), 0..40)
        ) {
            let z: Vec<f32> = z.into_iter().map(f32::from).collect();
            let heights = HeightWindow { width: SIDE, height: SIDE, f32: &z, f64: None };
            let mut field = HeightField::default();
            field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
            let fixed: Vec<_> = fixed.into_iter().map(|(col, row)| TilePosition::new(col, row)).collect();
            let judge = InsertionCriteria::of_samples(&field, available()[0].1, tolerance.into());
            let [mut mesh, mut reference] = [(); 2].map(|()| {
                let mut mesh = LatticeMesh::default();
                mesh.reset_to_rectangle(SIDE - 1, SIDE - 1);
                fit(&judge, &mut mesh, &mut WorkLists::default(), false);
                mesh
            });
            let mut scratch = DropScratch::default();
            scratch.limit_circles(2 * SIDE);
            scratch.settle(&field, &fixed);
            drop_redundant(&judge, &mut mesh, &mut scratch);
            let mut failed = BTreeSet::new();
            for half_edge in (0..reference.tris.len() as u32).flat_map(|id| 4 * id..4 * id + 3) {
                let p = reference.origin(half_edge);
                let is_free = reference.tris[(half_edge >> 2) as usize].state == TriangleScanState::Free;
                if !is_free && !fixed.contains(&p) && failed.insert((p, star(&reference, p))) {
                    scratch.try_drop(&judge, &mut reference, half_edge);
                }
            }
            let corners = |mesh: &LatticeMesh| -> Vec<_> {
                mesh.ids().map(|id| (id, mesh.tris[id as usize].corners)).collect()
            };
            prop_assert_eq!(corners(&mesh), corners(&reference));
        }
    }

    /// True if every sample of a triangle is within the tolerance: a reference in integers, sample by sample.
    pub(crate) fn is_within(
        field: &HeightField,
        corners: [TilePosition; 3],
        tolerance: i64,
    ) -> bool {
        let [a, b, c] = corners.map(TilePosition::lattice);
        let z = field.vertices(corners).map(|z| z as i64);
        (0..field.width() * field.height())
            .map(|i| TilePosition::new(i % field.width(), i / field.width()))
            .all(|at| {
                let q = at.lattice();
                let weights = [orient(b, c, q), orient(c, a, q), orient(a, b, q)];
                let height = field.sample(at) as i64;
                let off: i64 = (0..3).map(|i| weights[i] * (z[i] - height)).sum();
                weights.iter().any(|&weight| weight < 0) || off.abs() <= tolerance * orient(a, b, c)
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// All vertices are tried in turn. If the mesh was made for a smaller tolerance, many can be dropped.
        #[test]
        fn a_vertex_is_dropped_if_its_filled_star_is_within_the_tolerance(
            z in prop::collection::vec(0..24_u8, (SIDE * SIDE) as usize), tolerance in 6..16_u8,
            finer in 0..3_u8
        ) {
            let z: Vec<f32> = z.into_iter().map(f32::from).collect();
            let heights = HeightWindow { width: SIDE, height: SIDE, f32: &z, f64: None };
            let mut field = HeightField::default();
            field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
            let mut mesh = LatticeMesh::default();
            mesh.reset_to_rectangle(SIDE - 1, SIDE - 1);
            let judge = |tolerance: u8| InsertionCriteria::of_samples(&field, available()[0].1, tolerance.into());
            fit(&judge(tolerance - finer), &mut mesh, &mut WorkLists::default(), false);
            let mut scratch = DropScratch::default();
            scratch.limit_circles(2 * SIDE);
            for half_edge in (0..mesh.tris.len() as u32).flat_map(|id| 4 * id..4 * id + 3) {
                if mesh.tris[(half_edge >> 2) as usize].state == TriangleScanState::Free {
                    continue;
                }
                let is_filled = scratch.collect_star(&mesh, half_edge) && scratch.cut_ears();
                let expected = is_filled && scratch.fill.iter().all(|tri| {
                    scratch.has_small_circle(tri) && is_within(&field, tri.corners, tolerance.into())
                });
                let vertex = mesh.origin(half_edge);
                let found = scratch.try_drop(&judge(tolerance), &mut mesh, half_edge).is_some();
                prop_assert_eq!(found, expected, "{:?}", vertex);
                if found {
                    mesh.validate();
                    prop_assert!(star(&mesh, vertex).is_empty());
                }
            }
        }
    }

    #[test]
    fn corners_of_changed_triangles_are_unsettled_unless_fixed() {
        let mut field = HeightField::default();
        let heights = HeightWindow { width: 5, height: 4, f32: &[0.0; 20], f64: None };
        field.load(&heights, [0, 0, 5, 4], [0; 4], None);
        let mut mesh = LatticeMesh::default();
        mesh.reset_to_rectangle(4, 3);
        let fixed = TilePosition::new(4, 0);
        for (changed, expected) in [
            ([false, false], vec![]),
            ([true, false], vec![(0, 0), (4, 3)]),
            ([false, true], vec![(0, 0), (4, 3), (0, 3)]),
            ([true, true], vec![(0, 0), (4, 3), (0, 3)]),
        ] {
            for (tri, is_changed) in mesh.tris.iter_mut().zip(changed) {
                tri.source = if is_changed { NONE } else { 0 };
            }
            let mut scratch = DropScratch::default();
            scratch.settle(&field, &[fixed]);
            (0..20).for_each(|at| {
                scratch.settled.insert(at);
            });
            scratch.unsettle_changed(&field, &mesh);
            for at in 0..20_u32 {
                let is_tried = !scratch.settled.contains(at as usize);
                assert_eq!(is_tried, expected.contains(&(at % 5, at / 5)), "{at} {changed:?}");
            }
        }
    }

    #[test]
    fn corners_of_triangles_that_have_moved_are_unsettled_once() {
        let z: Vec<f32> =
            (0..SIDE * SIDE).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 27) as f32).collect();
        let heights = HeightWindow { width: SIDE, height: SIDE, f32: &z, f64: None };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
        field.free_heights();
        let judge = InsertionCriteria::of_samples(&field, available()[0].1, 14.0);
        let mut mesh = LatticeMesh::default();
        mesh.reset_to_rectangle(SIDE - 1, SIDE - 1);
        fit(&judge, &mut mesh, &mut WorkLists::default(), false);
        let mut adjust = AdjustScratch::default();
        adjust.reset(&field, &[]);
        let chosen = mesh.tris[mesh.tris.len() / 2].corners;
        adjust.mark_due(&field, &mesh, |tri| tri.corners == chosen);
        assert!(adjust.sweep(&judge, &mesh, 14.0));
        let fixed = chosen[0];
        let mut scratch = DropScratch::default();
        let settle_all = |scratch: &mut DropScratch| {
            scratch.settle(&field, &[fixed]);
            (0..z.len()).for_each(|at| {
                scratch.settled.insert(at);
            });
        };
        let beside: BTreeSet<_> = mesh
            .ids()
            .map(|id| &mesh.tris[id as usize])
            .filter(|tri| adjust.has_moved(&field, tri))
            .flat_map(|tri| tri.corners)
            .filter(|&p| p != fixed)
            .collect();
        for expected in [beside, BTreeSet::new()] {
            settle_all(&mut scratch);
            scratch.unsettle_moved(&field, &mesh, &mut adjust);
            let tried: BTreeSet<_> = (0..SIDE * SIDE)
                .map(|i| TilePosition::new(i % SIDE, i / SIDE))
                .filter(|&p| !scratch.settled.contains(field.index(p)))
                .collect();
            assert_eq!(tried, expected);
        }
    }

    /// The diameter of the circumcircle of a right triangle is its longest side.
    #[test]
    fn circumcircles_are_limited_to_that_of_a_square() {
        let mut scratch = DropScratch::default();
        for (spacing, corners, expected) in [
            (10, [(0, 0), (10, 0), (0, 10)], true),
            (10, [(0, 0), (11, 0), (0, 10)], false),
            (10, [(3, 5), (13, 5), (13, 15)], true),
            (10, [(3, 5), (3 + 14, 5), (3 + 14, 7)], true),
            (10, [(3, 5), (3 + 14, 5), (3 + 14, 8)], false),
            // The diameter is 50; the diagonal of a square of side 36 is 50.9, of side 35 it is 49.5.
            (36, [(25, 0), (49, 18), (5, 40)], true),
            (35, [(25, 0), (49, 18), (5, 40)], false),
            (1, [(0, 0), (1, 0), (0, 1)], true),
            (1, [(0, 0), (2, 0), (0, 1)], false),
        ] {
            scratch.limit_circles(spacing);
            let corners = corners.map(|(col, row)| TilePosition::new(col, row));
            let tri = LatticeTriangle::new(corners, [NONE; 3]);
            assert_eq!(scratch.has_small_circle(&tri), expected, "{spacing} {corners:?}");
        }
    }
}
