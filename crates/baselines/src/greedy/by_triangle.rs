//! Version 2: each triangle has a list of its samples, and only those of new triangles are measured; the largest
//! error is found by a scan of all. Source: algorithm II of Garland & Heckbert 1995. Time O(m n)
//! for m vertices of n samples, for the scans. Memory: an index and an error per sample.

use super::{CandidateSearch, method};
use crate::candidate::RefinementCandidate;
use crate::grid::PackedSample;
use crate::mesh::{BaselineMesh, TriangleState};
use crate::method::BaselineMethod;
use crate::plane::TrianglePlane;
use crate::settings::BaselineTask;
use terrane_base::geom::predicates::orient;

pub(crate) const GREEDY_2: BaselineMethod = BaselineMethod {
    name: "greedy2",
    about: "greedy insertion, only samples of changed triangles measured again",
    time: "O(m n), expected",
    memory: "the grid, the mesh, and lists of samples by triangle",
    sample_bytes: 500,
    ..method::<ByTriangle>()
};

/// Samples by triangle; a sample on an edge is listed once, on either side.
pub(super) struct ByTriangle {
    lists: Vec<Vec<Listed>>,
}

/// A sample, and its candidate if it is beyond the tolerance.
type Listed = (PackedSample, Option<RefinementCandidate>);

impl CandidateSearch for ByTriangle {
    fn new(task: &BaselineTask<'_>, mesh: &BaselineMesh) -> Self {
        let mut lists = vec![Vec::new(); mesh.tris.len()];
        let mut t = 0;
        for at in task.grid.samples() {
            t = mesh.locate(at, t);
            if mesh.tris[t as usize].state != TriangleState::Outside {
                lists[t as usize].push(measured(task, mesh, t, at));
            }
        }
        Self { lists }
    }

    fn update(&mut self, task: &BaselineTask<'_>, mesh: &BaselineMesh, fresh: &[u32]) {
        self.lists.resize(mesh.tris.len(), Vec::new());
        let listed: Vec<Listed> =
            fresh.iter().flat_map(|&t| std::mem::take(&mut self.lists[t as usize])).collect();
        for (at, _) in listed {
            if let Some(&t) = fresh.iter().find(|&&t| holds(mesh, t, at)) {
                self.lists[t as usize].push(measured(task, mesh, t, at));
            }
        }
    }

    fn worst(
        &mut self,
        _: &BaselineTask<'_>,
        _: &BaselineMesh,
    ) -> Option<(RefinementCandidate, u32)> {
        let worst = self.lists.iter().zip(0..).filter_map(|(list, t)| {
            let candidates = list.iter().filter_map(|(_, candidate)| *candidate);
            Some((candidates.max()?, t))
        });
        worst.max()
    }
}

fn measured(task: &BaselineTask<'_>, mesh: &BaselineMesh, t: u32, at: PackedSample) -> Listed {
    let offset = TrianglePlane::new(&task.grid, mesh.tris[t as usize].corners).offset(at);
    (at, RefinementCandidate::of(task, at, &offset))
}

fn holds(mesh: &BaselineMesh, t: u32, at: PackedSample) -> bool {
    let [a, b, c] = mesh.tris[t as usize].corners.map(PackedSample::lattice);
    let q = at.lattice();
    orient(a, b, q) >= 0 && orient(b, c, q) >= 0 && orient(c, a, q) >= 0
}
