//! Version 1: every sample is located and measured again for every vertex. Source: algorithm I of Garland &
//! Heckbert 1995. Time O(m n) and more for m vertices of n samples (the paper has O(m^2 n) where a walk takes
//! O(m) steps; from its neighbour, a sample is a few steps away). Memory: the mesh.

use super::{Search, method};
use crate::candidate::Candidate;
use crate::mesh::{Mesh, State};
use crate::method::Method;
use crate::plane::Plane;
use crate::task::Task;

pub(crate) const GREEDY_1: Method = Method {
    name: "greedy1",
    about: "greedy insertion, all samples located and measured anew for each vertex",
    time: "O(m n), walks aside",
    memory: "the grid and the mesh",
    sample_bytes: 180,
    ..method::<AllPoints>()
};

/// Nothing is remembered.
pub(super) struct AllPoints;

impl Search for AllPoints {
    fn new(_: &Task<'_>, _: &Mesh) -> Self {
        Self
    }

    fn update(&mut self, _: &Task<'_>, _: &Mesh, _: &[u32]) {}

    fn worst(&mut self, task: &Task<'_>, mesh: &Mesh) -> Option<(Candidate, u32)> {
        let (mut t, mut worst) = (0, None);
        for at in task.grid.samples() {
            t = mesh.locate(at, t);
            let tri = &mesh.tris[t as usize];
            if tri.state == State::Outside {
                continue;
            }
            let offset = Plane::new(&task.grid, tri.corners).offset(at);
            worst = worst.max(Candidate::of(task, at, &offset).map(|candidate| (candidate, t)));
        }
        worst
    }
}
