//! Checks of free disk space.

use std::path::Path;

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::folder_for;

/// Fails if the file system of `folder` has less than about `needed` bytes free.
pub fn check(folder: &Path, needed: u64) -> Result<()> {
    match free(folder) {
        Some(free) if free < needed => Err(Error::new(
            ErrorKind::CannotWrite,
            format!(
                "about {} MiB of disk space are needed, {} MiB are free",
                needed >> 20,
                free >> 20
            ),
        )
        .in_file(folder)
        .remedy("free some space, or choose another folder")),
        _ => Ok(()),
    }
}

/// Whether to check free disk space before a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DiskCheck {
    /// Check and fail early.
    #[default]
    On,
    /// Do not check.
    Off,
}

impl DiskCheck {
    /// Fails if the disks of the plan's `folder` and of `output` lack space for the pending results and the output.
    pub fn check(self, folder: &Path, output: &Path, [objects, written]: [u64; 2]) -> Result<()> {
        if self == Self::Off {
            return Ok(());
        }
        let output_folder = folder_for(output, None);
        // One file system has to hold both at once: two checks would each count its free bytes.
        // Where the system does not tell devices, the checks are apart and refuse less.
        let checked = match are_one(folder, output_folder) {
            true => check(folder, objects + written),
            false => check(folder, objects).and_then(|()| check(output_folder, written)),
        };
        checked.map_err(|error| {
            error.remedy("free some space, choose another folder, or pass ‹no_disk_check›")
        })
    }
}

/// True if both folders are known to be on one file system.
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

/// Free bytes, if the system reports them.
#[cfg(unix)]
fn free(folder: &Path) -> Option<u64> {
    let stat = rustix::fs::statvfs(folder).ok()?;
    // f_bavail leaves out the blocks reserved for root, which f_bfree counts; both are in units of
    // f_frsize, not of f_bsize (statvfs(3)).
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
