//! Error bound between samples: where an edge crosses the line between two samples beyond the tolerance, one of the two
//! becomes a vertex.
//!
//! Each round takes all crossings beyond the tolerance, the worst first, and inserts the nearer of their samples (the
//! other one if the nearer is a vertex or cannot be inserted). Crossings near an insertion wait for the next round.
//! Then samples are brought within the tolerance again. The rounds terminate, because a line whose two samples are
//! vertices is an edge, which nothing crosses.
//!
//! Errors at a rim are left to the seam patches: the required sample lies on the rim, so the edge ends on the rim, and
//! both triangles beside it are within reach of a patch.

use super::crossing::{CrossingJudge, EdgeCrossing};
use super::lattice_position::TilePosition;
use super::mesh::{LatticeMesh, LatticeTriangle, NONE, TriangleScanState};

/// An edge beyond the tolerance between samples.
#[derive(Clone, Copy, Debug)]
struct OverlongEdge {
    half_edge: u32,
    crossing: EdgeCrossing,
}

/// Work lists, reused between tiles.
#[derive(Debug, Default)]
pub(super) struct BetweenBuffers {
    over: Vec<OverlongEdge>,
    fresh: Vec<u32>,
    star: Vec<u32>,
}

/// Inserts samples until no mendable edge inside the mesh is beyond the tolerance. `fit` brings the samples of dirty
/// triangles within the tolerance. Takes about ten rounds, each linear in the length of new edges.
pub(super) fn insert(
    crossings: &CrossingJudge<'_>,
    mesh: &mut LatticeMesh,
    rounds: &mut BetweenBuffers,
    mut fit: impl FnMut(&mut LatticeMesh),
) {
    loop {
        rounds.scan(crossings, mesh);
        let mut is_done = true;
        for i in 0..rounds.over.len() {
            if crossings.is_stopped_in(i) {
                return;
            }
            is_done &= !rounds.mend(mesh, rounds.over[i]);
        }
        if is_done || crossings.is_stopped() {
            return;
        }
        fit(mesh);
    }
}

impl BetweenBuffers {
    /// Finds new edges beyond the tolerance, the worst first.
    fn scan(&mut self, crossings: &CrossingJudge<'_>, mesh: &mut LatticeMesh) {
        self.over.clear();
        self.fresh.clear();
        self.fresh.extend(mesh.ids().filter(|&id| is_fresh(&mesh.tris[id as usize])));
        let edges = self.fresh.iter().flat_map(|id| 4 * id..4 * id + 3);
        for (round, half_edge) in edges.enumerate() {
            if crossings.is_stopped_in(round) {
                break;
            }
            let twin = mesh.twin(half_edge);
            if twin != NONE && (!is_fresh(&mesh.tris[(twin >> 2) as usize]) || twin < half_edge) {
                continue;
            }
            if let Some(crossing) = crossings.worst(mesh.origin(half_edge), mesh.end(half_edge)) {
                self.over.push(OverlongEdge { half_edge, crossing });
            }
        }
        self.fresh.iter().for_each(|&id| mesh.tris[id as usize].state = TriangleScanState::Kept);
        for half_edge in self.over.iter().map(|over| over.half_edge) {
            let sides = [half_edge, mesh.twin(half_edge)];
            for side in sides.into_iter().filter(|&side| side != NONE) {
                mesh.tris[(side >> 2) as usize].state = TriangleScanState::Passed(0);
            }
        }
        self.over.sort_unstable_by(|a, b| {
            let by_error = b.crossing.error.total_cmp(&a.crossing.error);
            by_error.then(a.half_edge.cmp(&b.half_edge))
        });
    }

    /// Samples beside edges that are still beyond the tolerance.
    pub(super) fn left(
        &mut self,
        crossings: &CrossingJudge<'_>,
        mesh: &mut LatticeMesh,
    ) -> Vec<TilePosition> {
        self.scan(crossings, mesh);
        self.over.iter().flat_map(|over| over.crossing.samples).collect()
    }

