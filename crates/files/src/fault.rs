//! Faults on demand, to see what a failure at any place leaves behind: `TERRANE_FAULT=write:7` lets the
//! seventh write fail as on a full disk. Release builds know nothing of it.

use std::io;

/// A place where the outside world may fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultPoint {
    /// A new file.
    Create,
    /// A write to a file.
    Write,
    /// Bringing a file to the disk.
    Sync,
    /// A file takes its final name.
    Rename,
    /// Reading back what was written.
    Read,
    /// Not the outside world: a fault of the program, which panics here.
    Panic,
}

/// Fails where the environment asks for it; panics at [`FaultPoint::Panic`].
#[cfg(debug_assertions)]
pub fn point(point: FaultPoint) -> io::Result<()> {
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// Which point, and how many times it must be come to yet.
    static ORDER: OnceLock<Option<(String, AtomicU64)>> = OnceLock::new();
    let read = || {
        let order = std::env::var("TERRANE_FAULT").ok()?;
        let (name, count) = order.split_once(':')?;
        Some((name.to_owned(), AtomicU64::new(count.parse().ok()?)))
    };
    let Some((name, left)) = ORDER.get_or_init(read) else { return Ok(()) };
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
