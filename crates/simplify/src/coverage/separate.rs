//! Features held in memory and simplified independently: the result of a threshold is complete before it is
//! judged.

use rayon::prelude::*;

use super::input::{CoverageInput, ReadFile};
use super::trial::{OpenedLineJob, SimplifiedSource, TrialGoal};
use crate::feature::{self, PartCounts};
use crate::report::LineReport;
use crate::tool::SimplifyRule;
use terrane_base::error::Result;
use terrane_files::on_threads;
use terrane_vector::{Feature, Geometry};

impl OpenedLineJob<'_> {
    /// Simplifies all features and writes them if the result meets the goal; otherwise returns its size.
    pub(super) fn alone(
        &self,
        input: &mut CoverageInput<'_>,
        rule: &SimplifyRule,
        goal: &TrialGoal,
        report: &mut LineReport,
    ) -> Result<Option<u64>> {
        self.progress.begin("simplify", 0);
        let made = on_threads(self.job.resources.threads, || -> Result<Vec<_>> {
            let files = self.files.pairs.iter().zip(&input.all);
            let all: Result<Vec<Vec<_>>> = files
                .map(|(pair, file)| simplified(file, rule).map_err(|e| e.in_file(&pair.input)))
                .collect();
            Ok(all?.concat())
        })?;
        self.progress.end();
        let kept = made.iter().map(|(_, tally)| tally.kept).sum();
        let rejected_size =
            self.rejected_size(input, goal, kept, &mut SimplifiedInOrder(made.iter()))?;
        if rejected_size.is_some() {
            return Ok(rejected_size);
        }
        let written = self.write(input, &mut SimplifiedInOrder(made.iter()), None)?;
        made.iter().for_each(|(_, tally)| report.add(tally));
        self.note(input, written, report);
        Ok(None)
    }
}

fn simplified(file: &ReadFile, rule: &SimplifyRule) -> Result<Vec<(Geometry, PartCounts)>> {
    let features = file.features.par_iter().enumerate();
    features
        .map(|(at, feature)| feature::simplify(&feature.geometry, file.trees.get(at), rule))
        .collect()
}

/// Results of the remaining features.
struct SimplifiedInOrder<'a>(std::slice::Iter<'a, (Geometry, PartCounts)>);

impl SimplifiedSource for SimplifiedInOrder<'_> {
    fn of(&mut self, feature: &Feature) -> Result<Geometry> {
        Ok(self.0.next().map_or_else(|| feature.geometry.clone(), |(geometry, _)| geometry.clone()))
    }
}