    /// Inserts one of the two samples; false if it is not possible, or has to wait.
    fn mend(&mut self, mesh: &mut LatticeMesh, over: OverlongEdge) -> bool {
        let twin = mesh.twin(over.half_edge);
        if twin == NONE || is_dirty(mesh, over.half_edge >> 2) || is_dirty(mesh, twin >> 2) {
            return false;
        }
        let [near, far] = over.crossing.samples;
        for [from, to] in [[far, near], [near, far]] {
            let Some(holder) = mesh.follow(over.half_edge, from, to) else { continue };
            if is_dirty(mesh, holder) {
                return false;
            }
            self.star.clear();
            if mesh.insert(holder, to, &mut self.star) {
                return true;
            }
        }
        false
    }
}

/// True if a triangle is new and not yet scanned.
fn is_dirty(mesh: &LatticeMesh, id: u32) -> bool {
    mesh.tris[id as usize].state == TriangleScanState::Dirty
}

/// True if the edges of a triangle are still to be tested.
fn is_fresh(tri: &LatticeTriangle) -> bool {
    matches!(tri.state, TriangleScanState::Passed(_))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heights::HeightField;
    use crate::heights::HeightWindow;

    /// The sample (1, 1) is beside the diagonal of a rectangle of four by three cells.
    #[test]
    fn an_edge_waits_when_a_triangle_beside_it_has_changed() {
        let (kept, dirty) = (TriangleScanState::Kept, TriangleScanState::Dirty);
        for (half_edge, states, expected) in [
            (2, [kept, kept], true),
            (4, [kept, kept], true),
            (2, [dirty, kept], false),
            (2, [kept, dirty], false),
            (2, [dirty, dirty], false),
            // Nothing lies beyond the sides.
            (0, [kept, kept], false),
            (5, [kept, kept], false),
        ] {
            let mut mesh = LatticeMesh::default();
            mesh.reset_to_rectangle(4, 3);
            for (tri, state) in mesh.tris.iter_mut().zip(states) {
                tri.state = state;
            }
            let samples = [1, 0].map(|row| TilePosition::new(1, row));
            let over = OverlongEdge { half_edge, crossing: EdgeCrossing { error: 1.0, samples } };
            let is_mended = BetweenBuffers::default().mend(&mut mesh, over);
            assert_eq!(is_mended, expected, "{half_edge} {states:?}");
            let is_vertex = mesh.tris.iter().any(|tri| tri.corners.contains(&samples[0]));
            assert_eq!(is_vertex, expected, "{half_edge} {states:?}");
        }
    }

    /// Row 1 is far above the diagonal of a rectangle, which was looked at with either triangle beside it.
    #[test]
    fn an_edge_is_looked_at_once_when_both_triangles_beside_it_are_fresh() {
        let z = [[0.0_f32; 5], [9.0; 5], [0.0; 5], [0.0; 5]].concat();
        let heights = HeightWindow { width: 5, height: 4, f32: &z, f64: None };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, 5, 4], [0; 4], None);
        let crossings = CrossingJudge::new(&field, 1.0);
        let (kept, fresh) = (TriangleScanState::Kept, TriangleScanState::Passed(0));
        for (states, expected) in [
            ([fresh, fresh], vec![2]),
            ([fresh, kept], vec![]),
            ([kept, fresh], vec![]),
            ([kept, kept], vec![]),
        ] {
            let mut mesh = LatticeMesh::default();
            mesh.reset_to_rectangle(4, 3);
            for (tri, state) in mesh.tris.iter_mut().zip(states) {
                tri.state = state;
            }
            let mut rounds = BetweenBuffers::default();
            rounds.scan(&crossings, &mut mesh);
            let found: Vec<u32> = rounds.over.iter().map(|over| over.half_edge).collect();
            assert_eq!(found, expected, "{states:?}");
            // What is too far off is looked at again.
            let again = if expected.is_empty() { [kept; 2] } else { [fresh; 2] };
            assert_eq!([0, 1].map(|id| mesh.tris[id].state), again, "{states:?}");
        }
    }
}
