//! Version 4: a heap with one candidate by triangle, its worst sample. Source: algorithm III of Garland &
//! Heckbert 1995; with the data-dependent triangulation their algorithm IV. Time O((m + n) log m) expected
//! for m vertices of n samples. Memory: a few words a triangle.

use std::collections::BinaryHeap;

use super::{Search, method};
use crate::candidate::Candidate;
use crate::grid::Sample;
use crate::mesh::Mesh;
use crate::method::Method;
use crate::task::Task;

pub(crate) const GREEDY_4: Method = Method {
    name: "greedy4",
    about: "greedy insertion, with a heap of one candidate by triangle",
    time: "O((m + n) log m), expected",
    memory: "the grid, the mesh, and a heap of triangles",
    sample_bytes: 220,
    ..method::<Candidates>()
};

/// The worst sample of each triangle. What has changed since is told by the triangle's stamp and thrown
/// away when it comes up.
#[derive(Default)]
pub(crate) struct Candidates {
    heap: BinaryHeap<(Candidate, u32, u32)>,
    stamps: Vec<u32>,
}

impl Candidates {
    /// Looks at triangles that are new, of which `worst` finds the worst samples.
    pub(crate) fn look(
        &mut self,
        mesh: &Mesh,
        fresh: &[u32],
        worst: impl Fn([Sample; 3]) -> Option<Candidate>,
    ) {
        self.stamps.resize(mesh.tris.len(), 0);
        for &t in fresh {
            self.stamps[t as usize] += 1;
            let worst = worst(mesh.tris[t as usize].corners);
            self.heap.extend(worst.map(|worst| (worst, t, self.stamps[t as usize])));
        }
    }

    /// Takes the greatest candidate of all, and the triangle that holds it.
    pub(crate) fn take(&mut self) -> Option<(Candidate, u32)> {
        loop {
            let (worst, t, stamp) = self.heap.pop()?;
            if self.stamps[t as usize] == stamp {
                return Some((worst, t));
            }
        }
    }
}

impl Search for Candidates {
    fn new(task: &Task<'_>, mesh: &Mesh) -> Self {
        let mut search = Self::default();
        search.update(task, mesh, &mesh.surface().collect::<Vec<_>>());
        search
    }

    fn update(&mut self, task: &Task<'_>, mesh: &Mesh, fresh: &[u32]) {
        self.look(mesh, fresh, |corners| Candidate::worst(task, corners));
    }

    fn worst(&mut self, _: &Task<'_>, _: &Mesh) -> Option<(Candidate, u32)> {
        self.take()
    }
}
