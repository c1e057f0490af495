//! Worker threads that take numbered units of work until none is left.

use std::collections::BTreeMap;
use std::panic::Location;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{Scope, ScopedJoinHandle};

use crate::{Cancel, WorkSpan};
use terrane_base::error::{Error, Result};
use terrane_files::lock;

/// Runs `work` on every unit below `units` on `threads` threads. Each thread has its own state, made by `start` and
/// consumed by `finish`. Stops at the first error, which is returned.
#[track_caller]
pub fn run<S>(
    threads: usize,
    units: u64,
    cancel: &Cancel,
    start: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, u64) -> Result<()> + Sync,
    finish: impl Fn(S) -> Result<()> + Sync,
) -> Result<()> {
    let caller = Location::caller();
    let next = AtomicU64::new(0);
    let failed = AtomicBool::new(false);
    let error: Mutex<Option<Error>> = Mutex::new(None);
    let worker = || -> Result<()> {
        let mut state = start();
        loop {
            let unit = next.fetch_add(1, Ordering::Relaxed);
            if unit >= units || failed.load(Ordering::Relaxed) {
                return finish(state);
            }
            cancel.check()?;
            let _span = WorkSpan::unit(caller, unit);
            work(&mut state, unit)?;
        }
    };
    std::thread::scope(|scope| {
        let run = || {
            if let Err(e) = worker() {
                failed.store(true, Ordering::Relaxed);
                // The first error stays: later ones may only follow from it.
                lock(&error).get_or_insert(e);
            }
        };
        // A system short of threads gives fewer. That costs time, and this thread can do all of it.
        let started = (0..threads).map_while(|_| spawn(scope, run)).count();
        if started == 0 {
            run();
        }
    });
    lock(&error).take().map_or(Ok(()), Err)
}

/// Starts a thread; `None` if the system lacks threads or memory.
pub fn spawn<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    work: impl FnOnce() -> T + Send + 'scope,
) -> Option<ScopedJoinHandle<'scope, T>> {
    std::thread::Builder::new().spawn_scoped(scope, work).ok()
}

/// As [`run`]; consumes the results of units in order, whichever finishes first.
#[track_caller]
pub fn in_order<S, T: Send>(
    threads: usize,
    units: u64,
    cancel: &Cancel,
    start: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, u64) -> Result<T> + Sync,
    take: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let taking = Mutex::new((0, BTreeMap::new(), take));
    let work = |state: &mut S, unit: u64| {
        let made = work(state, unit)?;
        // No worker waits for its turn. A unit that comes early stays in the map, and whoever fills the gap
        // takes all that follow, under the lock that orders them.
        let (next, waiting, take) = &mut *lock(&taking);
        waiting.insert(unit, made);
        while let Some(made) = waiting.remove(next) {
            take(made)?;
            *next += 1;
        }
        Ok(())
    };
    run(threads, units, cancel, start, work, |_| Ok(()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::ErrorKind;

    #[test]
    fn every_unit_is_done_once_and_every_state_is_finished() {
        let (sum, finished) = (AtomicU64::new(0), AtomicU64::new(0));
        let add = |total: &AtomicU64, n: u64| {
            total.fetch_add(n, Ordering::Relaxed);
        };
        let work = |mine: &mut u64, unit| {
            *mine += unit;
            Ok(())
        };
        let finish = |mine| {
            add(&sum, mine);
            add(&finished, 1);
            Ok(())
        };
        run(3, 101, &Cancel::default(), || 0, work, finish).unwrap();
        assert_eq!((sum.into_inner(), finished.into_inner()), (5050, 3));
    }

    #[test]
    fn what_units_give_is_taken_in_order() {
        let mut taken = Vec::new();
        let work = |_: &mut (), unit: u64| {
            std::thread::sleep(std::time::Duration::from_micros(unit * 7919 % 50));
            Ok(unit)
        };
        let take = |unit| {
            taken.push(unit);
            Ok(())
        };
        in_order(4, 200, &Cancel::default(), || (), work, take).unwrap();
        assert!(taken.into_iter().eq(0..200));
    }

    #[test]
    fn errors_and_cancellation_come_through() {
        let work = |_: &mut (), unit| if unit == 7 { Err(Error::usage("seven")) } else { Ok(()) };
        let error = run(2, 100, &Cancel::default(), || (), work, Ok).unwrap_err();
        assert_eq!(error.to_string(), "seven");
        let cancel = Cancel::default();
        cancel.cancel();
        let error = run(2, 100, &cancel, || (), |_, _| Ok(()), Ok).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Interrupted);
    }
}
