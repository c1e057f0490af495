//! Each feature by itself, all of them held: what comes of a threshold is made before it is judged.

use rayon::prelude::*;

use super::input::{Collected, Input};
use super::trial::{Leaves, Wanted, Whole};
use crate::part::{self, Tally};
use crate::report::LineReport;
use crate::tool::Rule;
use terrane_base::error::Result;
use terrane_files::on_threads;
use terrane_vector::{Feature, Geometry};

impl Whole<'_> {
    /// Simplifies all features and writes them, if that is what is wanted; else tells what came.
    pub(super) fn alone(
        &self,
        input: &mut Input<'_>,
        rule: &Rule,
        wanted: &Wanted,
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
        let unwanted = self.unwanted(input, wanted, kept, &mut Made(made.iter()))?;
        if unwanted.is_some() {
            return Ok(unwanted);
        }
        let written = self.write(input, &mut Made(made.iter()), None)?;
        made.iter().for_each(|(_, tally)| report.add(tally));
        self.note(input, written, report);
        Ok(None)
    }
}

fn simplified(file: &Collected, rule: &Rule) -> Result<Vec<(Geometry, Tally)>> {
    let features = file.features.par_iter().enumerate();
    features
        .map(|(at, feature)| part::simplify(&feature.geometry, file.trees.get(at), rule))
        .collect()
}

/// What was made of features that are still to come.
struct Made<'a>(std::slice::Iter<'a, (Geometry, Tally)>);

impl Leaves for Made<'_> {
    fn of(&mut self, feature: &Feature) -> Result<Geometry> {
        Ok(self.0.next().map_or_else(|| feature.geometry.clone(), |(geometry, _)| geometry.clone()))
    }
}
