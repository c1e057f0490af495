//! Spans of `tracing` around units of work, with the feature `tracing`; without it they compile to nothing.

use std::fmt::Debug;
use std::panic::Location;

/// A span of level debug around work on one thread; it ends when this is dropped.
#[must_use = "the span ends when this is dropped"]
pub struct WorkSpan {
    #[cfg(feature = "tracing")]
    _entered: tracing::span::EnteredSpan,
}

impl WorkSpan {
    /// A span named `work` with the kind and the place of the work, such as a tile and the step it is at.
    #[cfg_attr(
        not(feature = "tracing"),
        expect(unused_variables, reason = "recorded with the feature `tracing`")
    )]
    #[inline]
    pub fn enter(kind: &str, at: &impl Debug) -> Self {
        Self {
            #[cfg(feature = "tracing")]
            _entered: tracing::debug_span!(target: "terrane", "work", kind, ?at).entered(),
        }
    }

    /// The span of a numbered unit, whose kind is the line of code that hands out the units.
    pub(crate) fn unit(caller: &Location<'_>, unit: u64) -> Self {
        Self::enter(caller.file(), &(caller.line(), unit))
    }
}
