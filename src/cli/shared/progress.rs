//! Progress on stderr: a bar with the time left, or one line after another.

use std::fmt;
use std::io::{IsTerminal, Write, stderr};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde::Serialize;

use crate::cli::shared::{output, text};
use terrane_engine::{FileAt, Progress, Silent};

/// Progress display.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressMode {
    /// A bar on a terminal, nothing otherwise
    Auto,
    /// A bar on a terminal, plain lines otherwise
    Bar,
    /// One JSON object per line
    Json,
    /// Nothing
    None,
}

/// Display for `how`.
pub(crate) fn display(how: ProgressMode) -> Box<dyn Progress> {
    match (how, stderr().is_terminal()) {
        (ProgressMode::Auto | ProgressMode::Bar, true) => Box::new(StageBar::new()),
        (ProgressMode::Bar, false) => Box::new(ProgressLines::new(plain)),
        (ProgressMode::Json, _) => Box::new(ProgressLines::new(json)),
        (ProgressMode::Auto, false) | (ProgressMode::None, _) => Box::new(Silent),
    }
}

/// A bar of the current stage, removed at its end.
struct StageBar(Mutex<Option<ProgressBar>>);

const TEMPLATE: &str =
    "{prefix:>10} [{bar:36}] {percent:>3} %  {rate}  {eta_precise} left  {wide_msg}";

impl StageBar {
    fn new() -> Self {
        Self(Mutex::new(None))
    }

    fn with(&self, change: impl FnOnce(&mut Option<ProgressBar>)) {
        change(&mut self.0.lock().unwrap_or_else(|e| e.into_inner()));
    }

    fn clear(bar: &mut Option<ProgressBar>) {
        if let Some(bar) = bar.take() {
            bar.finish_and_clear();
        }
    }
}

impl Progress for StageBar {
    fn begin(&self, stage: &str, total: u64) {
        self.with(|slot| {
            Self::clear(slot);
            let bar =
                ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr_with_hz(10));
            let style = ProgressStyle::with_template(TEMPLATE).map(|style| {
                style.with_key("rate", |state: &ProgressState, out: &mut dyn fmt::Write| {
                    let _ = out.write_str(&rate(state.per_sec()));
                })
            });
            bar.set_style(
                style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "),
            );
            bar.set_prefix(stage.to_owned());
            *slot = Some(bar);
        });
    }

    fn advance(&self, units: u64) {
        self.with(|slot| {
            if let Some(bar) = slot {
                bar.inc(units);
            }
        });
    }

    fn file(&self, file: FileAt<'_>) {
        self.with(|slot| {
            if let Some(bar) = slot {
                bar.set_message(InFile::from(file).to_string());
            }
        });
    }

    fn end(&self) {
        self.with(Self::clear);
    }
}

impl Drop for StageBar {
    fn drop(&mut self) {
        self.end();
    }
}

/// Shortest time between two lines of a stage.
const LINE_INTERVAL: Duration = Duration::from_millis(250);

/// Progress as lines, at the start and end of each stage and at intervals.
struct ProgressLines {
    stage: Mutex<Option<LoggedStage>>,
    layout: fn(&StageStatus<'_>) -> String,
}

struct LoggedStage {
    name: String,
    total: u64,
    done: u64,
    file: Option<InFile>,
    started: Instant,
    printed: Instant,
}

/// Contents of a line.
#[derive(Debug, Serialize)]
struct StageStatus<'a> {
    stage: &'a str,
    done: u64,
    total: u64,
    seconds: f64,
    /// Absent until known.
    per_second: Option<f64>,
    seconds_left: Option<f64>,
    /// Absent for a single input file.
    #[serde(flatten)]
    file: Option<&'a InFile>,
}

/// Current input file, its number from 1, and the number of files.
#[derive(Debug, Serialize)]
struct InFile {
    file: String,
    file_number: usize,
    files: usize,
}

impl From<FileAt<'_>> for InFile {
    fn from(FileAt { name, number, of }: FileAt<'_>) -> Self {
        Self { file: name.to_owned(), file_number: number, files: of }
    }
}

impl fmt::Display for InFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "file {} of {}: {}", self.file_number, self.files, self.file)
    }
}

