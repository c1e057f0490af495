//! How the process gives memory back to the system.
#![allow(unsafe_code)]

/// Blocks of this many bytes and more go back to the system as soon as they are freed.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const RETURNED: libc::c_int = 256 << 10;

/// Makes the process hold what it uses and little more. Without it, glibc raises the size from which
/// blocks are given back with every one that is freed, up to 32 MiB, and keeps what is smaller for
/// each thread apart: a job that holds its budget would then still exceed it as seen from outside.
pub(super) fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: mallopt only sets a parameter of the allocator, under its lock; any value is allowed.
    let _set = unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, RETURNED) };
}
