//! Reports of meshes of any input.

use serde::Serialize;

use crate::cli::shared::{VerbOutcome, args, output, text};
use crate::cli::verify;
use terrane_base::error::Result;
use terrane_engine::skip_bad::Skipped;
use terrane_terrain::tin::StageReport;
use terrane_verify::{MeshOriginal, MeshReport};

/// Report of both steps as one JSON object.
#[derive(Serialize)]
#[serde(bound = "T: Serialize")]
pub(crate) struct MadeMeshReport<'a, T, O: MeshOriginal> {
    #[serde(flatten)]
    pub(crate) made: &'a T,
    #[serde(rename = "verify", skip_serializing_if = "Option::is_none")]
    pub(crate) checked: Option<&'a MeshReport<O>>,
    #[serde(skip_serializing_if = "<[Skipped]>::is_empty")]
    pub(crate) skipped: &'a [Skipped],
    /// Unmet requirements.
    #[serde(skip)]
    pub(crate) shortfall: Option<String>,
}

impl<T: Serialize, O: MeshOriginal> MadeMeshReport<'_, T, O> {
    /// Prints the report of both steps.
    pub(super) fn print(
        &self,
        show: &args::ReportDisplay,
        made: impl FnOnce() -> String,
        checked: impl FnOnce(&MeshReport<O>) -> String,
    ) -> Result<VerbOutcome> {
        let is_printed =
            show.print(self, || made() + &self.checked.map_or(String::new(), checked))?;
        if let Some(shortfall) = &self.shortfall {
            output::failure(shortfall);
        }
        let Some(proof) = self.checked else {
            return Ok(VerbOutcome::of(self.shortfall.is_none(), true));
        };
        if !is_printed {
            verify::print(&proof.verdict);
        }
        Ok(verify::outcome(&proof.verdict))
    }
}

/// Largest error, error bound, and RMSE.
pub(super) fn errors(max: Option<f64>, allowed: f64, rmse: Option<f64>, unit: &str) -> String {
    let max = max.map(|e| format!("{} {unit}, ", text::bound(e)));
    let allowed = format!("{} {unit} allowed", text::number(allowed));
    let rmse = rmse.map(|e| format!(", RMSE {} {unit}", text::number(e)));
    max.unwrap_or_default() + &allowed + &rmse.unwrap_or_default()
}

/// Stages with their times.
pub(crate) fn stages(stages: &[StageReport]) -> String {
    let stages = stages.iter().map(|s| format!("{} {}", s.name, text::seconds(s.thread_seconds)));
    stages.collect::<Vec<_>>().join(", ")
}
