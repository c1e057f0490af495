//! The tolerance that meets a goal.

use super::budget::{ToleranceTrial, search};
use super::estimate::{MeshSize, SizeEstimator};
use super::goal::TinGoal;
use super::layout::TileLayout;
use super::run::{TinOutcome, run_on};
use super::settings::TinSettings;
use terrane_base::error::Result;
use terrane_mesh::{MeshBatch, MeshSink};
use terrane_raster::GridSource;
use terrane_tin::TinSpec;

/// Seeks among the meshes of one grid.
pub(super) struct TinSeeker<'a> {
    pub(super) source: &'a dyn GridSource,
    pub(super) layout: TileLayout,
    /// Settings without the tolerance.
    pub(super) settings: TinSettings<'a>,
}

impl TinSeeker<'_> {
    /// The tolerance to run with, and the number of trials to find it.
    pub(super) fn tolerance(&self, goal: TinGoal) -> Result<(f64, u32)> {
        let max_size = self.max_size();
        match goal {
            TinGoal::MaxError(tolerance) => Ok((tolerance, 0)),
            TinGoal::MaxVertices(budget) if budget >= max_size.vertices => Ok((0.0, 0)),
            TinGoal::MaxTriangles(budget) if budget >= max_size.triangles => Ok((0.0, 0)),
            TinGoal::MaxVertices(budget) => self.search(budget, |size| size.vertices),
            TinGoal::MaxTriangles(budget) => self.search(budget, |size| size.triangles),
        }
    }

    /// The size of the mesh of all samples.
    pub(super) fn max_size(&self) -> MeshSize {
        MeshSize { vertices: self.layout.samples(), triangles: 2 * self.layout.cells() }
    }

    /// Estimated size of the mesh at a tolerance.
    pub(super) fn estimate(&self, tolerance: f64) -> Result<MeshSize> {
        self.estimator().size(&self.spec(tolerance))
    }

    fn estimator(&self) -> SizeEstimator<'_> {
        SizeEstimator::new(self.source, self.layout, self.settings.threads, self.settings.cancel)
    }

    fn spec(&self, tolerance: f64) -> TinSpec {
        TinSpec { measure: false, tolerance, ..self.settings.spec }
    }

    fn search(&self, budget: u64, counted: impl Fn(MeshSize) -> u64) -> Result<(f64, u32)> {
        // Only a large budget may hold the mesh without error, which takes longest to count.
        let exact = match budget >= self.layout.samples() / 2 {
            true => Some(ToleranceTrial { tolerance: 0.0, count: self.count(0.0, &counted)? }),
            false => None,
        };
        if exact.is_some_and(|exact| exact.count <= budget) {
            return Ok((0.0, 1));
        }
        let (mut estimator, spec) = (self.estimator(), self.spec(0.0));
        search(
            budget,
            exact,
            |trial| estimator.guess(&spec, budget, trial, &counted),
            |tolerance| self.count(tolerance, &counted),
        )
    }

    /// The exact size of the mesh at a tolerance, by a run without output.
    fn count(&self, tolerance: f64, counted: impl Fn(MeshSize) -> u64) -> Result<u64> {
        let stage = format!("count at {tolerance:.4}");
        let settings = TinSettings { spec: self.spec(tolerance), ..self.settings };
        let outcome =
            run_stage(&stage, self.source, Box::new(CountingSink), self.layout, &settings)?;
        Ok(counted(MeshSize { vertices: outcome.vertices, triangles: outcome.triangles }))
    }
}

/// Triangulates all of `source` into `sink`, as a stage of this name.
pub(super) fn run_stage(
    name: &str,
    source: &dyn GridSource,
    sink: Box<dyn MeshSink>,
    layout: TileLayout,
    settings: &TinSettings<'_>,
) -> Result<TinOutcome> {
    settings.progress.begin(name, layout.samples());
    let outcome = run_on(source, sink, settings);
    settings.progress.end();
    outcome
}

/// A sink that discards everything; the run itself counts.
struct CountingSink;

impl MeshSink for CountingSink {
    fn push(&mut self, _batch: MeshBatch<'_>) -> Result<()> {
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        Ok(0)
    }
}
