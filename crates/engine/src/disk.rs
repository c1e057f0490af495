//! Room on disk, looked at before it is needed.

use std::path::Path;

use terrane_base::error::{Error, ErrorKind, Result};

/// Fails when the file system of `folder` has less than about `needed` bytes free.
pub fn check(folder: &Path, needed: u64) -> Result<()> {
    match free(folder) {
        Some(free) if free < needed => Err(Error::new(
            ErrorKind::CannotWrite,
            format!("about {} MiB of disk are needed, {} MiB are free", needed >> 20, free >> 20),
        )
        .in_file(folder)
        .remedy("free some space, or choose another folder")),
        _ => Ok(()),
    }
}

/// True when both folders are known to be on one file system.
pub fn are_one(a: &Path, b: &Path) -> bool {
    device(a).is_some_and(|device_of_a| device(b) == Some(device_of_a))
}

#[cfg(unix)]
fn device(folder: &Path) -> Option<u64> {
    std::fs::metadata(folder).ok().map(|meta| std::os::unix::fs::MetadataExt::dev(&meta))
}

#[cfg(not(unix))]
fn device(_folder: &Path) -> Option<u64> {
    None
}

/// Bytes that may still be written there, where the system tells.
#[cfg(unix)]
fn free(folder: &Path) -> Option<u64> {
    let stat = rustix::fs::statvfs(folder).ok()?;
    Some(stat.f_bavail.saturating_mul(stat.f_frsize))
}

#[cfg(not(unix))]
fn free(_folder: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_there_is_is_refused() {
        assert!(check(Path::new("."), 1).is_ok());
        #[cfg(unix)]
        assert_eq!(check(Path::new("."), u64::MAX).unwrap_err().kind(), ErrorKind::CannotWrite);
    }
}
