//! Report of a simplification.

use serde::Serialize;

use super::feature::PartCounts;
use super::goal::MetGoal;
use super::hierarchy_file::HierarchyFile;
use super::job::LineJob;
use super::tool::{DistanceKind, SimplifyRule};
use terrane_base::error::Result;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::Transformed;

/// Use of a hierarchy file by a simplification.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct HierarchyReport {
    pub file: String,
    /// True for a new file, false for an existing one.
    pub made: bool,
    pub bytes: u64,
    /// Seconds over all threads to make or check hierarchies.
    pub prepare_seconds: f64,
    /// Seconds over all threads to query hierarchies.
    pub query_seconds: f64,
}

/// Report of a simplification.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct LineReport {
    pub inputs: Vec<String>,
    pub outputs: Vec<String>,
    pub method: String,
    pub measure: DistanceKind,
    pub threshold: MetGoal,
    /// CRS of the inputs.
    pub crs: String,
    /// Transformation to the output CRS, if it differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transformed: Option<Transformed>,
    pub features: u64,
    /// Number of lines and rings.
    pub parts: u64,
    pub vertices: u64,
    pub kept: u64,
    /// Largest distance of a vertex from the segment that replaces it, in units of the metric.
    pub largest_distance: f64,
    /// Rings that would have fewer than three vertices left.
    pub collapsed: u64,
    /// Number of arcs (shared borders and the parts between them); 0 without topology.
    pub arcs: u64,
    /// Pieces that keep more vertices because of their neighbours.
    pub refined: u64,
    /// Vertices that are not rounded because of topology.
    pub unrounded: u64,
    /// Pairs of segments that cross, touch or overlap in the input and in the output.
    pub input_crossings: u64,
    /// The hierarchy file, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hierarchy: Option<HierarchyReport>,
    pub output_bytes: u64,
    pub notes: Vec<String>,
    #[serde(flatten)]
    pub run: RunStatistics,
}

impl LineReport {
    /// Completes the hierarchy file, if any, and adds it to the report.
    pub(super) fn stored(&mut self, job: &LineJob, store: HierarchyFile) -> Result<()> {
        let Some(path) = &job.hierarchy else { return Ok(()) };
        let own = self.hierarchy.get_or_insert_default();
        (own.file, own.made) = (path.display().to_string(), store.makes());
        own.bytes = store.finish()?;
        Ok(())
    }

    pub(super) fn add(&mut self, tally: &PartCounts) {
        if tally.prepare_seconds + tally.query_seconds > 0.0 {
            let own = self.hierarchy.get_or_insert_default();
            own.prepare_seconds += tally.prepare_seconds;
            own.query_seconds += tally.query_seconds;
        }
        self.features += tally.features;
        self.parts += tally.parts;
        self.vertices += tally.vertices;
        self.kept += tally.kept;
        self.collapsed += tally.collapsed;
        self.largest_distance = self.largest_distance.max(tally.distance2.sqrt());
    }

    pub(super) fn measured_by(&mut self, rule: &SimplifyRule) {
        self.measure = rule.measure;
        let value = rule.threshold.max(0.0);
        self.threshold = MetGoal { value, metres: rule.measure == DistanceKind::Geographic };
    }
}
