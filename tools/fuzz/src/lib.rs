//! Bytes from a fuzzer as files on disk, read as terrane reads the files of others.

#[path = "../../../tests/common/raster_support/attempt.rs"]
mod attempt;
pub mod line;
pub mod vector;

use std::path::Path;

/// Bytes of the smallest SRTM tile: 601 x 1201 samples of two.
const TILE_BYTES: usize = 601 * 1201 * 2;

/// Reads `data` as the file `name`.
pub fn read(name: &str, data: &[u8]) {
    read_files(&[(name, data)]);
}

/// Reads `data` as the file `name`, with the text before the first zero byte, if there is any, as
/// the file `beside` it.
pub fn read_pair(name: &str, beside: &str, data: &[u8]) {
    let end = data.iter().position(|byte| *byte == 0).unwrap_or(data.len());
    let (text, grid) = (&data[..end], data.get(end + 1..).unwrap_or_default());
    match text {
        [] => read_files(&[(name, grid)]),
        text => read_files(&[(name, grid), (beside, text)]),
    }
}

/// Reads the text before the first zero byte of `data` as the file `name`, with what follows that
/// byte as the file `beside` it, which the text may name.
pub fn read_mosaic(name: &str, beside: &str, data: &[u8]) {
    let end = data.iter().position(|byte| *byte == 0).unwrap_or(data.len());
    let (text, grid) = (&data[..end], data.get(end + 1..).unwrap_or_default());
    read_files(&[(name, text), (beside, grid)]);
}

/// Reads `data` as a tile: its length is nearly all that can be wrong, so shorter data is filled up
/// unless it begins with a zero byte.
pub fn read_tile(name: &str, data: &[u8]) {
    let mut tile = data.to_vec();
    if data.first().is_some_and(|byte| *byte != 0) {
        tile.resize(TILE_BYTES.max(data.len()), 7);
    }
    read(name, &tile);
}

/// Writes the files and reads the first. Any answer will do and so will an error of one line; panics
/// and hangs are what the fuzzer looks for.
fn read_files(files: &[(&str, &[u8])]) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).expect("a temporary file");
    }
    if let Err(error) = attempt::attempt(&folder.path().join(Path::new(files[0].0))) {
        assert!(!error.to_string().contains('\n'), "more than one line: {error}");
    }
}
