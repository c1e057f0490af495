//! Return of freed memory to the system.
#![allow(unsafe_code)]

/// Blocks of at least this many bytes return to the system when they are freed.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const RETURNED: libc::c_int = 256 << 10;

/// Keeps the resident memory of the process close to its use. By default glibc raises the threshold for
/// returned blocks with every freed block, up to 32 MiB, and caches smaller ones per thread: a job within its
/// budget would still exceed it as seen from outside.
pub(super) fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: mallopt only sets a parameter of the allocator, under its lock; any value is allowed.
    let _set = unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, RETURNED) };
}
