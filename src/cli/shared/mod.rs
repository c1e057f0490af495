//! Shared code of verbs: arguments, checks before the work, reports and messages.

pub(crate) mod args;
pub(crate) mod batch;
pub(crate) mod check;
pub(crate) mod lists;
pub(crate) mod names;
mod outcome;
pub(crate) mod output;
pub(crate) mod pipes;
pub(crate) mod points;
mod progress;
pub(crate) mod report;
pub(crate) mod tabled;
pub(crate) mod text;
#[cfg(feature = "tracing")]
pub(crate) mod trace;
pub(crate) mod union;
pub(crate) mod verb;

pub(crate) use outcome::{NOT_JUDGED, VerbOutcome};
