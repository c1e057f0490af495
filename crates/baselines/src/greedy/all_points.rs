//! Version 1: all samples are located and measured again for each vertex. Source: algorithm I of Garland &
//! Heckbert 1995. Time O(m n) and more for m vertices of n samples (the paper has O(m^2 n) where a walk takes
//! O(m) steps; from its neighbour, a sample is a few steps away). Memory: the mesh.

use super::{CandidateSearch, method};
use crate::candidate::RefinementCandidate;
use crate::mesh::{BaselineMesh, TriangleState};
use crate::method::BaselineMethod;
use crate::plane::TrianglePlane;
use crate::settings::BaselineTask;

pub(crate) const GREEDY_1: BaselineMethod = BaselineMethod {
    name: "greedy1",
    about: "greedy insertion, all samples located and measured again for each vertex",
    time: "O(m n), walks aside",
    memory: "the grid and the mesh",
    sample_bytes: 180,
    ..method::<AllPoints>()
};

/// Search without a cache.
pub(super) struct AllPoints;

impl CandidateSearch for AllPoints {
    fn new(_: &BaselineTask<'_>, _: &BaselineMesh) -> Self {
        Self
    }

    fn update(&mut self, _: &BaselineTask<'_>, _: &BaselineMesh, _: &[u32]) {}

    fn worst(
        &mut self,
        task: &BaselineTask<'_>,
        mesh: &BaselineMesh,
    ) -> Option<(RefinementCandidate, u32)> {
        let (mut t, mut worst) = (0, None);
        for at in task.grid.samples() {
            t = mesh.locate(at, t);
            let tri = &mesh.tris[t as usize];
            if tri.state == TriangleState::Outside {
                continue;
            }
            let offset = TrianglePlane::new(&task.grid, tri.corners).offset(at);
            worst = worst
                .max(RefinementCandidate::of(task, at, &offset).map(|candidate| (candidate, t)));
        }
        worst
    }
}
