//! Outcome of a verb.

/// Whether all guarantees hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum VerbOutcome {
    Kept,
    Broken,
    /// None is known to fail, but one could not be judged.
    NotJudged,
}

/// Exit code if no check failed, but one could not be made.
pub(crate) const NOT_JUDGED: u8 = 3;

impl VerbOutcome {
    /// Outcome of a verification without failures, complete or not.
    pub(crate) fn of(passed: bool, judged: bool) -> Self {
        match (passed, judged) {
            (false, _) => Self::Broken,
            (true, false) => Self::NotJudged,
            (true, true) => Self::Kept,
        }
    }
}
