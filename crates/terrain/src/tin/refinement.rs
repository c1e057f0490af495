//! Refinement of a mesh of a grid, independent of its goal and its output.

use std::sync::Arc;

use terrane_options::{OptionRange, OptionRule, Options, check};

use super::angles::angle_bound;
use super::cost::{line_bytes, worker_bytes};
use super::goal::TinGoal;
use super::names::TriangulationName;
use terrane_base::bound::ErrorBound;
use terrane_base::error::Result;
use terrane_base::geom::Affine;
use terrane_baselines::TriangulationRule;
use terrane_engine::Resources;
use terrane_engine::constraints::ConstraintFeatures;
use terrane_engine::options::{BoundName, Constraints};
use terrane_raster::Water;
use terrane_tin::TinSpec;

/// Refinement of a mesh of a grid
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Method", setters = group, rules = RULES)]
#[non_exhaustive]
pub struct TinMethod {
    /// Where the tolerance holds: at samples, or along the grid lines between them as well
    #[option(value = "WHAT", with = BoundName)]
    pub bound: ErrorBound,
    /// Insert one global maximum at a time (reference algorithm; slower, more vertices)
    pub strict: bool,
    /// Remove redundant vertices
    #[option(default = true, off = "Keep redundant vertices (faster, more vertices)")]
    pub drop: bool,
    /// Let vertices lie above or below their samples, within the tolerance: 10 to 33 % fewer vertices, typically 20 %,
    /// three to four times slower
    pub fit_heights: bool,
    /// Triangulation rule
    #[option(value = "NAME", with = TriangulationName, default_text = "delaunay")]
    pub triangulation: Option<TriangulationRule>,
    /// Minimum triangle angle in plan view, in degrees; samples are inserted until it holds
    #[option(value = "DEGREES", range = OptionRange::POSITIVE)]
    pub min_angle: Option<f64>,
    /// Points and breaklines to keep.
    #[option(flatten)]
    pub constraints: Constraints,
}

const RULES: &[OptionRule] = &[
    OptionRule::NotWith("fit_heights", &["strict", "drop"]),
    // Which triangles are not Delaunay is found by dropping vertices.
    OptionRule::NotWith("triangulation=data-dependent", &["drop"]),
    // Lines may meet under any angle.
    OptionRule::NotWith("breaklines", &["min_angle"]),
];

impl TinMethod {
    /// Settings of the kernel for a grid with this map, with measured errors and without the tolerance.
    ///
    /// # Errors
    /// An angle above that of the cells; conflicting options.
    pub(super) fn spec(&self, map: &Affine) -> Result<TinSpec> {
        check(self)?;
        Ok(TinSpec {
            tolerance: 0.0,
            bound: self.bound,
            strict: self.strict,
            drop: self.drop,
            fit_heights: self.fit_heights,
            data_dependent: self.is_data_dependent(),
            min_angle: angle_bound(self.min_angle, map)?,
            single_precision: None,
            measure: true,
        })
    }

    /// Reads the points and breaklines to keep.
    ///
    /// # Errors
    /// Files that cannot be read.
    pub(super) fn features(
        &self,
        water: Option<&Arc<Water>>,
        resources: &Resources,
    ) -> Result<ConstraintFeatures> {
        let [points, lines] = self.files();
        ConstraintFeatures::read(points, lines, water, resources)
    }

    /// The names of the files of points and of breaklines.
    pub(super) fn files(&self) -> [Option<&str>; 2] {
        let Constraints { keep_points, breaklines, .. } = &self.constraints;
        [keep_points, breaklines].map(Option::as_deref)
    }

    /// True where triangles may be others than Delaunay ones.
    pub(super) fn is_data_dependent(&self) -> bool {
        self.triangulation == Some(TriangulationRule::DataDependent)
    }

    /// Most bytes of a worker on tiles of `tile` cells, without shared data; more if it `follows` lines.
    pub(super) fn worker_bytes(&self, goal: TinGoal, tile: u32, follows: bool) -> u64 {
        // Any sample may become a vertex to reach these.
        let keeps_all = goal == TinGoal::MaxError(0.0) || self.min_angle.is_some();
        let lines = if follows { line_bytes(tile) } else { 0 };
        lines + worker_bytes(tile, keeps_all, self.fit_heights)
    }
}
