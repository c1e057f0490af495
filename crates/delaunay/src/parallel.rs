//! Work in two halves: on one thread, or however the caller does it.

/// Does two things, maybe at the same time. A caller with a thread pool hands in its own; this room
/// starts no threads.
pub trait ForkJoin: Sync {
    /// Both results.
    fn join<A: Send, B: Send>(
        &self,
        a: impl FnOnce() -> A + Send,
        b: impl FnOnce() -> B + Send,
    ) -> (A, B);
}

/// One after the other.
#[derive(Clone, Copy, Debug, Default)]
pub struct SerialJoin;

impl ForkJoin for SerialJoin {
    fn join<A: Send, B: Send>(
        &self,
        a: impl FnOnce() -> A + Send,
        b: impl FnOnce() -> B + Send,
    ) -> (A, B) {
        (a(), b())
    }
}
