//! Panics of a library become errors without a word on stderr.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// True while this thread's panics are expected.
    static EXPECTED: Cell<bool> = const { Cell::new(false) };
}

/// `work`'s result, or `None` where it panicked. Nothing that `work` was changing then may be used
/// again.
pub(super) fn caught<T>(work: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !EXPECTED.get() {
                usual(info);
            }
        }));
    });
    let before = EXPECTED.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(work));
    EXPECTED.set(before);
    result.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_no_more_than_nothing() {
        assert_eq!(caught(|| 7), Some(7));
        let none: Option<()> = caught(|| panic!("expected"));
        assert!(none.is_none() && !EXPECTED.get());
    }
}
