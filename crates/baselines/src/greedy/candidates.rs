//! Version 4: a heap with one candidate by triangle, its worst sample. Source: algorithm III of Garland &
//! Heckbert 1995; with the data-dependent triangulation their algorithm IV. Time O((m + n) log m) expected
//! for m vertices of n samples. Memory: a few words a triangle.

use std::collections::BinaryHeap;

use super::{CandidateSearch, method};
use crate::candidate::RefinementCandidate;
use crate::grid::PackedSample;
use crate::mesh::BaselineMesh;
use crate::method::BaselineMethod;
use crate::settings::BaselineTask;

pub(crate) const GREEDY_4: BaselineMethod = BaselineMethod {
    name: "greedy4",
    about: "greedy insertion with a heap of one candidate per triangle",
    time: "O((m + n) log m), expected",
    memory: "the grid, the mesh, and a heap of triangles",
    sample_bytes: 220,
    ..method::<CandidateHeap>()
};

/// The worst sample of each triangle. Outdated entries are detected by the triangle's stamp and discarded when they
/// come up.
#[derive(Default)]
pub(crate) struct CandidateHeap {
    heap: BinaryHeap<(RefinementCandidate, u32, u32)>,
    stamps: Vec<u32>,
}

impl CandidateHeap {
    /// Looks at triangles that are new, of which `worst` finds the worst samples.
    pub(crate) fn scan(
        &mut self,
        mesh: &BaselineMesh,
        fresh: &[u32],
        worst: impl Fn([PackedSample; 3]) -> Option<RefinementCandidate>,
    ) {
        self.stamps.resize(mesh.tris.len(), 0);
        for &t in fresh {
            self.stamps[t as usize] += 1;
            let worst = worst(mesh.tris[t as usize].corners);
            self.heap.extend(worst.map(|worst| (worst, t, self.stamps[t as usize])));
        }
    }

    /// Takes the greatest candidate of all, and the triangle that holds it.
    pub(crate) fn take(&mut self) -> Option<(RefinementCandidate, u32)> {
        loop {
            let (worst, t, stamp) = self.heap.pop()?;
            if self.stamps[t as usize] == stamp {
                return Some((worst, t));
            }
        }
    }
}

impl CandidateSearch for CandidateHeap {
    fn new(task: &BaselineTask<'_>, mesh: &BaselineMesh) -> Self {
        let mut search = Self::default();
        search.update(task, mesh, &mesh.surface().collect::<Vec<_>>());
        search
    }

    fn update(&mut self, task: &BaselineTask<'_>, mesh: &BaselineMesh, fresh: &[u32]) {
        self.scan(mesh, fresh, |corners| RefinementCandidate::worst(task, corners));
    }

    fn worst(
        &mut self,
        _: &BaselineTask<'_>,
        _: &BaselineMesh,
    ) -> Option<(RefinementCandidate, u32)> {
        self.take()
    }
}
