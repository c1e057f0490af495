//! Search for the threshold of a number of vertices or a file size, judged by the written result.

use std::sync::Mutex;

use rayon::prelude::*;

use super::input::CoverageInput;
use super::tiled_coverage::CoverageJob;
use super::trial::{OpenedLineJob, TrialGoal};
use crate::goal::GoalUnit;
use crate::report::LineReport;
use crate::target_search::{SizeLimit, ThresholdHistogram, seek};
use crate::tool::SimplifyRule;
use crate::trees;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::{lock, on_threads, unlocked};
use terrane_line::topology::RingCollapse;
use terrane_vector::{Geometry, GeometryPart};

impl OpenedLineJob<'_> {
    /// Simplifies all features by a rule and writes them if the result meets the goal; otherwise returns its size.
    pub(super) fn make(
        &self,
        input: &mut CoverageInput<'_>,
        rule: &SimplifyRule,
        goal: Option<&TrialGoal>,
        report: &mut LineReport,
    ) -> Result<Option<u64>> {
        let &Self { job, files, progress, cancel } = self;
        match (&job.topology, goal) {
            (Some(topology), _) => CoverageJob { job, files, topology, rule, progress, cancel }
                .run(input, goal, report),
            (None, Some(goal)) => self.alone(input, rule, goal, report),
            (None, None) => Err(Error::new(ErrorKind::Internal, "the search has no goal")),
        }
    }
}

/// Searches the threshold for a number of vertices or bytes.
pub(super) fn run(
    whole: &OpenedLineJob<'_>,
    input: &mut CoverageInput<'_>,
    max: u64,
    unit: GoalUnit,
    report: &mut LineReport,
) -> Result<()> {
    let job = whole.job;
    let rule = whole.files.rule(job, 0.0)?;
    let is_area = job.method.bounds.weight().is_some();
    let (profile, extent) = profile(whole, input, &rule)?;
    let all = match unit {
        GoalUnit::Vertices => profile.total as f64,
        GoalUnit::Bytes => whole.files.pairs.iter().map(|pair| pair.size() as f64).sum(),
    };
    let largest = (4.0 * extent).max(f64::MIN_POSITIVE);
    let dial = profile.dial(if is_area { largest * largest } else { largest }, is_area);
    let left = seek(&SizeLimit { most: max, all }, &dial, |threshold, range| {
        whole.cancel.check()?;
        let rule = SimplifyRule { threshold, ..rule };
        let left = whole.make(input, &rule, Some(&TrialGoal { unit, range }), report)?;
        report.measured_by(&rule);
        Ok(left)
    })?;
    left.map_or(Ok(()), |least| Err(too_few(whole, max, unit, least)))
}

fn too_few(whole: &OpenedLineJob<'_>, max: u64, unit: GoalUnit, least: u64) -> Error {
    let what = match unit {
        GoalUnit::Vertices => "vertices",
        GoalUnit::Bytes => "bytes",
    };
    let others = match (whole.job.collapse, unit) {
        (RingCollapse::Drop, GoalUnit::Vertices) => "",
        (RingCollapse::Drop, GoalUnit::Bytes) => ", or fewer ‹decimals› in a text format",
        (_, GoalUnit::Vertices) => ", or pass ‹collapse› drop",
        (_, GoalUnit::Bytes) => ", or pass ‹collapse› drop, or fewer ‹decimals› in a text format",
    };
    let stays = match whole.job.topology {
        Some(_) => "line ends, smallest rings and topology",
        None => "line ends and smallest rings",
    };
    let message = format!("{max} {what} cannot be reached; the minimum found is {least}");
    Error::usage(format!("{message} ({stays} are kept)"))
        .in_file(&whole.files.pairs[0].input)
        .remedy(format!("pass {least} or more{others}"))
}

/// Thresholds of all vertices, each line and ring independently, and the larger side of the bounding box.
fn profile(
    whole: &OpenedLineJob<'_>,
    input: &mut CoverageInput<'_>,
    rule: &SimplifyRule,
) -> Result<(ThresholdHistogram, f64)> {
    // All thresholds are needed, so tiny coordinates matter.
    let rule = &SimplifyRule { threshold: f64::MAX, ..*rule };
    let profile = Mutex::new(CoverageProfile::default());
    match input.memory_use() {
        // Snapped features have no hierarchies.
        Some(_) if input.moves.is_none() => on_threads(whole.job.resources.threads, || {
            whole.files.pairs.iter().zip(&input.all).try_for_each(|(pair, file)| {
                let features = file.features.par_iter().enumerate();
                let added = features.map(|(at, feature)| {
                    whole.cancel.check()?;
                    let thresholds =
                        trees::thresholds(&feature.geometry, file.trees.get(at), rule)?;
                    lock(&profile).add(&feature.geometry, thresholds);
                    Ok(())
                });
                added.collect::<Result<()>>().map_err(|e| e.in_file(&pair.input))
            })
        })?,
        _ => input.visit_all(whole.cancel, |feature| {
            let thresholds = trees::thresholds(&feature.geometry, None, rule)?;
            lock(&profile).add(&feature.geometry, thresholds);
            Ok(())
        })?,
    }
    let CoverageProfile { thresholds, bounds } = unlocked(profile);
    let extent = bounds.map_or(0.0, |[w, s, e, n]| (e - w).max(n - s));
    Ok((thresholds, extent))
}

#[derive(Default)]
struct CoverageProfile {
    thresholds: ThresholdHistogram,
    /// Bounding box of all features.
    bounds: Option<[f64; 4]>,
}

impl CoverageProfile {
    fn add(&mut self, geometry: &Geometry, thresholds: Vec<f64>) {
        thresholds.into_iter().for_each(|threshold| self.thresholds.add(threshold));
        for part in geometry.parts() {
            self.thresholds.total += part.xy.len() as u64;
            self.thresholds.fixed += stay(&part);
        }
        self.bounds = [self.bounds, geometry.bounds()].into_iter().flatten().reduce(join);
    }
}

/// Vertices of a part kept at any threshold.
fn stay(part: &GeometryPart<'_>) -> u64 {
    part.xy.len().min(if part.is_ring() { 4 } else { 2 }) as u64
}

fn join(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}
