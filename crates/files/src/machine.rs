//! What this machine has. To ask the system takes as long as a small mesh, so it is asked once.

use std::num::NonZero;
use std::sync::OnceLock;

/// Cores that the process may use.
pub fn cores() -> usize {
    static CORES: OnceLock<usize> = OnceLock::new();
    *CORES.get_or_init(|| std::thread::available_parallelism().map_or(1, NonZero::get))
}

/// Bytes of memory, where the system tells.
pub fn physical_memory() -> Option<u64> {
    static MEMORY: OnceLock<Option<u64>> = OnceLock::new();
    *MEMORY.get_or_init(|| proc_bytes("/proc/meminfo", "MemTotal:"))
}

/// The bytes that a line of a file of the system tells in KiB.
pub fn proc_bytes(file: &str, key: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find(|line| line.starts_with(key))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}
