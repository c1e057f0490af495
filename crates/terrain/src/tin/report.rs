//! What a grid-to-TIN job did, and the clocks behind it.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::counters::MeshFlaws;
use terrane_base::bound::ErrorBound;
use terrane_base::geom::Affine;
use terrane_engine::bands::MeshBandReport;
use terrane_engine::breaklines::BreaklinesReport;
use terrane_engine::constraints::RequiredPointsReport;
use terrane_engine::local_frame::StorageScale;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::Transformed;
use terrane_raster::WaterReport;

/// Seconds and samples of one stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageReport {
    /// Name: "read", "tiles", "seams", "write", "reduce", "load"; "method" for textbook methods.
    pub name: String,
    /// Seconds spent in it, summed over threads.
    pub thread_seconds: f64,
    /// Samples it handled.
    pub samples: u64,
}

/// What a grid-to-TIN job did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct TinReport {
    pub input: String,
    pub output: String,
    pub format: String,
    pub width: u32,
    pub height: u32,
    /// CRS of the grid.
    pub crs: String,
    /// The operation to the CRS of the mesh, if that is another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transformed: Option<Transformed>,
    pub horizontal_unit: String,
    pub vertical_unit: String,
    /// The method, if it is not greedy insertion in tiles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<String>,
    /// The triangulation of the method, if it supports several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub triangulation: Option<String>,
    /// The bands of the mesh, if there are several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bands: Vec<MeshBandReport>,
    pub tolerance: f64,
    /// Where the tolerance holds.
    pub bound: ErrorBound,
    /// True when vertices may lie above or below their samples.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fit_heights: bool,
    /// The requested minimum angle, in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_angle: Option<f64>,
    /// Triangles with a smaller angle, if a minimum was requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thin_triangles: Option<FlawReport>,
    /// Largest error of any sample, when measured.
    pub max_error: Option<f64>,
    /// Root mean square error, when measured.
    pub rmse: Option<f64>,
    pub samples: u64,
    pub valid_samples: u64,
    /// Valid samples without any valid cell: they have no surface.
    pub isolated_samples: u64,
    /// Stored value that looks like an undeclared nodata value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub suspected_nodata: Option<f64>,
    /// Number of samples with that value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub suspected_samples: Option<u64>,
    pub vertices: u64,
    pub triangles: u64,
    /// Vertices per valid sample.
    pub kept: f64,
    /// Report on points to keep.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep_points: Option<RequiredPointsReport>,
    /// Report on breaklines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub breaklines: Option<BreaklinesReport>,
    /// Report on flattened water.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub water: Option<WaterReport>,
    /// Vertices on breaklines without an edge along them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub apart: Option<FlawReport>,
    pub output_bytes: u64,
    /// Name of the .prj file beside the mesh, if one was written.
    pub prj: Option<String>,
    /// Placement in the file, if the format has model coordinates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub placed: Option<StorageScale>,
    /// Notes for the user.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    pub tiles: u64,
    pub tile_cells: u32,
    /// Number of trial runs to find the tolerance of a budget.
    pub trials: u32,
    #[serde(flatten)]
    pub run: RunStatistics,
    pub samples_per_second: f64,
    pub stages: Vec<StageReport>,
}

/// Places where the mesh does not meet a requirement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FlawReport {
    /// Number of places.
    pub count: u64,
    /// World position of the first one (a corner of a triangle).
    pub first: Option<[f64; 2]>,
}

impl FlawReport {
    pub(super) fn of(flaws: MeshFlaws, map: &Affine) -> Self {
        let first = flaws.first.map(|[row, col]| map.apply(f64::from(col), f64::from(row)));
        Self { count: flaws.count, first }
    }

    /// The places as text, if there are any: `what` is there.
    fn text(&self, what: &str, remedy: &str) -> Option<String> {
        let ([x, y], count) = (self.first?, self.count);
        Some(format!("{count} {what}, the first one at x {x}, y {y}; raise ‹tile›{remedy}"))
    }
}