impl LoggedStage {
    fn status(&self) -> StageStatus<'_> {
        let seconds = self.started.elapsed().as_secs_f64();
        let left = self.total.saturating_sub(self.done) as f64 / self.done as f64 * seconds;
        let is_known = self.done > 0 && seconds > 0.0;
        StageStatus {
            stage: &self.name,
            done: self.done,
            total: self.total,
            seconds,
            per_second: is_known.then_some(self.done as f64 / seconds),
            seconds_left: is_known.then_some(left),
            file: self.file.as_ref(),
        }
    }
}

impl ProgressLines {
    fn new(layout: fn(&StageStatus<'_>) -> String) -> Self {
        Self { stage: Mutex::new(None), layout }
    }

    fn print(&self, stage: &LoggedStage) {
        output::flushed(writeln!(stderr(), "{}", (self.layout)(&stage.status())));
    }

    fn with(&self, change: impl FnOnce(&mut Option<LoggedStage>)) {
        change(&mut self.stage.lock().unwrap_or_else(|e| e.into_inner()));
    }
}

impl Progress for ProgressLines {
    fn begin(&self, stage: &str, total: u64) {
        let now = Instant::now();
        let stage = LoggedStage {
            name: stage.to_owned(),
            total,
            done: 0,
            file: None,
            started: now,
            printed: now,
        };
        self.print(&stage);
        self.with(|slot| *slot = Some(stage));
    }

    fn advance(&self, units: u64) {
        self.with(|slot| {
            let Some(stage) = slot else { return };
            stage.done = stage.done.saturating_add(units);
            if stage.printed.elapsed() >= LINE_INTERVAL {
                stage.printed = Instant::now();
                self.print(stage);
            }
        });
    }

    fn file(&self, file: FileAt<'_>) {
        self.with(|slot| {
            if let Some(stage) = slot {
                stage.file = Some(file.into());
            }
        });
    }

    fn end(&self) {
        self.with(|slot| {
            if let Some(stage) = slot.take() {
                self.print(&stage);
            }
        });
    }
}

fn json(status: &StageStatus<'_>) -> String {
    serde_json::to_string(status).unwrap_or_default()
}

fn plain(status: &StageStatus<'_>) -> String {
    let share = status.done as f64 / status.total.max(1) as f64 * 100.0;
    let left = status.seconds_left.map_or(String::new(), |s| format!(", {s:.0} s left"));
    let rate = status.per_second.map_or(String::new(), |units| format!(", {}", rate(units)));
    let file = status.file.map_or(String::new(), |file| format!(", {file}"));
    format!("{}: {share:.0} %, {:.1} s{rate}{left}{file}", status.stage, status.seconds)
}

/// Units (samples, points, triangles) per second.
fn rate(units: f64) -> String {
    text::rate(units, "").replace(" /s", "/s")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_is_an_object_with_the_time_left() {
        let stage = LoggedStage {
            name: "tiles".into(),
            total: 100,
            done: 25,
            file: None,
            started: Instant::now(),
            printed: Instant::now(),
        };
        let value: serde_json::Value = serde_json::from_str(&json(&stage.status())).unwrap();
        assert_eq!(
            (&value["stage"], &value["done"], &value["total"]),
            (&"tiles".into(), &25.into(), &100.into())
        );
        assert!(value["seconds_left"].is_number() && value["per_second"].is_number());
        assert!(plain(&stage.status()).starts_with("tiles: 25 %"));
        assert!(value.get("file").is_none());
    }

    #[test]
    fn a_status_tells_the_file_where_there_are_several() {
        let now = Instant::now();
        let file = Some(FileAt { name: "b.laz", number: 2, of: 3 }.into());
        let stage = LoggedStage {
            name: "read".into(),
            total: 9,
            done: 3,
            file,
            started: now,
            printed: now,
        };
        let value: serde_json::Value = serde_json::from_str(&json(&stage.status())).unwrap();
        assert_eq!(
            (&value["file"], &value["file_number"], &value["files"]),
            (&"b.laz".into(), &2.into(), &3.into())
        );
        assert!(plain(&stage.status()).ends_with(", file 2 of 3: b.laz"));
    }

    #[test]
    fn every_display_takes_any_order_of_calls() {
        for display in
            [Box::new(StageBar::new()) as Box<dyn Progress>, Box::new(ProgressLines::new(plain))]
        {
            display.advance(3);
            display.end();
            display.begin("a", 0);
            display.advance(u64::MAX);
            display.begin("b", 10);
            display.end();
            display.end();
        }
    }
}
