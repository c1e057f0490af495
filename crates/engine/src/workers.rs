//! Worker threads that take numbered units of work, in order, until none is left.

use std::collections::BTreeMap;
use std::panic::Location;
use std::sync::{Condvar, Mutex};
use std::thread::{Scope, ScopedJoinHandle};

use crate::{Cancel, WorkSpan};
use terrane_base::error::{Error, Result};
use terrane_files::{lock, unlocked, wait};

/// Units per thread of [`in_order`] that may be open: in work, or finished and waiting for an earlier unit.
const WINDOW_PER_THREAD: u64 = 4;

/// Runs `work` on every unit below `units` on at most `threads` threads, at least one. Each thread has its own state,
/// made by `start` and consumed by `finish`.
///
/// # Errors
/// The first of any thread, after which no unit is started; `Interrupted` when cancelled.
#[track_caller]
pub fn run<S>(
    threads: usize,
    units: u64,
    cancel: &Cancel,
    start: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, u64) -> Result<()> + Sync,
    finish: impl Fn(S) -> Result<()> + Sync,
) -> Result<()> {
    let queue = UnitQueue::new(units, units, cancel);
    queue.run_threads(threads, start, work, finish);
    queue.into_result()
}

/// Starts a thread in `scope`; `None` if the system cannot create one.
pub fn spawn<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    work: impl FnOnce() -> T + Send + 'scope,
) -> Option<ScopedJoinHandle<'scope, T>> {
    std::thread::Builder::new().spawn_scoped(scope, work).ok()
}

/// As [`run`]; passes the results to `take` in the order of units, whichever finishes first. At most four
/// units per thread are open at once, so memory is bounded even if one unit is slow.
#[track_caller]
pub fn in_order<S, T: Send>(
    threads: usize,
    units: u64,
    cancel: &Cancel,
    start: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, u64) -> Result<T> + Sync,
    take: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let queue = UnitQueue::new(units, WINDOW_PER_THREAD * threads.max(1) as u64, cancel);
    let results = Mutex::new(OrderedResults { early: BTreeMap::new(), next: 0, take });
    let work = |state: &mut S, unit| {
        let result = work(state, unit)?;
        lock(&results).add(unit, result, &queue)
    };
    queue.run_threads(threads, start, work, |_| Ok(()));
    queue.into_result()
}

/// The units that the threads of a call take from, in order.
struct UnitQueue<'a> {
    /// Number of units.
    units: u64,
    /// Largest number of units that may be started beyond those with consumed results.
    window: u64,
    cancel: &'a Cancel,
    /// Caller of the public function: names the work in the trace.
    caller: &'static Location<'static>,
    progress: Mutex<QueueProgress>,
    changed: Condvar,
}

#[derive(Default)]
struct QueueProgress {
    /// The next unit to start.
    next: u64,
    /// The results of all units below this one are consumed.
    consumed: u64,
    /// No further unit is started.
    is_stopped: bool,
    /// The first error of any thread.
    error: Option<Error>,
}

impl<'a> UnitQueue<'a> {
    #[track_caller]
    fn new(units: u64, window: u64, cancel: &'a Cancel) -> Self {
        let (progress, changed) = (Mutex::default(), Condvar::new());
        Self { units, window, cancel, caller: Location::caller(), progress, changed }
    }

    fn run_threads<S>(
        &self,
        threads: usize,
        start: impl Fn() -> S + Sync,
        work: impl Fn(&mut S, u64) -> Result<()> + Sync,
        finish: impl Fn(S) -> Result<()> + Sync,
    ) {
        std::thread::scope(|scope| {
            let run = || self.run_worker(&start, &work, &finish);
            // With fewer threads than requested the result is the same. If there is none, this thread does all the work.
            let started = (0..threads).map_while(|_| spawn(scope, run)).count();
            if started == 0 {
                run();
            }
        });
    }

    /// The body of a thread: units until none is left. An error or a panic stops the other threads.
    fn run_worker<S>(
        &self,
        start: impl Fn() -> S,
        work: impl Fn(&mut S, u64) -> Result<()>,
        finish: impl Fn(S) -> Result<()>,
    ) {
        let _guard = StopOnPanic(self);
        if let Err(error) = self.run_units(start, work, finish) {
            self.stop(Some(error));
        }
    }

    fn run_units<S>(
        &self,
        start: impl Fn() -> S,
        work: impl Fn(&mut S, u64) -> Result<()>,
        finish: impl Fn(S) -> Result<()>,
    ) -> Result<()> {
        let mut state = start();
        while let Some(unit) = self.next_unit()? {
            let _span = WorkSpan::unit(self.caller, unit);
            work(&mut state, unit)?;
        }
        finish(state)
    }

