//! What became of a verb that ran to its end.

/// Whether a verb found all promises kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum VerbOutcome {
    Kept,
    Broken,
    /// None is known to be broken, but one could not be judged.
    NotJudged,
}

/// The exit code where nothing wrong was found, and something promised could not be judged.
pub(crate) const NOT_JUDGED: u8 = 3;

impl VerbOutcome {
    /// Of a proof that found nothing wrong, and one that judged all that is promised.
    pub(crate) fn of(passed: bool, judged: bool) -> Self {
        match (passed, judged) {
            (false, _) => Self::Broken,
            (true, false) => Self::NotJudged,
            (true, true) => Self::Kept,
        }
    }
}
