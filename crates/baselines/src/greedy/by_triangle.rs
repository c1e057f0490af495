//! Version 2: every triangle has a list of its samples, and only those of new triangles are measured; all
//! errors are looked through for the largest. Source: algorithm II of Garland & Heckbert 1995. Time O(m n)
//! for m vertices of n samples: what remains of it is the search. Memory: a number and an error a sample.

use super::{Search, method};
use crate::candidate::Candidate;
use crate::grid::Sample;
use crate::mesh::{Mesh, State};
use crate::method::Method;
use crate::plane::Plane;
use crate::task::Task;
use terrane_base::geom::predicates::orient;

pub(crate) const GREEDY_2: Method = Method {
    name: "greedy2",
    about: "greedy insertion, only the samples of changed triangles measured anew",
    time: "O(m n), expected",
    memory: "the grid, the mesh, and lists of samples by triangle",
    sample_bytes: 500,
    ..method::<ByTriangle>()
};

/// Samples by triangle; one on an edge is listed once, on either side.
pub(super) struct ByTriangle {
    lists: Vec<Vec<Listed>>,
}

/// A sample, and whether it is a candidate.
type Listed = (Sample, Option<Candidate>);

impl Search for ByTriangle {
    fn new(task: &Task<'_>, mesh: &Mesh) -> Self {
        let mut lists = vec![Vec::new(); mesh.tris.len()];
        let mut t = 0;
        for at in task.grid.samples() {
            t = mesh.locate(at, t);
            if mesh.tris[t as usize].state != State::Outside {
                lists[t as usize].push(measured(task, mesh, t, at));
            }
        }
        Self { lists }
    }

    fn update(&mut self, task: &Task<'_>, mesh: &Mesh, fresh: &[u32]) {
        self.lists.resize(mesh.tris.len(), Vec::new());
        let listed: Vec<Listed> =
            fresh.iter().flat_map(|&t| std::mem::take(&mut self.lists[t as usize])).collect();
        for (at, _) in listed {
            if let Some(&t) = fresh.iter().find(|&&t| holds(mesh, t, at)) {
                self.lists[t as usize].push(measured(task, mesh, t, at));
            }
        }
    }

    fn worst(&mut self, _: &Task<'_>, _: &Mesh) -> Option<(Candidate, u32)> {
        let lists = self.lists.iter().enumerate();
        let worst = |list: &[Listed]| list.iter().filter_map(|(_, candidate)| *candidate).max();
        lists.filter_map(|(t, list)| Some((worst(list)?, t as u32))).max()
    }
}

fn measured(task: &Task<'_>, mesh: &Mesh, t: u32, at: Sample) -> Listed {
    let offset = Plane::new(&task.grid, mesh.tris[t as usize].corners).offset(at);
    (at, Candidate::of(task, at, &offset))
}

fn holds(mesh: &Mesh, t: u32, at: Sample) -> bool {
    let [a, b, c] = mesh.tris[t as usize].corners.map(Sample::lattice);
    let q = at.lattice();
    orient(a, b, q) >= 0 && orient(b, c, q) >= 0 && orient(c, a, q) >= 0
}
