//! System calls of the store, and its only unsafe code: mapping a file, releasing mapped pages, and querying
//! free disk space.
//!
//! Remaining risk: another program truncates or rewrites a mapped file in place. Reading a page beyond the new
//! end kills the process with SIGBUS, and rewritten samples become visible. Only files that carry the mark of a
//! store and match their directory in every byte are mapped, and terrane never changes a store in place:
//! writers rename a complete file over it, which leaves existing mappings intact.
#![allow(unsafe_code)]

use std::fs::File;
use std::io;
use std::ops::{Deref, Range};

use memmap2::Mmap;

/// A whole file, mapped for reading.
#[derive(Debug)]
pub(super) struct MappedFile(Mmap);

impl MappedFile {
    /// Maps `file`, a store whose length was checked against its directory.
    pub(super) fn new(file: &File) -> io::Result<Self> {
        // SAFETY: the map is private to this module, read-only, and handed out as plain bytes only.
        // That the file does not shrink or change while it lives rests on the rule above.
        let map = unsafe { Mmap::map(file)? };
        Ok(Self(map))
    }

    /// Releases the pages of `range` (inside the mapping); they are read again on access.
    pub(super) fn release(&self, range: Range<usize>) {
        #[cfg(unix)]
        if range.end <= self.0.len() && range.start < range.end {
            let (start, len) = (range.start, range.len());
            // SAFETY: the map is file-backed, shared and read-only, so that dropping pages changes
            // no byte anyone can see: the next access reads the file again. The range is inside.
            let advised = unsafe {
                self.0.unchecked_advise_range(memmap2::UncheckedAdvice::DontNeed, start, len)
            };
            debug_assert!(advised.is_ok(), "{advised:?}");
        }
    }

    /// Prefetches the pages of `range`. A hint: failure costs time only.
    pub(super) fn want(&self, range: Range<usize>) {
        #[cfg(unix)]
        if range.end <= self.0.len() {
            let _ = self.0.advise_range(memmap2::Advice::WillNeed, range.start, range.len());
        }
    }
}

impl Deref for MappedFile {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}

/// Sets the length of `file` after a check of the disk space, so that a full disk is detected before the
/// work. The space is not reserved: writing into reserved extents takes about twice as long (measured on
/// ext4), and if others fill the disk meanwhile, the write fails.
pub(super) fn set_length(file: &File, length: u64) -> io::Result<()> {
    check_free_space(file, length)?;
    file.set_len(length)
}

/// Fails if the disk of `file` is known to have less than `bytes` free.
#[cfg(target_os = "linux")]
pub(super) fn check_free_space(file: &File, bytes: u64) -> io::Result<()> {
    match free_space(file)? {
        free if free < bytes => Err(io::Error::from_raw_os_error(libc::ENOSPC)),
        _ => Ok(()),
    }
}

/// On other systems a full disk is detected by the write.
#[cfg(not(target_os = "linux"))]
pub(super) fn check_free_space(_file: &File, _bytes: u64) -> io::Result<()> {
    Ok(())
}

/// Free space of the disk of `file` in bytes.
#[cfg(target_os = "linux")]
fn free_space(file: &File) -> io::Result<u64> {
    let mut facts = std::mem::MaybeUninit::<libc::statvfs>::uninit();
    let descriptor = std::os::fd::AsRawFd::as_raw_fd(file);
    // SAFETY: `facts` is room for one statvfs, which the call fills when it returns 0.
    if unsafe { libc::fstatvfs(descriptor, facts.as_mut_ptr()) } != 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the call returned 0, so `facts` is filled.
    let facts = unsafe { facts.assume_init() };
    Ok(facts.f_bavail.saturating_mul(facts.f_frsize))
}