/// Requirements that the mesh does not meet, as text: triangles with too small an angle, and vertices that lack
/// an edge along a breakline.
pub(super) fn shortfall(
    thin: Option<FlawReport>,
    apart: Option<FlawReport>,
    min_angle: Option<f64>,
) -> Option<String> {
    let min_angle = min_angle.unwrap_or_default();
    let angle = format!("triangles have an angle below {min_angle} degrees");
    let thin = thin.and_then(|flaws| flaws.text(&angle, " or reduce ‹min_angle›"));
    thin.or_else(|| apart?.text("vertices on breaklines have no edge along them", ""))
}

impl TinReport {
    /// Requirements that the mesh does not meet, as text.
    pub fn shortfall(&self) -> Option<String> {
        shortfall(self.thin_triangles, self.apart, self.min_angle)
    }

    /// Sets the total time.
    pub(super) fn took(&mut self, time: Duration) {
        self.run.wall_seconds = time.as_secs_f64();
        self.samples_per_second = self.run.rate(self.samples);
    }

    /// Adds bytes of temporary files.
    pub(super) fn spilled(&mut self, bytes: u64) {
        self.run.spilled_bytes = Some(self.run.spilled_bytes.unwrap_or_default() + bytes);
    }
}

/// A stage of the pipeline.
#[derive(Clone, Copy, Debug)]
pub(super) enum PipelineStage {
    Read,
    Tiles,
    Seams,
    Write,
    /// Drops vertices that only a Delaunay mesh needs.
    Reduce,
    /// From saved containers.
    Load,
}

/// Time and samples by stage, of one worker or summed.
#[derive(Clone, Debug, Default)]
pub(super) struct StageClock {
    spent: [Duration; 6],
    samples: [u64; 6],
}

impl StageClock {
    const NAMES: [&str; 6] = ["read", "tiles", "seams", "write", "reduce", "load"];

    /// Adds the time since `started` and `samples` to a stage.
    pub(super) fn add(&mut self, stage: PipelineStage, started: Instant, samples: u64) {
        self.add_time(stage, started.elapsed());
        self.samples[stage as usize] += samples;
    }

    /// Adds time to a stage.
    pub(super) fn add_time(&mut self, stage: PipelineStage, spent: Duration) {
        self.spent[stage as usize] += spent;
    }

    /// Adds another clock.
    pub(super) fn merge(&mut self, other: &StageClock) {
        for stage in 0..Self::NAMES.len() {
            self.spent[stage] += other.spent[stage];
            self.samples[stage] += other.samples[stage];
        }
    }

    /// The report of all stages.
    pub(super) fn report(&self) -> Vec<StageReport> {
        let rare = [PipelineStage::Reduce, PipelineStage::Load].map(|stage| stage as usize);
        let used = (0..Self::NAMES.len()).filter(|i| !rare.contains(i) || self.samples[*i] > 0);
        let stages = used.map(|i| StageReport {
            name: Self::NAMES[i].to_owned(),
            thread_seconds: self.spent[i].as_secs_f64(),
            samples: self.samples[i],
        });
        stages.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_and_not_so_is_told_with_its_place() {
        let map = Affine { x0: 100.0, a: 10.0, b: 0.0, y0: 500.0, d: 0.0, e: -10.0 };
        let told = |thin: Option<MeshFlaws>| {
            let thin_triangles = thin.map(|thin| FlawReport::of(thin, &map));
            TinReport { min_angle: Some(20.0), thin_triangles, ..TinReport::default() }.shortfall()
        };
        assert_eq!(told(None), None);
        assert_eq!(told(Some(MeshFlaws::default())), None);
        let some = told(Some(MeshFlaws { count: 3, first: Some([2, 7]) })).unwrap();
        assert!(some.starts_with("3 triangles have an angle below 20 degrees"), "{some}");
        assert!(some.contains("x 170, y 480") && some.contains("‹tile›"), "{some}");
        let apart = Some(FlawReport { count: 2, first: Some([170.0, 480.0]) });
        let lines = TinReport { apart, ..TinReport::default() }.shortfall().unwrap();
        assert!(lines.starts_with("2 vertices on breaklines have no edge along them"), "{lines}");
        assert!(lines.contains("x 170, y 480"), "{lines}");
    }
}
