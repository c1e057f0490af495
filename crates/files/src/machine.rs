//! Properties of the machine. Querying the system takes as long as a small mesh, so results are cached.

use std::num::NonZero;
use std::sync::OnceLock;

use terrane_base::error::{Error, ErrorKind, Result};

/// Number of cores available to the process.
pub fn cores() -> usize {
    static CORES: OnceLock<usize> = OnceLock::new();
    *CORES.get_or_init(|| std::thread::available_parallelism().map_or(1, NonZero::get))
}

/// Physical memory in bytes, if the system reports it.
pub fn physical_memory() -> Option<u64> {
    static MEMORY: OnceLock<Option<u64>> = OnceLock::new();
    *MEMORY.get_or_init(|| proc_bytes("/proc/meminfo", "MemTotal:"))
}

/// Value in bytes of a line of a `/proc` file that is given in KiB.
pub fn proc_bytes(file: &str, key: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find(|line| line.starts_with(key))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

/// Runs `work` on a pool of `threads` threads; inside another pool (a mosaic in a mosaic) on that one.
///
/// # Errors
/// Errors of `work`; failure to start threads.
pub fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build();
    let pool =
        pool.map_err(|e| Error::new(ErrorKind::Resource, format!("cannot start threads: {e}")))?;
    pool.install(work)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_has_the_threads_it_was_given() {
        for threads in [1, 3] {
            let seen = on_threads(threads, || Ok(rayon::current_num_threads())).unwrap();
            assert_eq!(seen, threads);
        }
        let within = || on_threads(7, || Ok(rayon::current_num_threads()));
        assert_eq!(on_threads(2, within).unwrap(), 2);
    }
}
