//! Free heights: a vertex may leave its sample's height to minimize the maximum error around it.
//!
//! With fixed neighbours, the error of each sample in a vertex's star is a linear function of the vertex's height. The
//! optimal height therefore solves a linear program in one variable: the intersection of the upper envelopes of
//! increasing and of decreasing errors. Sweeps over the vertices balance the errors, and the drop pass then finds
//! redundant vertices.
//!
//! A mesh starts with a larger tolerance that decreases in stages. Each stage consists of greedy insertion, the drop
//! pass and sweeps over the vertices. A new vertex is moved by a fraction of the tolerance towards the mesh: a vertex
//! exactly on a summit leaves errors on all its sides.
//!
//! Measured, vertices kept against samples' heights (SRTM N44E005 at 30 and 100 m, fractal, smooth), whole
//! grids: sweeps and drops once the mesh is done, 91, 91, 81 and 92 %; from 1.25 times the tolerance in
//! five stages, 79, 82, 67 and 80 %. To solve for the height of every vertex that is inserted, 89, 88, 66 and 85 %: its
//! neighbours are yet to come. Nine meshes of other grids and tolerances, against five stages, new vertices moved by 0.3
//! tolerances, three steps and four rounds: three stages, moved by 0.15, two steps and two rounds, -2.3 to 0.6 % of the
//! vertices and a third of the work less. The same in two stages, 0.4 to 5.4 %; without drops in the first stage, up to
//! 1.0 %; no round at the final tolerance, up to 2.4 %; each vertex tested once in a sweep, 0.5 % more for a tenth of the
//! work less; moves from a gain of 1 in 16 on, 0.7 to 3.7 %.

pub(super) mod star;

use super::exact;
use super::facet::PlaneFacet;
use super::heights::HeightField;
use super::lattice_position::TilePosition;
use super::mesh::{LatticeMesh, LatticeTriangle, NONE, TriangleScanState};
use super::tolerance::InsertionCriteria;
use star::{StarErrors, VertexMove};
use terrane_base::bits::BitSet;

/// Factors of the tolerance in the stages before the final one.
pub(super) const STAGES: [f64; 3] = [1.2, 1.13, 1.06];
/// Sweeps and drops at the final tolerance.
pub(super) const ROUNDS: usize = 2;
/// How far a new vertex is moved towards the mesh (below a summit, above a hollow), in tolerances.
const PUT_IN: f64 = 0.15;
/// Stars with more triangles than this are skipped.
const MAX_DEGREE: usize = 24;
/// Maximum number of envelope intersections tried; the next sweep does the rest.
const STEPS: usize = 2;

/// Sets the height of a new vertex, slightly towards the triangle that held it.
pub(super) fn put_in(judge: &InsertionCriteria<'_>, corners: [TilePosition; 3], at: TilePosition) {
    let InsertionCriteria { field, tolerance, .. } = *judge;
    if at.col() == 0
        || at.row() == 0
        || at.col() + 1 == field.width()
        || at.row() + 1 == field.height()
    {
        return field.move_vertex(at, field.sample(at));
    }
    let facet = PlaneFacet::new(corners, field.vertices(corners));
    let plane = facet.base + facet.gx * f64::from(at.col()) + facet.gy * f64::from(at.row());
    let sample = field.sample(at);
    field.move_vertex(at, sample + (plane - sample).signum() * PUT_IN * tolerance);
    if (field.vertex(at) - sample).abs() > 0.5 * tolerance {
        field.move_vertex(at, sample);
    }
}

/// Buffers of the sweeps.
#[derive(Debug, Default)]
pub(super) struct AdjustScratch {
    /// Vertices whose star has changed since they were last tested.
    due: BitSet,
    /// Vertices that have moved.
    moved: BitSet,
    /// Fixed vertices.
    fixed: BitSet,
    errors: StarErrors,
    /// Half-edges that start from the vertex.
    star: Vec<u32>,
}

impl AdjustScratch {
    /// Resets the lists: no vertex is due or moved, and the `kept` ones are fixed.
    pub(super) fn reset(&mut self, field: &HeightField, kept: &[TilePosition]) {
        let samples = field.width() as usize * field.height() as usize;
        for bits in [&mut self.due, &mut self.moved, &mut self.fixed] {
            bits.reset(samples);
        }
        for &p in kept {
            self.fixed.insert(field.index(p));
        }
    }

    /// Marks the corners of changed triangles as due.
    pub(super) fn mark_changed(&mut self, field: &HeightField, mesh: &LatticeMesh) {
        self.mark_due(field, mesh, |tri| tri.source == NONE);
    }

    /// Marks the corners of the given triangles as due.
    pub(super) fn mark_due(
        &mut self,
        field: &HeightField,
        mesh: &LatticeMesh,
        is_due: impl Fn(&LatticeTriangle) -> bool,
    ) {
        for tri in mesh.ids().map(|id| &mesh.tris[id as usize]).filter(|tri| is_due(tri)) {
            self.mark_corners(field, tri);
        }
    }

