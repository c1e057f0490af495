//! Proof of simplified lines against their original file.
//!
//! Both files are read side by side, feature by feature.
//!
//! A feature contributes its *pieces*: stretches of the original, each with the segment in its place (17
//! bytes a vertex). They are judged in bands of x, on all threads. If the pieces exceed the memory, only those
//! west of their median are stored, and the files are read again for the rest. There is no temporary file, and
//! no finding depends on the bands.
//!
//! Formats may sort features and reverse rings. A ring is matched forward and backward, vertex by vertex; if
//! both directions match, the one that keeps the sign of the area counts. Features in another order than the
//! original are stored, and paired by vertices and properties, then by vertices, then by properties, so that
//! exchanged geometries are detected. A missing part is a failure, unless dropping was declared and a segment
//! between two of its vertices has all others within the tolerance (a collapsed ring). Properties are compared
//! as far as the format supports them; unsupported ones are reported.

mod attributes;
mod feature;
mod findings;
mod pairs;

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use self::findings::FeatureFindings;
use self::pairs::{ComparisonOutcome, FeaturePairs};
use super::options::LineVerifyJob;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::plane::Xy;
use terrane_base::geom::{Crs, wkt};
use terrane_engine::memory::PROGRAM;
use terrane_engine::proof::ProofVerdict;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::on_threads;
use terrane_proof::lines::{
    DroppedParts, LineCheckReport, LineProofPieces, PartComparison, ProofDistance, XRange, judge,
};
use terrane_simplify::{DistanceKind, goal_of, positions};
use terrane_vector::{self as vector, VectorOpenOptions};

/// Report of the verification of simplified lines.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct LineVerifyReport {
    pub lines: String,
    pub original: String,
    #[serde(flatten)]
    pub verdict: ProofVerdict,
    /// Further remarks.
    pub notes: Vec<String>,
    /// True when crossings, rings, sides and borders were judged, not only measured.
    pub topology: bool,
    /// Features of the original, missing ones, and features that are in the lines alone.
    pub features: u64,
    pub gone_features: u64,
    pub added_features: u64,
    /// Features with other properties or another id, and with other points.
    pub changed_attributes: u64,
    pub changed_points: u64,
    /// Vertices with another height or measure.
    pub changed_heights: u64,
    /// Lines and rings of the result, missing ones, and missing ones that had to stay.
    pub parts: u64,
    pub dropped: u64,
    pub missing: u64,
    /// Before and after.
    pub vertices: [u64; 2],
    pub measure: DistanceKind,
    pub tolerance: Option<f64>,
    pub largest_distance: f64,
    /// Where that is.
    pub farthest: Option<[f64; 2]>,
    /// Vertices beyond the tolerance.
    pub beyond: u64,
    /// Parts with vertices that the original does not have.
    pub foreign: u64,
    /// Pairs of segments that cross, touch or overlap: before, after, and after without pairs of
    /// segments of the original.
    pub crossings: [u64; 3],
    pub collapsed: u64,
    pub turned: u64,
    /// Vertices and side points that have changed sides.
    pub moved: u64,
    /// Borders torn apart or run together.
    pub torn: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
}

/// Minimum number of bytes for pieces and for the band that is judged.
const MIN_BYTES: u64 = 1 << 20;
/// Bytes for each vertex of the band that is judged.
const BAND_VERTEX: u64 = 200;
/// Minimum and maximum number of vertices of a band.
const BAND: [u64; 2] = [1 << 12, 1 << 17];

