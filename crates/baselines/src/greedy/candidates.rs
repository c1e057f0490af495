//! Version 4: a heap with one candidate per triangle, its worst sample. Source: algorithm III of Garland &
//! Heckbert 1995; with the data-dependent triangulation their algorithm IV. Time O((m + n) log m) expected
//! for m vertices of n samples. Memory: a few words per triangle.

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
    heap: BinaryHeap<QueuedTriangle>,
    stamps: Vec<u32>,
}

/// A triangle in the heap, ordered by its worst sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct QueuedTriangle {
    worst: RefinementCandidate,
    triangle: u32,
    stamp: u32,
}

impl CandidateHeap {
    /// Adds new triangles; `worst` finds the worst sample of each.
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
            let stamp = self.stamps[t as usize];
            self.heap.extend(worst.map(|worst| QueuedTriangle { worst, triangle: t, stamp }));
        }
    }

    /// Removes and returns the greatest candidate, and the triangle that contains it.
    pub(crate) fn take(&mut self) -> Option<(RefinementCandidate, u32)> {
        loop {
            let QueuedTriangle { worst, triangle, stamp } = self.heap.pop()?;
            if self.stamps[triangle as usize] == stamp {
                return Some((worst, triangle));
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
