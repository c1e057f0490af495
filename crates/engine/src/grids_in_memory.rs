//! Files read whole into a small part of the memory: grids of shifts, and geoids.

use std::path::Path;

use crate::Resources;
use crate::memory::short;
use terrane_base::error::Result;
use terrane_files::RawFile;

/// A grid of shifts or a geoid may take one part in so many of the memory, beside what is divided.
pub const SHARE: u64 = 8;

/// All of a file that takes a small part of the memory.
pub fn read(path: &Path, resources: &Resources) -> Result<Vec<u8>> {
    let file = RawFile::open(path).map_err(|e| e.remedy("check the name"))?;
    check_memory(file.size(), resources.memory).map_err(|e| e.in_file(path))?;
    file.read_vec(0, file.size())
}

/// Fails where a file that is held whole leaves too little memory for the rest.
pub fn check_memory(bytes: u64, memory: u64) -> Result<()> {
    let needed = bytes.saturating_mul(SHARE);
    if needed <= memory {
        return Ok(());
    }
    let message = format!(
        "needs more than 1/{SHARE} of the memory limit (it is read into memory completely)"
    );
    Err(short(message, needed))
}
