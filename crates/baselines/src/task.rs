//! What a method is asked for, and how far it may go.

use crate::grid::{Grid, Sample};
use crate::mesh::{Mesh, State};
use crate::plane::Offset;
use crate::star::Star;
use crate::triangulation::Triangulation;
use terrane_base::error::{Error, Result};

/// What a mesh has to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// No valid sample further than this from the surface, vertically; equal is allowed.
    MaxError(f64),
    /// At most so many vertices.
    MaxVertices(u64),
    /// At most so many triangles.
    MaxTriangles(u64),
}

/// A mesh to make.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// Of what.
    pub grid: Grid<'a>,
    /// How good.
    pub goal: Goal,
    /// How vertices are connected, by methods that leave it open.
    pub triangulation: Triangulation,
    /// Called now and then; where it fails, the work ends with its error.
    pub pulse: &'a dyn Fn() -> Result<()>,
}

impl<'a> Task<'a> {
    /// A task that nothing interrupts, with a Delaunay triangulation.
    pub fn new(grid: Grid<'a>, goal: Goal) -> Self {
        Self { grid, goal, triangulation: Triangulation::Delaunay, pulse: &|| Ok(()) }
    }

    /// The largest error allowed: of a number of vertices any error is asked to go.
    pub(crate) fn tolerance(&self) -> f64 {
        match self.goal {
            Goal::MaxError(tolerance) => tolerance,
            Goal::MaxVertices(_) | Goal::MaxTriangles(_) => 0.0,
        }
    }

    /// True for a sample that should become a vertex.
    pub(crate) fn exceeds(&self, offset: &Offset) -> bool {
        !offset.is_corner() && !offset.is_within(self.tolerance())
    }

    /// True for a sample whose error forbids that vertices go: of a number of vertices there is none.
    pub(crate) fn forbids(&self, offset: &Offset) -> bool {
        matches!(self.goal, Goal::MaxError(_)) && self.exceeds(offset)
    }
}

/// Vertices and triangles of a surface that grows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Size {
    pub(crate) vertices: u64,
    pub(crate) triangles: u64,
}

impl Size {
    /// Of the mesh a method begins with.
    ///
    /// # Errors
    /// Usage: it is larger than the goal allows.
    pub(crate) fn of(mesh: &Mesh, goal: Goal) -> Result<Self> {
        let size = Self::counted(mesh);
        size.check(goal)?;
        Ok(size)
    }

    pub(crate) fn counted(mesh: &Mesh) -> Self {
        let corners = |id: u32| mesh.tris[id as usize].corners;
        let mut vertices: Vec<Sample> = mesh.surface().flat_map(corners).collect();
        vertices.sort_unstable();
        vertices.dedup();
        Self { vertices: vertices.len() as u64, triangles: mesh.surface().count() as u64 }
    }

    /// Fails when a mesh that cannot be coarser is larger than the goal allows.
    ///
    /// # Errors
    /// Usage.
    pub(crate) fn check(self, goal: Goal) -> Result<()> {
        let (least, most, what) = match goal {
            Goal::MaxError(_) => return Ok(()),
            Goal::MaxVertices(most) => (self.vertices, most, "vertices"),
            Goal::MaxTriangles(most) => (self.triangles, most, "triangles"),
        };
        if least <= most {
            return Ok(());
        }
        Err(Error::usage(format!("the coarsest mesh of this grid has {least} {what}, not {most}"))
            .remedy(format!("allow {least} {what} or more")))
    }

    /// True when a goal in vertices or triangles is reached.
    pub(crate) fn meets(self, goal: Goal) -> bool {
        match goal {
            Goal::MaxError(_) => false,
            Goal::MaxVertices(most) => self.vertices <= most,
            Goal::MaxTriangles(most) => self.triangles <= most,
        }
    }

    /// A vertex goes, and `filling` takes the place of its star.
    pub(crate) fn shrink(&mut self, star: &Star, filling: &[[Sample; 3]]) {
        self.vertices -= 1;
        self.triangles -= (star.triangles.len() - filling.len()) as u64;
    }

    /// Inserts `at`, which triangle `t` holds, unless the goal forbids it; returns the new triangles.
    pub(crate) fn insert(
        &mut self,
        task: &Task<'_>,
        mesh: &mut Mesh,
        t: u32,
        at: Sample,
    ) -> Option<Vec<u32>> {
        debug_assert_eq!(mesh.tris[t as usize].state, State::Surface);
        let grown = mesh.growth(t, at);
        let is_full = match task.goal {
            Goal::MaxError(_) => false,
            Goal::MaxVertices(most) => self.vertices == most,
            Goal::MaxTriangles(most) => self.triangles + grown > most,
        };
        if is_full {
            return None;
        }
        (self.vertices, self.triangles) = (self.vertices + 1, self.triangles + grown);
        Some(mesh.insert(&task.grid, task.triangulation, t, at))
    }
}
