//! Files held whole in a small part of the memory: datum shift grids and geoid models.

use std::path::Path;

use crate::Resources;
use crate::memory::short;
use terrane_base::error::Result;
use terrane_files::RawFile;

/// Maximum size of a shift grid or geoid model, as a fraction 1/`SHARE` of the memory.
pub const SHARE: u64 = 8;

/// Reads a file that must fit into a small part of the memory.
pub fn read(path: &Path, resources: &Resources) -> Result<Vec<u8>> {
    let file = RawFile::open(path).map_err(|e| e.remedy("check the name"))?;
    check_memory(file.size(), resources.memory).map_err(|e| e.in_file(path))?;
    file.read_vec(0, file.size())
}

/// Fails if a file held in memory leaves too little for the rest.
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
