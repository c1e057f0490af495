//! Target and limits of a method.

use crate::grid::{HeightGrid, PackedSample};
use crate::mesh::{BaselineMesh, TriangleState};
use crate::plane::PlaneOffset;
use crate::star::VertexStar;
use crate::triangulation::TriangulationRule;
use terrane_base::error::{Error, Result};

/// Target of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BaselineGoal {
    /// Maximum vertical error at valid samples.
    MaxError(f64),
    /// Maximum number of vertices.
    MaxVertices(u64),
    /// Maximum number of triangles.
    MaxTriangles(u64),
}

/// A mesh to make.
#[derive(Clone, Copy)]
pub struct BaselineTask<'a> {
    /// Input heights.
    pub grid: HeightGrid<'a>,
    /// Target.
    pub goal: BaselineGoal,
    /// Connectivity of vertices, for methods with a choice.
    pub triangulation: TriangulationRule,
    /// Called at intervals; an error ends the work.
    pub pulse: &'a dyn Fn() -> Result<()>,
}

impl<'a> BaselineTask<'a> {
    /// A task that cannot be interrupted, with a Delaunay triangulation.
    pub fn new(grid: HeightGrid<'a>, goal: BaselineGoal) -> Self {
        Self { grid, goal, triangulation: TriangulationRule::Delaunay, pulse: &|| Ok(()) }
    }

    /// The maximum error; 0 for a target number of vertices or triangles.
    pub(crate) fn tolerance(&self) -> f64 {
        match self.goal {
            BaselineGoal::MaxError(tolerance) => tolerance,
            BaselineGoal::MaxVertices(_) | BaselineGoal::MaxTriangles(_) => 0.0,
        }
    }

    /// True for a sample that should become a vertex.
    pub(crate) fn exceeds(&self, offset: &PlaneOffset) -> bool {
        !offset.is_corner() && !offset.is_within(self.tolerance())
    }

    /// True for a sample whose error forbids the removal of vertices, which is possible for a maximum error only.
    pub(crate) fn forbids(&self, offset: &PlaneOffset) -> bool {
        matches!(self.goal, BaselineGoal::MaxError(_)) && self.exceeds(offset)
    }
}

/// Numbers of vertices and triangles of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceSize {
    pub(crate) vertices: u64,
    pub(crate) triangles: u64,
}

impl SurfaceSize {
    /// Size of the initial mesh of a method.
    ///
    /// # Errors
    /// Usage: the mesh is larger than the target.
    pub(crate) fn of(mesh: &BaselineMesh, goal: BaselineGoal) -> Result<Self> {
        let size = Self::counted(mesh);
        size.check(goal)?;
        Ok(size)
    }

    pub(crate) fn counted(mesh: &BaselineMesh) -> Self {
        let corners = mesh.surface().flat_map(|id| mesh.tris[id as usize].corners);
        let mut vertices: Vec<PackedSample> = corners.collect();
        vertices.sort_unstable();
        vertices.dedup();
        Self { vertices: vertices.len() as u64, triangles: mesh.surface().count() as u64 }
    }

    /// Fails if the coarsest mesh is larger than the target.
    ///
    /// # Errors
    /// Usage.
    pub(crate) fn check(self, goal: BaselineGoal) -> Result<()> {
        let (min, max, what) = match goal {
            BaselineGoal::MaxError(_) => return Ok(()),
            BaselineGoal::MaxVertices(max) => (self.vertices, max, "vertices"),
            BaselineGoal::MaxTriangles(max) => (self.triangles, max, "triangles"),
        };
        if min <= max {
            return Ok(());
        }
        let message = format!(
            "the coarsest mesh of this grid has {min} {what}, more than the limit of {max}"
        );
        Err(Error::usage(message).remedy(format!("allow {min} {what} or more")))
    }

    /// True if a target number of vertices or triangles is reached.
    pub(crate) fn meets(self, goal: BaselineGoal) -> bool {
        match goal {
            BaselineGoal::MaxError(_) => false,
            BaselineGoal::MaxVertices(max) => self.vertices <= max,
            BaselineGoal::MaxTriangles(max) => self.triangles <= max,
        }
    }

    /// Counts the removal of a vertex whose star is replaced by `filling`.
    pub(crate) fn shrink(&mut self, star: &VertexStar, filling: &[[PackedSample; 3]]) {
        self.vertices -= 1;
        self.triangles -= (star.triangles.len() - filling.len()) as u64;
    }

    /// Inserts `at`, which is in triangle `t`, unless the target is reached; returns the new triangles.
    pub(crate) fn insert(
        &mut self,
        task: &BaselineTask<'_>,
        mesh: &mut BaselineMesh,
        t: u32,
        at: PackedSample,
    ) -> Option<Vec<u32>> {
        debug_assert_eq!(mesh.tris[t as usize].state, TriangleState::Surface);
        let grown = mesh.growth(t, at);
        let is_full = match task.goal {
            BaselineGoal::MaxError(_) => false,
            BaselineGoal::MaxVertices(max) => self.vertices == max,
            BaselineGoal::MaxTriangles(max) => self.triangles + grown > max,
        };
        if is_full {
            return None;
        }
        (self.vertices, self.triangles) = (self.vertices + 1, self.triangles + grown);
        Some(mesh.insert(&task.grid, task.triangulation, t, at))
    }
}