    /// The next unit, as soon as it is within the window; `None` if none is left or a worker failed.
    fn next_unit(&self) -> Result<Option<u64>> {
        let mut progress = lock(&self.progress);
        // No deadlock: the window holds the first open unit, so some thread is working on it, and its end (a result, an
        // error or a panic) wakes all waiting threads. A cancelled run ends with that unit at the latest.
        while !progress.is_stopped
            && progress.next < self.units
            && progress.next - progress.consumed >= self.window
        {
            progress = wait(&self.changed, progress);
        }
        if progress.is_stopped || progress.next >= self.units {
            return Ok(None);
        }
        self.cancel.check()?;
        progress.next += 1;
        Ok(Some(progress.next - 1))
    }

    /// Moves the window: the results of all units below `end` are consumed.
    fn consume_to(&self, end: u64) {
        lock(&self.progress).consumed = end;
        self.changed.notify_all();
    }

    /// Starts no further unit, and wakes the waiting threads; `error` is `None` after a panic.
    fn stop(&self, error: Option<Error>) {
        let mut progress = lock(&self.progress);
        progress.is_stopped = true;
        // Later errors may be consequences of the first.
        progress.error = progress.error.take().or(error);
        self.changed.notify_all();
    }

    fn into_result(self) -> Result<()> {
        unlocked(self.progress).error.map_or(Ok(()), Err)
    }
}

/// Stops the other workers when one panics. Otherwise they would wait for the result of its unit forever, and the
/// panic could not leave the scope of the threads.
struct StopOnPanic<'a>(&'a UnitQueue<'a>);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.stop(None);
        }
    }
}

/// Results of units that finish in any order, consumed by `take` in order.
struct OrderedResults<T, F> {
    /// Results that wait for an earlier unit, by unit.
    early: BTreeMap<u64, T>,
    /// The unit whose result is consumed next.
    next: u64,
    take: F,
}

impl<T, F: FnMut(T) -> Result<()>> OrderedResults<T, F> {
    /// Adds a result, and consumes all results that are next in order. So the thread need not wait for earlier units:
    /// the thread that finishes the first missing unit consumes this result as well.
    fn add(&mut self, unit: u64, result: T, queue: &UnitQueue<'_>) -> Result<()> {
        self.early.insert(unit, result);
        while let Some(result) = self.early.remove(&self.next) {
            (self.take)(result)?;
            self.next += 1;
            // After each result, not once at the end, so that other threads start units while this one consumes.
            queue.consume_to(self.next);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::{Duration, Instant};
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
    fn results_are_consumed_in_the_order_of_units() {
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
    fn errors_and_cancellation_are_returned() {
        let work = |_: &mut (), unit| if unit == 7 { Err(Error::usage("seven")) } else { Ok(()) };
        let error = run(2, 100, &Cancel::default(), || (), work, Ok).unwrap_err();
        assert_eq!(error.to_string(), "seven");
        let cancel = Cancel::default();
        cancel.cancel();
        let error = run(2, 100, &cancel, || (), |_, _| Ok(()), Ok).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Interrupted);
    }

    /// Runs 1,000 units in order on three threads. Unit 0 waits until all units within the window have started, then
    /// returns `end()`. Also returns the number of units that had started by then.
    fn with_slow_unit(cancel: &Cancel, end: impl Fn() -> Result<()> + Sync) -> (Result<()>, u64) {
        let (started, before_end) = (AtomicU64::new(0), AtomicU64::new(0));
        let work = |_: &mut (), unit: u64| {
            started.fetch_add(1, Ordering::SeqCst);
            if unit > 0 {
                return Ok(());
            }
            let limit = Instant::now() + Duration::from_secs(10);
            while started.load(Ordering::SeqCst) < 3 * WINDOW_PER_THREAD && Instant::now() < limit {
                std::thread::yield_now();
            }
            // Units beyond the window would start in this time if nothing prevented it.
            std::thread::sleep(Duration::from_millis(50));
            before_end.store(started.load(Ordering::SeqCst), Ordering::SeqCst);
            end()
        };
        let result = in_order(3, 1000, cancel, || (), work, Ok);
        (result, before_end.into_inner())
    }

    #[test]
    fn a_slow_unit_bounds_the_results_that_wait() {
        let (result, started) = with_slow_unit(&Cancel::default(), || Ok(()));
        result.unwrap();
        assert_eq!(started, 3 * WINDOW_PER_THREAD);
    }

    #[test]
    fn waiting_workers_end_with_errors_cancellation_and_panics() {
        let (result, _) = with_slow_unit(&Cancel::default(), || Err(Error::usage("zero")));
        assert_eq!(result.unwrap_err().to_string(), "zero");
        let cancel = Cancel::default();
        let (result, _) = with_slow_unit(&cancel, || {
            cancel.cancel();
            Ok(())
        });
        assert_eq!(result.unwrap_err().kind(), ErrorKind::Interrupted);
        let panic = || with_slow_unit(&Cancel::default(), || panic!("in a unit"));
        assert!(catch_unwind(AssertUnwindSafe(panic)).is_err());
    }
}
