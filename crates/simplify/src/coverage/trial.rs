//! Result of a threshold, judged before output.

use std::ops::RangeInclusive;
use std::path::Path;

use super::input::CoverageInput;
use crate::files::{self, LineFiles};
use crate::goal::GoalUnit;
use crate::job::LineJob;
use crate::report::LineReport;
use terrane_base::error::{Error, Result};
use terrane_engine::{Cancel, Progress};
use terrane_vector::{Feature, Geometry, WrittenFeatures};

/// A job on all features.
pub(super) struct OpenedLineJob<'a> {
    pub(super) job: &'a LineJob,
    pub(super) files: &'a LineFiles,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
}

/// Limits for the result of a threshold.
pub(super) struct TrialGoal {
    pub(super) unit: GoalUnit,
    pub(super) range: RangeInclusive<u64>,
}

/// Results of features, one after the other.
pub(super) trait SimplifiedSource {
    /// Result of the next feature.
    fn of(&mut self, feature: &Feature) -> Result<Geometry>;

    /// False once the result is known to be rejected.
    fn may_appear(&self) -> bool {
        true
    }
}

impl OpenedLineJob<'_> {
    /// Size of the result of a threshold if it is rejected: `vertices`, or the bytes of `leaves`.
    pub(super) fn rejected_size(
        &self,
        input: &mut CoverageInput<'_>,
        goal: &TrialGoal,
        vertices: u64,
        leaves: &mut dyn SimplifiedSource,
    ) -> Result<Option<u64>> {
        let size = match goal.unit {
            GoalUnit::Vertices => vertices,
            GoalUnit::Bytes => self.size(input, leaves)?,
        };
        Ok(Some(size).filter(|size| !goal.range.contains(size)))
    }

    /// Size of all files in bytes, written under their names to a temporary folder.
    fn size(
        &self,
        input: &mut CoverageInput<'_>,
        leaves: &mut dyn SimplifiedSource,
    ) -> Result<u64> {
        let folder = match &self.job.resources.temp_dir {
            Some(folder) => tempfile::tempdir_in(folder),
            None => tempfile::tempdir(),
        };
        let folder = folder.map_err(|e| Error::write(&std::env::temp_dir(), e))?;
        let written = self.write(input, leaves, Some(folder.path()))?;
        Ok(written.iter().map(|written| written.bytes).sum())
    }

    /// Writes all features to the outputs, or to a folder for a trial. Files appear as long as `leaves` allows;
    /// the finished ones are returned.
    pub(super) fn write(
        &self,
        input: &mut CoverageInput<'_>,
        leaves: &mut dyn SimplifiedSource,
        trial: Option<&Path>,
    ) -> Result<Vec<WrittenFeatures>> {
        let (job, mut all) = (self.job, Vec::new());
        self.progress.begin("write", input.all.len() as u64);
        for (file, pair) in self.files.pairs.iter().enumerate() {
            let layer = &input.all[file].layer;
            // Errors of a trial name the output.
            let named = |e: Error| if trial.is_some() { e.renamed(&pair.output) } else { e };
            let created = match trial {
                Some(folder) => pair.create_in(folder, job, layer),
                None => pair.create(job, layer),
            };
            let mut sink = created.map_err(named)?;
            input.visit(file, self.cancel, |feature| {
                let geometry = leaves.of(feature)?;
                let original = std::mem::replace(&mut feature.geometry, geometry);
                let written = sink.write(feature);
                feature.geometry = original;
                written.map_err(named)
            })?;
            if leaves.may_appear() {
                all.push(sink.finish(&input.all[file].foreign).map_err(named)?);
            }
            self.progress.advance(1);
        }
        self.progress.end();
        Ok(all)
    }

    /// Adds the written data to a report.
    pub(super) fn note(
        &self,
        input: &CoverageInput<'_>,
        written: Vec<WrittenFeatures>,
        report: &mut LineReport,
    ) {
        for (written, file) in written.into_iter().zip(&input.all) {
            files::note(report, written, file.notes.clone());
        }
    }
}
