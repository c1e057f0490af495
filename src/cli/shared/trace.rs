//! Trace of the scheduler on stderr, filtered by `RUST_LOG`: with the feature `tracing`.

use std::io::stderr;

use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::FmtSpan;

use terrane_engine::{FileAt, Progress};

/// Prints stages at level info and each unit of work, with the time it took, at level debug.
pub(crate) fn start() {
    let printed = tracing_subscriber::fmt().with_env_filter(EnvFilter::from_default_env());
    // A second call in a process finds the subscriber of the first, which is the same.
    let _ = printed.with_span_events(FmtSpan::CLOSE).with_writer(stderr).try_init();
}

/// Progress whose stages are traced as well.
pub(crate) struct TracedProgress(pub(crate) Box<dyn Progress>);

impl Progress for TracedProgress {
    fn begin(&self, stage: &str, total: u64) {
        tracing::info!(target: "terrane", stage, total, "stage begins");
        self.0.begin(stage, total);
    }

    fn advance(&self, units: u64) {
        self.0.advance(units);
    }

    fn file(&self, file: FileAt<'_>) {
        tracing::debug!(target: "terrane", file = file.name, number = file.number, of = file.of, "reads");
        self.0.file(file);
    }

    fn end(&self) {
        tracing::info!(target: "terrane", "stage ends");
        self.0.end();
    }
}
