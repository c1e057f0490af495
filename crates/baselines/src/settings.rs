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
    /// No valid sample further than this from the surface, vertically; equal is allowed.
    MaxError(f64),
    /// Maximum number of vertices.
    MaxVertices(u64),
    /// Maximum number of triangles.
    MaxTriangles(u64),
}

/// A mesh to make.
#[derive(Clone, Copy)]
pub struct BaselineTask<'a> {
    /// Of what.
    pub grid: HeightGrid<'a>,
    /// How good.
    pub goal: BaselineGoal,
    /// How vertices are connected, by methods that leave it open.
    pub triangulation: TriangulationRule,
    /// Called now and then; where it fails, the work ends with its error.
    pub pulse: &'a dyn Fn() -> Result<()>,
}

impl<'a> BaselineTask<'a> {
    /// A task that nothing interrupts, with a Delaunay triangulation.
    pub fn new(grid: HeightGrid<'a>, goal: BaselineGoal) -> Self {
        Self { grid, goal, triangulation: TriangulationRule::Delaunay, pulse: &|| Ok(()) }
    }

    /// The largest error allowed: of a number of vertices any error is asked to go.
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

    /// True for a sample whose error forbids that vertices go: of a number of vertices there is none.
    pub(crate) fn forbids(&self, offset: &PlaneOffset) -> bool {
        matches!(self.goal, BaselineGoal::MaxError(_)) && self.exceeds(offset)
    }
}

/// Vertices and triangles of a surface that grows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceSize {
    pub(crate) vertices: u64,
    pub(crate) triangles: u64,
}

impl SurfaceSize {
    /// Of the mesh a method begins with.
    ///
    /// # Errors
    /// Usage: it is larger than the goal allows.
    pub(crate) fn of(mesh: &BaselineMesh, goal: BaselineGoal) -> Result<Self> {
        let size = Self::counted(mesh);
        size.check(goal)?;
        Ok(size)
    }

    pub(crate) fn counted(mesh: &BaselineMesh) -> Self {
        let corners = |id: u32| mesh.tris[id as usize].corners;
        let mut vertices: Vec<PackedSample> = mesh.surface().flat_map(corners).collect();
        vertices.sort_unstable();
        vertices.dedup();
        Self { vertices: vertices.len() as u64, triangles: mesh.surface().count() as u64 }
    }

    /// Fails when a mesh that cannot be coarser is larger than the goal allows.
    ///
    /// # Errors
    /// Usage.
    pub(crate) fn check(self, goal: BaselineGoal) -> Result<()> {
        let (least, most, what) = match goal {
            BaselineGoal::MaxError(_) => return Ok(()),
            BaselineGoal::MaxVertices(most) => (self.vertices, most, "vertices"),
            BaselineGoal::MaxTriangles(most) => (self.triangles, most, "triangles"),
        };
        if least <= most {
            return Ok(());
        }
        Err(Error::usage(format!("the coarsest mesh of this grid has {least} {what}, not {most}"))
            .remedy(format!("allow {least} {what} or more")))
    }

    /// True when a goal in vertices or triangles is reached.
    pub(crate) fn meets(self, goal: BaselineGoal) -> bool {
        match goal {
            BaselineGoal::MaxError(_) => false,
            BaselineGoal::MaxVertices(most) => self.vertices <= most,
            BaselineGoal::MaxTriangles(most) => self.triangles <= most,
        }
    }

    /// A vertex goes, and `filling` takes the place of its star.
    pub(crate) fn shrink(&mut self, star: &VertexStar, filling: &[[PackedSample; 3]]) {
        self.vertices -= 1;
        self.triangles -= (star.triangles.len() - filling.len()) as u64;
    }

    /// Inserts `at`, which triangle `t` holds, unless the goal forbids it; returns the new triangles.
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
            BaselineGoal::MaxVertices(most) => self.vertices == most,
            BaselineGoal::MaxTriangles(most) => self.triangles + grown > most,
        };
        if is_full {
            return None;
        }
        (self.vertices, self.triangles) = (self.vertices + 1, self.triangles + grown);
        Some(mesh.insert(&task.grid, task.triangulation, t, at))
    }
}
