//! What is told of a made mesh, whatever it was made of.

use serde::Serialize;

use crate::cli::shared::{Outcome, report, say, text};
use crate::cli::tin::args::Args;
use crate::cli::verify;
use crate::error::Result;
use crate::jobs::sift::Skipped;
use crate::jobs::tin::StageReport;
use crate::jobs::verify::{MeshReport, Original};

/// The report of both steps, as one JSON object.
#[derive(Serialize)]
#[serde(bound = "T: Serialize")]
pub(crate) struct Told<'a, T, O: Original> {
    #[serde(flatten)]
    pub(crate) made: &'a T,
    #[serde(rename = "verify", skip_serializing_if = "Option::is_none")]
    pub(crate) checked: Option<&'a MeshReport<O>>,
    #[serde(skip_serializing_if = "<[Skipped]>::is_empty")]
    pub(crate) skipped: &'a [Skipped],
    /// What was asked for and is not so.
    #[serde(skip)]
    pub(crate) unmet: Option<String>,
}

impl<T: Serialize, O: Original> Told<'_, T, O> {
    /// Tells of both steps as it was asked for.
    pub(super) fn tell(
        &self,
        args: &Args,
        made: impl FnOnce() -> String,
        checked: impl FnOnce(&MeshReport<O>) -> String,
    ) -> Result<Outcome> {
        if let Some(path) = &args.report {
            report::write(path, args.overwrite, self)?;
        }
        let is_told =
            args.show.tell(self, || made() + &self.checked.map_or(String::new(), checked))?;
        if let Some(unmet) = &self.unmet {
            say::failure(unmet);
        }
        let Some(proof) = self.checked else { return Ok(Outcome::of(self.unmet.is_none(), true)) };
        if !is_told {
            verify::tell(&proof.verdict);
        }
        Ok(verify::outcome(&proof.verdict))
    }
}

/// The largest error, that allowed, and the RMSE.
pub(super) fn errors(most: Option<f64>, allowed: f64, rmse: Option<f64>, unit: &str) -> String {
    let found = most.map(|e| format!("{} {unit}, ", text::bound(e)));
    let allowed = format!("{} {unit} allowed", text::number(allowed));
    let rmse = rmse.map(|e| format!(", RMSE {} {unit}", text::number(e)));
    found.unwrap_or_default() + &allowed + &rmse.unwrap_or_default()
}

/// Stages with their times.
pub(crate) fn stages(stages: &[StageReport]) -> String {
    let stage = |s: &StageReport| format!("{} {}", s.name, text::seconds(s.thread_seconds));
    stages.iter().map(stage).collect::<Vec<_>>().join(", ")
}