/// Proves the lines of a file against the original.
///
/// # Errors
/// Files that cannot be read; pieces around one x that exceed the memory, or all features where the two files have
/// them in different orders.
pub fn verify_lines(
    job: &LineVerifyJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<LineVerifyReport> {
    let started = Instant::now();
    let original = vector::open(
        &job.original,
        &VectorOpenOptions { layer: job.layer.clone(), ..Default::default() },
    )?;
    let crs = original.layer().crs.clone();
    drop(original);
    let (measure, tolerance) = match job.tolerance {
        Some(length) => {
            let (measure, tolerance) = goal_of(length, job.is_space, &crs)?;
            (measure, Some(tolerance))
        }
        None if job.is_space => (DistanceKind::Space, None),
        None => (DistanceKind::Plane, None),
    };
    let points = match &job.sides {
        Some(path) => positions(path, &VectorOpenOptions::default())?,
        None => Vec::new(),
    };
    let distance = match measure {
        DistanceKind::Plane => ProofDistance::Plane,
        DistanceKind::Space => ProofDistance::Space,
        DistanceKind::Geographic => ProofDistance::Geographic,
    };
    let drops = if job.may_drop { DroppedParts::Thin } else { DroppedParts::None };
    let comparison = PartComparison { distance, tolerance, drops };
    let proof = LineProofRun { job, comparison, points, progress, cancel };
    let (found, findings, format) = on_threads(job.resources.threads, || proof.run())?;
    let mut report = findings_report(job, measure, tolerance, &found, &findings, format);
    judge_system(&crs, job, format, &mut report.verdict)?;
    Ok(LineVerifyReport { run: RunStatistics::since(started, &job.resources), ..report })
}

/// The format whose coordinates are always longitudes and latitudes on WGS 84.
const ALWAYS_WGS84: &str = "GPX";
/// Formats without the name of a system that are read as longitudes and latitudes on WGS 84.
const WGS84_BY_DEFAULT: [&str; 3] = [ALWAYS_WGS84, "GeoJSON", "GeoJSONSeq"];

/// Judges the reference system of the lines: it has to be that of the `original`.
fn judge_system(
    original: &Crs,
    job: &LineVerifyJob,
    format: &str,
    verdict: &mut ProofVerdict,
) -> Result<()> {
    let source = vector::open(&job.lines, &VectorOpenOptions::default())?;
    let stated = &source.layer().crs;
    let is_wgs84 = (stated.epsg, stated.vertical_epsg) == (Some(4326), None);
    let is_default = is_wgs84 && WGS84_BY_DEFAULT.contains(&format);
    // GeoJSON has no member for a CRS: a .prj beside the file may define it.
    let sidecar = wkt::of_srs(&terrane_files::prj(&job.lines)?);
    let has_sidecar = is_default && format != ALWAYS_WGS84 && sidecar.is_named();
    let lines_crs = if has_sidecar { &sidecar } else { stated };
    let is_default = is_default && !has_sidecar;
    if lines_crs.agrees(original) || (is_default && !original.is_named()) {
        return Ok(());
    }
    let [ours, theirs] = original.distinct_names(lines_crs);
    match (lines_crs.is_named(), original.is_named()) {
        (true, true) if format != ALWAYS_WGS84 && original.is_surely_another(lines_crs) => verdict
            .fail(format!("the CRS of the lines is {theirs}, and that of the original is {ours}")),
        (true, true) if format != ALWAYS_WGS84 => verdict.leave(format!(
            "whether the CRS of the lines, {theirs}, is that of the original, {ours}"
        )),
        (true, true) => verdict.leave(format!(
            "the CRS of the original, {ours}: coordinates of {format} are always on WGS 84"
        )),
        (true, false) => verdict.leave(format!(
            "whether the CRS of the lines, {theirs}, is that of the original, which names none"
        )),
        (false, _) => verdict.leave(format!(
            "the CRS of the lines: they name none, and that of the original is {ours}"
        )),
    }
    Ok(())
}

fn findings_report(
    job: &LineVerifyJob,
    measure: DistanceKind,
    tolerance: Option<f64>,
    checks: &LineCheckReport,
    findings: &FeatureFindings,
    format: &str,
) -> LineVerifyReport {
    let failures = [findings.failures(), failures(checks, job.topology)].concat();
    let mut not_judged = findings.not_judged(format);
    if tolerance.is_none() {
        not_judged.insert(0, "distances, as no bound is known (‹tolerance›)".to_owned());
    } else if checks.unknown > 0 {
        let count = checks.unknown;
        not_judged.push(format!(
            "{count} missing rings, too large to decide whether they collapse within the tolerance"
        ));
    }
    let cut = &findings.cut;
    let note = format!("truncated names of fields: {}", cut.join(", "));
    LineVerifyReport {
        lines: job.lines.display().to_string(),
        original: job.original.display().to_string(),
        verdict: ProofVerdict::of(failures, not_judged),
        notes: (!cut.is_empty()).then_some(note).into_iter().collect(),
        topology: job.topology,
        features: findings.features,
        gone_features: findings.gone.count,
        added_features: findings.added.count,
        changed_attributes: findings.attributes.count,
        changed_points: findings.points.count,
        changed_heights: checks.changed.count,
        parts: checks.parts,
        dropped: checks.dropped,
        missing: checks.missing.count,
        vertices: checks.vertices,
        measure,
        tolerance,
        largest_distance: checks.farthest.map_or(0.0, |far| far.distance),
        farthest: checks.farthest.map(|far| far.at),
        beyond: checks.beyond.count,
        foreign: checks.foreign.count,
        crossings: [checks.original_crossings, checks.crossings, checks.new_crossings.count],
        collapsed: checks.collapsed.count,
        turned: checks.turned.count,
        moved: checks.moved.count,
        torn: checks.torn.count,
        run: RunStatistics::default(),
    }
}

/// A proof under way.
struct LineProofRun<'a> {
    job: &'a LineVerifyJob,
    comparison: PartComparison,
    points: Vec<Xy>,
    progress: &'a dyn Progress,
    cancel: &'a Cancel,
}

