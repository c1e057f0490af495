//! Greedy insertion: the sample farthest from the surface becomes a vertex, until all samples are within the
//! tolerance. Four versions of the search, each faster than the one before, with the same result.
//!
//! Source: Garland & Heckbert, "Fast Polygonal Approximation of Terrains and Height Fields",
//! CMU-CS-95-181 (1995). Their algorithms I, II and III are the versions 1, 2 and 4 here, and IV is version 4
//! with the data-dependent triangulation. Before them: Fowler & Little 1979, De Floriani et al. 1985.
//!
//! Ties: the sample with the largest error goes first, and for equal errors the lowest (row, column).
//! Errors are those of [`crate::plane`], which depend on the triangle only.

mod all_points;
mod by_triangle;
mod candidates;
mod point_heap;

pub(crate) use all_points::GREEDY_1;
pub(crate) use by_triangle::GREEDY_2;
pub(crate) use candidates::{CandidateHeap, GREEDY_4};
pub(crate) use point_heap::GREEDY_3;

use crate::candidate::RefinementCandidate;
use crate::grid::PackedSample;
use crate::mesh::BaselineMesh;
use crate::method::{BaselineMethod, MethodPromise};
use crate::result::BaselineTin;
use crate::settings::{BaselineTask, SurfaceSize};
use terrane_base::error::Result;

/// A way to find the worst candidate.
trait CandidateSearch {
    /// Starts with a mesh.
    fn new(task: &BaselineTask<'_>, mesh: &BaselineMesh) -> Self;

    /// Adds new triangles, whose numbers may be reused from removed ones.
    fn update(&mut self, task: &BaselineTask<'_>, mesh: &BaselineMesh, fresh: &[u32]);

    /// The greatest candidate, and a triangle that contains it.
    fn worst(
        &mut self,
        task: &BaselineTask<'_>,
        mesh: &BaselineMesh,
    ) -> Option<(RefinementCandidate, u32)>;
}

/// Inserts vertices until the goal is reached.
fn run<S: CandidateSearch>(task: &BaselineTask<'_>) -> Result<BaselineTin> {
    let mut mesh = BaselineMesh::of_outline(&task.grid)?;
    insert::<S>(task, &mut mesh, |_| ())?;
    Ok(BaselineTin::of_mesh(&task.grid, &mesh))
}

/// The same with a given mesh; calls `note` for each vertex in order.
fn insert<S: CandidateSearch>(
    task: &BaselineTask<'_>,
    mesh: &mut BaselineMesh,
    mut note: impl FnMut(PackedSample),
) -> Result<()> {
    let mut size = SurfaceSize::of(mesh, task.goal)?;
    let mut search = S::new(task, mesh);
    while let Some((worst, t)) = search.worst(task, mesh) {
        (task.pulse)()?;
        let Some(fresh) = size.insert(task, mesh, t, worst.at) else { break };
        note(worst.at);
        search.update(task, mesh, &fresh);
    }
    Ok(())
}

/// State shared by the versions.
const fn method<S: CandidateSearch>() -> BaselineMethod {
    BaselineMethod {
        name: "",
        about: "",
        source: "Garland & Heckbert 1995",
        time: "",
        memory: "",
        promise: MethodPromise::Samples,
        takes_triangulation: true,
        is_delaunay: true,
        takes_budget: true,
        sample_bytes: 0,
        run: run::<S>,
    }
}

#[cfg(test)]
mod tests;
