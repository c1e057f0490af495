//! `tracing` spans around units of work, with the feature `tracing`; otherwise they compile to nothing.

use std::fmt::Debug;
use std::panic::Location;

/// A span of level debug around work on one thread; it ends when this is dropped.
#[must_use = "the span ends when this is dropped"]
pub struct WorkSpan {
    #[cfg(feature = "tracing")]
    _entered: tracing::span::EnteredSpan,
}

impl WorkSpan {
    /// A span named `work` with the kind and the place of the work, such as a tile and its step.
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

#[cfg(all(test, feature = "tracing"))]
mod tests {
    use std::io::Write;
    use std::sync::{Arc, Mutex};

    use crate::{Cancel, workers};
    use terrane_files::lock;
    use tracing_subscriber::fmt::format::FmtSpan;

    #[derive(Clone, Default)]
    struct TraceText(Arc<Mutex<Vec<u8>>>);

    impl Write for TraceText {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            lock(&self.0).write(bytes)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn each_unit_has_a_span_with_its_number_and_its_time() {
        let text = TraceText::default();
        let copy = text.clone();
        let printed =
            tracing_subscriber::fmt().with_max_level(tracing::Level::DEBUG).with_ansi(false);
        printed.with_span_events(FmtSpan::CLOSE).with_writer(move || copy.clone()).init();
        workers::run(2, 3, &Cancel::default(), || (), |(), _| Ok(()), Ok).unwrap();
        let text = String::from_utf8(lock(&text.0).clone()).unwrap();
        // Other tests of this process have spans of other files.
        let own: Vec<&str> = text.lines().filter(|line| line.contains("src/trace.rs")).collect();
        assert_eq!(own.len(), 3, "{text}");
        for unit in 0..3 {
            assert!(own.iter().any(|line| line.contains(&format!(", {unit})"))), "{text}");
        }
        assert!(own.iter().all(|line| line.contains("time.busy=")), "{text}");
    }
}
