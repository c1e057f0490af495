//! Version 3: a heap of all samples; those of new triangles are moved in it. Source: the heap of points that
//! Garland & Heckbert 1995 compare with candidates by triangle (section 4.3); as in Franklin 1973 and Heller
//! 1990. Time O((m + n) log m log n) expected for m vertices of n samples. Memory: twenty
//! bytes per sample.

use super::{CandidateSearch, method};
use crate::candidate::RefinementCandidate;
use crate::grid::PackedSample;
use crate::mesh::BaselineMesh;
use crate::method::BaselineMethod;
use crate::plane::TrianglePlane;
use crate::settings::BaselineTask;

pub(crate) const GREEDY_3: BaselineMethod = BaselineMethod {
    name: "greedy3",
    about: "greedy insertion with a heap of all samples",
    time: "O((m + n) log m log n), expected",
    memory: "the grid, the mesh, and a heap of all samples",
    sample_bytes: 200,
    ..method::<PointHeap>()
};

/// A binary heap of all samples, the greatest on top, with the place of each sample.
pub(super) struct PointHeap {
    heap: Vec<PackedSample>,
    /// By sample: its place in the heap, its error (0 within the tolerance), and its triangle.
    places: Vec<u32>,
    errors: Vec<f64>,
    triangles: Vec<u32>,
    width: usize,
}

impl CandidateSearch for PointHeap {
    fn new(task: &BaselineTask<'_>, mesh: &BaselineMesh) -> Self {
        let count = task.grid.len();
        let mut heap = Self {
            heap: task.grid.samples().collect(),
            places: (0..count as u32).collect(),
            errors: vec![0.0; count],
            triangles: vec![0; count],
            width: task.grid.width() as usize,
        };
        heap.update(task, mesh, &mesh.surface().collect::<Vec<_>>());
        heap
    }

    fn update(&mut self, task: &BaselineTask<'_>, mesh: &BaselineMesh, fresh: &[u32]) {
        for &t in fresh {
            let plane = TrianglePlane::new(&task.grid, mesh.tris[t as usize].corners);
            for (at, offset) in plane.offsets() {
                let index = self.index(at);
                self.triangles[index] = t;
                let error = RefinementCandidate::of(task, at, &offset)
                    .map_or(0.0, |candidate| candidate.error);
                self.change(index, error);
            }
        }
    }

    fn worst(
        &mut self,
        _: &BaselineTask<'_>,
        _: &BaselineMesh,
    ) -> Option<(RefinementCandidate, u32)> {
        let worst = self.candidate(0);
        let t = self.triangles[self.index(worst.at)];
        (worst.error > 0.0).then_some((worst, t))
    }
}

impl PointHeap {
    fn index(&self, at: PackedSample) -> usize {
        at.row() as usize * self.width + at.col() as usize
    }

    /// The entry at this index of the heap.
    fn candidate(&self, place: usize) -> RefinementCandidate {
        let at = self.heap[place];
        RefinementCandidate { error: self.errors[self.index(at)], at }
    }

    fn change(&mut self, index: usize, error: f64) {
        self.errors[index] = error;
        let place = self.rise(self.places[index] as usize);
        self.sink(place);
    }

    fn rise(&mut self, mut place: usize) -> usize {
        while place > 0 && self.candidate(place) > self.candidate((place - 1) / 2) {
            self.swap(place, (place - 1) / 2);
            place = (place - 1) / 2;
        }
        place
    }

    fn sink(&mut self, mut place: usize) {
        loop {
            let below = (2 * place + 1..2 * place + 3).filter(|&child| child < self.heap.len());
            match below.max_by_key(|&child| self.candidate(child)) {
                Some(child) if self.candidate(child) > self.candidate(place) => {
                    self.swap(place, child);
                    place = child;
                }
                _ => return,
            }
        }
    }

    fn swap(&mut self, a: usize, b: usize) {
        self.heap.swap(a, b);
        for place in [a, b] {
            let index = self.index(self.heap[place]);
            self.places[index] = place as u32;
        }
    }
}