    fn mark_corners(&mut self, field: &HeightField, tri: &LatticeTriangle) {
        let corners = tri.corners.map(|p| field.index(p));
        for at in corners.into_iter().filter(|&at| !self.fixed.contains(at)) {
            self.due.insert(at);
        }
    }

    /// True when a corner of a triangle has moved.
    pub(super) fn has_moved(&self, field: &HeightField, tri: &LatticeTriangle) -> bool {
        tri.corners.iter().any(|&p| self.moved.contains(field.index(p)))
    }

    /// No vertex has moved.
    pub(super) fn forget_moves(&mut self, field: &HeightField) {
        self.moved.reset(field.width() as usize * field.height() as usize);
    }

    /// Tests each due vertex, in the order of the triangles; the neighbours of a moved vertex become due again. Returns
    /// true if a vertex moved. No vertex moves further than `tolerance` from its sample. If the judge's tolerance is
    /// the same, all errors stay within it; if it is larger, errors only decrease. Time linear in the samples of the
    /// stars.
    pub(super) fn sweep(
        &mut self,
        judge: &InsertionCriteria<'_>,
        mesh: &LatticeMesh,
        tolerance: f64,
    ) -> bool {
        let mut any = false;
        for half_edge in (0..mesh.tris.len() as u32).flat_map(|id| 4 * id..4 * id + 3) {
            if judge.field.is_stopped_in(half_edge as usize) {
                return false;
            }
            let at = judge.field.index(mesh.origin(half_edge));
            let state = &mesh.tris[(half_edge >> 2) as usize].state;
            if !self.due.contains(at)
                || matches!(state, TriangleScanState::Free | TriangleScanState::Outside)
            {
                continue;
            }
            self.due.remove(at);
            if self.adjust(judge, mesh, half_edge, tolerance) {
                for i in 0..self.star.len() {
                    self.mark_corners(judge.field, &mesh.tris[(self.star[i] >> 2) as usize]);
                }
                self.due.remove(at);
                self.moved.insert(at);
                any = true;
            }
        }
        any
    }

    /// Moves the vertex from which `half_edge` starts to minimize the maximum error of its star, if the gain suffices.
    /// Returns true if it moved.
    fn adjust(
        &mut self,
        judge: &InsertionCriteria<'_>,
        mesh: &LatticeMesh,
        half_edge: u32,
        tolerance: f64,
    ) -> bool {
        if !mesh.star(half_edge, MAX_DEGREE, &mut self.star) {
            return false;
        }
        let field = judge.field;
        let is_final = judge.tolerance <= tolerance;
        self.errors.list(field, mesh, &self.star, is_final);
        let Some(best) = self.errors.best_move(STEPS) else { return false };
        let vertex = mesh.origin(half_edge);
        let (sample, before) = (field.sample(vertex), field.vertex(vertex));
        let target = before + f64::from(best.step);
        let clamped = target.clamp(sample - tolerance, sample + tolerance);
        field.move_vertex(vertex, clamped);
        let is_near = || exact::are_within(field.vertex(vertex), sample, tolerance);
        // The bounds are rounded, too.
        if !is_near() {
            let inner = if clamped > sample { clamped.next_down() } else { clamped.next_up() };
            field.move_vertex(vertex, inner);
        }
        let step = (field.vertex(vertex) - before) as f32;
        let stays = is_near() && self.keeps(judge, mesh, VertexMove { step, ..best }, is_final);
        if !stays {
            field.move_vertex(vertex, before);
        }
        stays
    }

    /// True if a completed move reduces the error and, at the final tolerance, keeps it.
    fn keeps(
        &self,
        judge: &InsertionCriteria<'_>,
        mesh: &LatticeMesh,
        VertexMove { step, before }: VertexMove,
        is_final: bool,
    ) -> bool {
        let largest = self.errors.envelope(step).largest();
        if largest >= before {
            return false;
        }
        if !is_final {
            return true;
        }
        let mut triangles = self.star.iter().map(|&at| mesh.tris[(at >> 2) as usize].corners);
        let hairs = triangles.clone().map(|corners| {
            let z = judge.field.vertices(corners);
            judge.hair(z, PlaneFacet::new(corners, z).gx)
        });
        let hair = hairs.fold(0.0, f64::max);
        // The errors listed are rounded to f32: only those near the tolerance need an exact scan.
        let is_clear = f64::from(largest) + hair < judge.tolerance;
        if !is_clear && triangles.any(|corners| judge.candidate(corners, 0).is_some()) {
            return false;
        }
        let Some(crossings) = judge.crossings else { return true };
        self.star.iter().all(|&at| crossings.worst(mesh.origin(at), mesh.end(at)).is_none())
    }
}

#[cfg(test)]
mod tests;
