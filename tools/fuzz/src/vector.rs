//! Files of features from bytes, read to their end.

use terrane_base::Result;
use terrane_vector::{FORMATS, VectorOpenOptions, open};

/// Reads `data` as a file of the format that the first byte picks. The next two bytes say how many of those
/// that follow are the table beside it (`.dbf`), where the format has one.
pub fn read(data: &[u8]) {
    let [format, low, high, bytes @ ..] = data else { return };
    let format = &FORMATS[usize::from(*format) % FORMATS.len()];
    let ending = format.extensions[0];
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (mut beside, mut file): (&[u8], &[u8]) = (&[], bytes);
    if ending == "shp" {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(bytes.len());
        (beside, file) = bytes.split_at(length);
    }
    let path = folder.path().join(format!("f.{ending}"));
    std::fs::write(&path, file).expect("a temporary file");
    if !beside.is_empty() {
        std::fs::write(path.with_extension("dbf"), beside).expect("a temporary file");
    }
    if let Err(error) = features(&path) {
        assert!(!error.to_string().contains('\n'), "more than one line: {error}");
    }
}

/// Reads all features.
fn features(path: &std::path::Path) -> Result<u64> {
    let mut source = open(path, &VectorOpenOptions::default())?;
    let mut count = 0;
    while source.next()?.is_some() {
        count += 1;
        assert!(!source.location().contains('\n'));
    }
    source.notes().iter().for_each(|note| assert!(!note.contains('\n')));
    Ok(count)
}
