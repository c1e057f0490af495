//! Fault injection for tests: `TERRANE_FAULT=write:7` makes the seventh write fail as on a full disk. Not
//! part of release builds.

use std::io;

/// A point at which a fault can be injected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultPoint {
    /// A new file.
    Create,
    /// A write to a file.
    Write,
    /// Syncing a file to disk.
    Sync,
    /// Renaming a file to its final name.
    Rename,
    /// Reading back what was written.
    Read,
    /// A panic of the program.
    Panic,
}

/// Fails if the environment requests it; panics at [`FaultPoint::Panic`].
#[cfg(debug_assertions)]
pub fn point(point: FaultPoint) -> io::Result<()> {
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// The requested point, and the number of passes left before it fails.
    static ORDER: OnceLock<Option<(String, AtomicU64)>> = OnceLock::new();
    let order = ORDER.get_or_init(|| {
        let order = std::env::var("TERRANE_FAULT").ok()?;
        let (name, count) = order.split_once(':')?;
        Some((name.to_owned(), AtomicU64::new(count.parse().ok()?)))
    });
    let Some((name, left)) = order else { return Ok(()) };
    let is_it = format!("{point:?}").eq_ignore_ascii_case(name);
    // The count wraps after the fault, so that what cleans up after it goes through.
    if !is_it || left.fetch_sub(1, Ordering::Relaxed) != 1 {
        return Ok(());
    }
    assert!(point != FaultPoint::Panic, "a fault was asked for here");
    Err(io::Error::from(io::ErrorKind::StorageFull))
}

/// Nothing.
#[cfg(not(debug_assertions))]
#[inline(always)]
pub fn point(_point: FaultPoint) -> io::Result<()> {
    Ok(())
}