/// Outcome of the comparison of all parts.
struct ComparedLines {
    pieces: LineProofPieces,
    report: LineCheckReport,
    findings: FeatureFindings,
}

impl LineProofRun<'_> {
    /// The findings, and the format of the lines.
    fn run(&self) -> Result<(LineCheckReport, FeatureFindings, &'static str)> {
        let mut pairs = FeaturePairs::new(self.job, self.cancel)?;
        let ComparedLines { mut pieces, mut report, findings } =
            self.compare(&mut pairs, f64::NEG_INFINITY)?;
        loop {
            self.judge(&pieces, &mut report)?;
            let done = pieces.band().to;
            if done == f64::INFINITY {
                return Ok((report, findings, pairs.format()));
            }
            drop(pieces);
            pieces = self.compare(&mut pairs, done)?.pieces;
        }
    }

    /// Compares all parts; stores as many pieces from x = `from` on as memory allows.
    fn compare(&self, pairs: &mut FeaturePairs<'_>, from: f64) -> Result<ComparedLines> {
        self.progress.begin("compare", 0);
        let max_bytes = self.job.resources.memory.saturating_sub(PROGRAM).max(2 * MIN_BYTES) / 2;
        loop {
            let mut report = LineCheckReport::default();
            let mut pieces = LineProofPieces::new(XRange { from, to: f64::INFINITY });
            let mut part = 0;
            let compared = pairs.each(self.progress, &mut |before, after, is_ring| {
                self.comparison.part(part, before, after, is_ring, &mut report, &mut pieces);
                part =
                    part.checked_add(1).ok_or_else(|| Error::limit("lines", "more", u32::MAX))?;
                while pieces.bytes() > max_bytes {
                    if !pieces.halve() {
                        return Err(crowded(self.job));
                    }
                }
                Ok(())
            })?;
            match compared {
                ComparisonOutcome::All(findings) => {
                    self.progress.end();
                    return Ok(ComparedLines { pieces, report, findings: *findings });
                }
                ComparisonOutcome::OutOfOrder => pairs.collect()?,
            }
        }
    }

    /// Judges the pieces together, band by band.
    fn judge(&self, pieces: &LineProofPieces, report: &mut LineCheckReport) -> Result<()> {
        let Resources { memory, threads, .. } = self.job.resources;
        let share = memory.saturating_sub(PROGRAM) / 2 / threads.max(1) as u64;
        let bands = pieces.bands((share / BAND_VERTEX).clamp(BAND[0], BAND[1]) as usize);
        self.progress.begin("judge", bands.len() as u64);
        let reports: Vec<LineCheckReport> = bands
            .par_iter()
            .map(|band| {
                self.cancel.check()?;
                let report = judge(pieces, &self.points, *band);
                self.progress.advance(1);
                Ok(report)
            })
            .collect::<Result<_>>()?;
        reports.iter().for_each(|band| report.add_band(band));
        self.progress.end();
        Ok(())
    }
}

fn crowded(job: &LineVerifyJob) -> Error {
    Error::new(ErrorKind::Resource, "the lines around one x exceed the memory")
        .in_file(&job.original)
        .remedy("pass more ‹memory›")
}

/// A report line for each broken promise.
fn failures(checks: &LineCheckReport, topology: bool) -> Vec<String> {
    let parts = [
        (checks.missing, "lines and rings are missing"),
        (checks.changed, "vertices have another height or measure"),
        (
            checks.foreign,
            "parts with vertices that the original does not have, or has in another order",
        ),
        (checks.beyond, "vertices farther than the tolerance from the segment in their place"),
    ];
    let neighbours = [
        (checks.new_crossings, "new crossings of segments"),
        (checks.collapsed, "rings have lost their area"),
        (checks.turned, "rings are turned over"),
        (checks.moved, "vertices or points have changed sides"),
        (checks.torn, "shared borders are torn apart or merged"),
    ];
    let judged = parts.into_iter().chain(neighbours.into_iter().filter(|_| topology));
    judged
        .filter(|(defect, _)| defect.count > 0)
        .filter_map(|(defect, what)| {
            let (part, [x, y]) = defect.first?;
            Some(format!("{} {what}; the first in part {part} at {x}, {y}", defect.count))
        })
        .collect()
}
