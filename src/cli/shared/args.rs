//! Arguments that several verbs share.

use clap::Args;

use crate::cli::shared::output;
use crate::cli::shared::progress::{self, ProgressMode};
use terrane_base::error::{Error, Result};
use terrane_engine::Progress;
use terrane_engine::input::is_mesh;
use terrane_files::{is_made, path_of};

/// Fails if `input` is not a grid file, for an `option` of grid files.
pub(crate) fn only_grid_files(option: &str, input: &str) -> Result<()> {
    if is_made(input) {
        return Err(refusal(option, input, "a synthetic terrain"));
    }
    only_grids(option, input)
}

/// Fails if `input` is a mesh, for an `option` of grids.
pub(crate) fn only_grids(option: &str, input: &str) -> Result<()> {
    // Unreadable files are reported when they are opened.
    if is_mesh(input).unwrap_or(false) { Err(refusal(option, input, "a mesh")) } else { Ok(()) }
}

/// Error of an option of grid files, given with `what`.
pub(crate) fn refusal(option: &str, input: &str, what: &str) -> Error {
    Error::usage(format!("{option} is for grid files, not for {what}"))
        .in_file(&path_of(input))
        .remedy(format!("leave {option} out"))
}

/// Messages during and after a job.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Messages")]
pub(crate) struct ReportDisplay {
    /// Progress display on stderr
    #[arg(long, value_name = "HOW", value_enum, default_value_t = ProgressMode::Auto)]
    progress: ProgressMode,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Print no progress and no summary
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// True if stdout has the result itself.
    #[arg(skip)]
    is_taken: bool,
}

impl ReportDisplay {
    /// The requested progress display.
    pub(crate) fn progress(&self) -> Box<dyn Progress> {
        let shown = progress::display(if self.quiet { ProgressMode::None } else { self.progress });
        #[cfg(feature = "tracing")]
        let shown: Box<dyn Progress> = Box::new(super::trace::TracedProgress(shown));
        shown
    }

    /// The same on stderr if stdout has the result.
    pub(crate) fn with_pipe(&self, is_taken: bool) -> Self {
        Self { is_taken, ..self.clone() }
    }

    /// Prints a result as JSON or text, unless quiet; returns whether it did.
    pub(crate) fn print<R: serde::Serialize>(
        &self,
        report: &R,
        summary: impl FnOnce() -> String,
    ) -> Result<bool> {
        match (self.json, self.quiet) {
            (true, _) if self.is_taken => output::aside(&output::pretty(report)?),
            (true, _) => output::json(report)?,
            (false, false) if self.is_taken => output::aside(&summary()),
            (false, false) => output::result(&summary())?,
            (false, true) => return Ok(false),
        }
        Ok(true)
    }
}
