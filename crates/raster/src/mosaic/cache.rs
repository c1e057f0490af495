//! LRU pool of the open files of a mosaic, limited in number. Files are opened outside the lock, each by one thread.

use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex};

use crate::grid::GridSource;
use terrane_base::error::Result;
use terrane_files::{lock, wait};

/// Maximum number of open files.
const MAX_FILES: usize = 256;
/// Fraction of the process limit of open files for a mosaic: a file may need a second handle (a mask, a
/// temporary file), and the job has its own files.
const FILE_SHARE: u64 = 4;

/// An open file.
pub(super) type Grid = Arc<dyn GridSource>;

/// The open files of a mosaic and of all nested mosaics.
pub(super) struct MosaicFilePool {
    max_files: usize,
    keys: AtomicU64,
    state: Mutex<MosaicPoolState>,
    /// Signalled whenever a file is open or could not be opened.
    changed: Condvar,
}

#[derive(Default)]
struct MosaicPoolState {
    slots: HashMap<u64, MosaicPoolSlot>,
    /// Keys by time of last use; the first entry is closed next.
    order: BTreeMap<u64, u64>,
    clock: u64,
}

enum MosaicPoolSlot {
    /// A thread is opening the file.
    Opening,
    Ready {
        grid: Grid,
        stamp: u64,
    },
}

impl MosaicFilePool {
    /// A pool of as many files as the process may have open.
    pub(super) fn new() -> Self {
        Self::with(open_files_allowed())
    }

    fn with(max_files: usize) -> Self {
        Self {
            max_files,
            keys: AtomicU64::new(0),
            state: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    /// An unused key.
    pub(super) fn new_key(&self) -> u64 {
        self.keys.fetch_add(1, Ordering::Relaxed)
    }

    /// The file `key`, opened by `open` unless it is open. `open` must not wait for threads that may need the
    /// same file.
    pub(super) fn get(&self, key: u64, open: impl FnOnce() -> Result<Grid>) -> Result<Grid> {
        if let Some(grid) = self.find_or_claim(key) {
            return Ok(grid);
        }
        // Dropped on failure and on panic, so that waiting threads retry.
        let _claim = MosaicOpenClaim { pool: self, key };
        // Before the file is opened, as the limit of open files holds then, too; and after, as other threads have opened
        // files meanwhile.
        lock(&self.state).make_room(self.max_files);
        let grid = open()?;
        let mut state = lock(&self.state);
        state.make_room(self.max_files);
        state.insert(key, grid.clone());
        Ok(grid)
    }

    /// Keeps an open file if there is space for it.
    pub(super) fn offer(&self, key: u64, grid: Grid) {
        let mut state = lock(&self.state);
        if state.order.len() < self.max_files {
            state.insert(key, grid);
        }
    }

    /// The file `key` if it is open; does not count as use.
    pub(super) fn peek(&self, key: u64) -> Option<Grid> {
        match lock(&self.state).slots.get(&key) {
            Some(MosaicPoolSlot::Ready { grid, .. }) => Some(grid.clone()),
            _ => None,
        }
    }

    /// The open file, or `None` after claiming it for this thread.
    fn find_or_claim(&self, key: u64) -> Option<Grid> {
        let mut state = lock(&self.state);
        loop {
            match state.slots.get(&key) {
                Some(MosaicPoolSlot::Ready { .. }) => return state.touch(key),
                Some(MosaicPoolSlot::Opening) => {
                    state = wait(&self.changed, state);
                }
                None => {
                    state.slots.insert(key, MosaicPoolSlot::Opening);
                    return None;
                }
            }
        }
    }
}

impl MosaicPoolState {
    fn touch(&mut self, key: u64) -> Option<Grid> {
        let Some(MosaicPoolSlot::Ready { grid, stamp }) = self.slots.get_mut(&key) else {
            return None;
        };
        self.clock += 1;
        self.order.remove(stamp);
        self.order.insert(self.clock, key);
        *stamp = self.clock;
        Some(grid.clone())
    }

    /// Closes files until one more fits.
    fn make_room(&mut self, max_files: usize) {
        while self.order.len() >= max_files
            && let Some((_, oldest)) = self.order.pop_first()
        {
            self.slots.remove(&oldest);
        }
    }

    fn insert(&mut self, key: u64, grid: Grid) {
        self.clock += 1;
        self.order.insert(self.clock, key);
        self.slots.insert(key, MosaicPoolSlot::Ready { grid, stamp: self.clock });
    }
}

/// Claim of one thread to open one file.
struct MosaicOpenClaim<'a> {
    pool: &'a MosaicFilePool,
    key: u64,
}

impl Drop for MosaicOpenClaim<'_> {
    fn drop(&mut self) {
        let mut state = lock(&self.pool.state);
        if let Some(MosaicPoolSlot::Opening) = state.slots.get(&self.key) {
            state.slots.remove(&self.key);
        }
        drop(state);
        self.pool.changed.notify_all();
    }
}

/// Number of files that a mosaic may have open.
fn open_files_allowed() -> usize {
    let share = open_files_limit().unwrap_or(u64::MAX) / FILE_SHARE;
    (share as usize).clamp(1, MAX_FILES)
}

/// Process limit of open files; `None` if there is none.
#[cfg(unix)]
fn open_files_limit() -> Option<u64> {
    rustix::process::getrlimit(rustix::process::Resource::Nofile).current
}

#[cfg(not(unix))]
fn open_files_limit() -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GridOpenOptions, open};
    use std::sync::atomic::AtomicUsize;
    use terrane_base::error::Error;

    fn file() -> Result<Grid> {
        Ok(open("synth:rough,size=9", &GridOpenOptions::default())?.into())
    }

    fn is_open(pool: &MosaicFilePool, key: u64) -> bool {
        pool.peek(key).is_some()
    }

    #[test]
    fn the_least_recently_used_file_is_closed_first() {
        let pool = MosaicFilePool::with(2);
        pool.get(1, file).unwrap();
        pool.get(2, file).unwrap();
        pool.get(1, || panic!("is open")).unwrap();
        pool.get(3, file).unwrap();
        assert_eq!([1, 2, 3].map(|key| is_open(&pool, key)), [true, false, true]);
        pool.offer(4, file().unwrap());
        assert!(!is_open(&pool, 4), "no room");
    }

    #[test]
    fn a_file_that_cannot_be_opened_is_tried_again() {
        let pool = MosaicFilePool::with(2);
        assert!(pool.get(1, || Err(Error::bad_input("no"))).is_err());
        let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let _ = pool.get(1, || panic!("bug"));
        }));
        assert!(caught.is_err());
        assert!(pool.get(1, file).is_ok());
    }

    #[test]
    fn many_threads_open_each_file_once() {
        let pool = MosaicFilePool::with(64);
        let opened = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for key in 0..50 {
                        let open = || {
                            opened.fetch_add(1, Ordering::Relaxed);
                            std::thread::yield_now();
                            file()
                        };
                        pool.get(key, open).unwrap();
                    }
                });
            }
        });
        assert_eq!(opened.into_inner(), 50);
    }

    #[test]
    fn some_files_may_be_open() {
        assert!((1..=MAX_FILES).contains(&open_files_allowed()));
    }
}
