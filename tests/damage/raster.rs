//! Damaged files and header lies: a right answer or an error, in bounded memory, never a panic.

use std::path::Path;

use crate::data;
use crate::raster_support::hostile::{MAX_MEMORY, guarded};
use crate::raster_support::{crc, open_band};

const TABLE: &str = include_str!("hostile.tsv");
fn check_row(folder: &Path, row: &[&str]) -> std::result::Result<(), String> {
    match (guarded(&folder.join(row[0]))?, row[1]) {
        (Ok(heights), "=") if crc(&heights) == row[2] => Ok(()),
        (Err(error), "!") if error.to_string().contains(row[2]) => {
            let text = error.to_string();
            if text.contains('\n') { Err(format!("more than one line: {text}")) } else { Ok(()) }
        }
        (Ok(heights), _) => Err(format!("read, checksum {}", crc(&heights))),
        (Err(error), _) => Err(error.to_string()),
    }
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn every_damaged_file_of_the_corpus() {
    let folder = data::at("");
    let rows = TABLE.lines().filter(|line| !line.starts_with('#'));
    let rows: Vec<Vec<&str>> = rows.map(|line| line.split('\t').collect()).collect();
    let mut failures = Vec::new();
    for row in &rows {
        if let Err(why) = check_row(&folder, row) {
            failures.push(format!("{}: {why}", row[0]));
        }
    }
    for part in ["malformed/tiff", "malformed/grid"] {
        for entry in std::fs::read_dir(folder.join(part)).unwrap() {
            let name = format!("{part}/{}", entry.unwrap().file_name().to_string_lossy());
            if !rows.iter().any(|row| row[0] == name) {
                failures.push(format!("{name} is not in the table"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(rows.len() > 50, "only {} files", rows.len());
    assert!(terrane_engine::peak_memory().is_none_or(|bytes| bytes < MAX_MEMORY));
}

#[test]
fn things_that_are_no_rasters() {
    let folder = tempfile::tempdir().unwrap();
    let check = |name: &str, bytes: Option<&[u8]>, expected: &str| {
        let path = folder.path().join(name);
        if let Some(bytes) = bytes {
            std::fs::write(&path, bytes).unwrap();
        }
        let Err(error) = open_band(&path, 1) else { panic!("{name} was opened") };
        let text = error.to_string();
        assert!(text.contains(expected) && !text.contains('\n'), "{name}: {text}");
    };
    check("missing.tif", None, "No such file");
    check("", None, "is not a file");
    check("empty.tif", Some(b""), "file is empty");
    check("note.md", Some(b"hello"), "terrane reads GeoTIFF (.tif, ");
    check("note.tif", Some(b"hello"), "is not a TIFF");
    check("short.tif", Some(b"II*\0"), "header is not complete");
    check("odd.hgt", Some(b"hello"), "5 bytes does not match an SRTM tile");
    check("odd.hgt.zip", Some(b"PK\x03\x04nonsense"), "damaged zip archive");
    check(
        "note.asc",
        Some(b"hello world"),
        "line 1: \"hello\" is neither a header key nor a number",
    );
}
