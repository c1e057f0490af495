//! Reports of a run, as JSON and as text.

use std::path::Path;

use serde::Serialize;

use crate::cli::shared::{output, text};
use terrane_base::error::{Error, Result};
use terrane_engine::json;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::skip_bad::Skipped;
use terrane_engine::transform::Transformed;
use terrane_files::atomic::AtomicFile;

/// A report with the skipped files.
#[derive(Serialize)]
pub(crate) struct WithSkipped<'a, R> {
    #[serde(flatten)]
    pub(crate) report: &'a R,
    #[serde(skip_serializing_if = "<[Skipped]>::is_empty")]
    pub(crate) skipped: &'a [Skipped],
}

/// Writes a report as a JSON file, atomically.
pub(crate) fn write(path: &Path, overwrite: bool, report: &impl Serialize) -> Result<()> {
    use std::io::Write;
    let mut file = AtomicFile::create(path, overwrite)?;
    file.write_all(output::pretty(report)?.as_bytes()).map_err(|e| Error::write(path, e))?;
    file.commit().map(drop)
}

/// A report as text.
pub(crate) trait Summarize: serde::Serialize {
    fn summary(&self) -> String;

    /// Unmet requirements.
    fn shortfall(&self) -> Option<String> {
        None
    }
}

/// A row of a table.
pub(crate) type Row = (&'static str, String);

/// Rows for time, rate, stages and memory of a run.
pub(crate) fn took(run: &RunStatistics, rate: Option<String>, stages: &str) -> Vec<Row> {
    let threads =
        if run.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", run.threads) };
    let stages = if stages.is_empty() { String::new() } else { format!(" ({stages})") };
    let rate = rate.map_or(String::new(), |rate| format!(", {rate}"));
    let mut rows =
        vec![("time", format!("{}{rate}, {threads}{stages}", text::seconds(run.wall_seconds)))];
    if let Some(peak) = run.peak_memory {
        let [peak, budget] = [peak, run.memory_budget].map(text::bytes);
        let spilled = match run.spilled_bytes {
            None | Some(0) => String::new(),
            Some(bytes) => format!(", {} through temporary files", text::bytes(bytes)),
        };
        rows.push(("memory", format!("peak {peak}, {budget} allowed{spilled}")));
    }
    rows
}

/// Notes as rows.
pub(crate) fn notes(notes: &[String]) -> impl Iterator<Item = Row> {
    notes.iter().map(|note| ("note", note.clone()))
}

/// All plain values of a report as text: a title and a table.
pub(crate) fn plain(report: &impl Serialize) -> String {
    let report = json::to_value(report).unwrap_or_default();
    let [input, output] = ["input", "output"].map(|key| report[key].as_str().unwrap_or_default());
    let title = format!("{input} -> {output}");
    let mut rows = text::rows(&report);
    rows.retain(|(key, _)| key != "input" && key != "output");
    if let Ok(water) = serde_json::from_value(report["water"].clone()) {
        rows.push(("water".to_owned(), text::water(&water)));
    }
    let done = serde_json::from_value::<Transformed>(report["transformed"].clone()).ok();
    rows.extend(transformed(done.as_ref()).map(|(key, value)| (key.to_owned(), value)));
    let notes = report["notes"].as_array().into_iter().flatten();
    rows.extend(
        notes.map(|note| ("note".to_owned(), note.as_str().unwrap_or_default().to_owned())),
    );
    format!("{title}\n{}", text::table(&rows))
}

/// Transformation of positions, as text.
pub(crate) fn transformed(done: Option<&Transformed>) -> impl Iterator<Item = Row> {
    done.into_iter().flat_map(|done| {
        let accuracy = match done.accuracy {
            Some(0.0) => String::new(),
            Some(metres) => format!(", accuracy {} m", text::number(metres)),
            None => ", accuracy unknown".to_owned(),
        };
        [("output CRS", done.crs.clone()), ("operation", format!("{}{accuracy}", done.operation))]
    })
}
