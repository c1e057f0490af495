//! Files that are not, or no longer, exactly a store must never be mapped.

use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::*;
use crate::{GridOpenOptions, synth};
use terrane_base::ErrorKind;
use terrane_base::geom::Rect;

/// A small store of a terrain, with every optional tag.
fn make(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join("a.tif");
    let source = synth::open(name, &GridOpenOptions::default()).unwrap();
    let info = source.info();
    let writer = TiledTiffWriter::create(&path, info, 256, true).unwrap();
    for row in (0..info.height).step_by(256) {
        for col in (0..info.width).step_by(256) {
            let rect = Rect::new(col, row, 256, 256).intersect(&info.bounds());
            let mut heights = vec![0.0; rect.len()];
            source.read_f32(rect, &mut heights).unwrap();
            writer.write(rect, HeightSlice::F32(&heights), &mut Vec::new()).unwrap();
        }
    }
    writer.finish().unwrap();
    path
}

/// Changes bytes in place.
fn patch(path: &Path, at: usize, bytes: &[u8]) {
    let mut file = std::fs::OpenOptions::new().write(true).open(path).unwrap();
    file.seek(SeekFrom::Start(at as u64)).unwrap();
    file.write_all(bytes).unwrap();
}

fn is_mapped(path: &Path) -> bool {
    let Some(store) = try_open(path, &GridOpenOptions::default()).unwrap() else { return false };
    let rect = store.info().bounds();
    store.read_f32(rect, &mut vec![0.0; rect.len()]).unwrap();
    true
}

#[test]
fn truncated_and_lengthened_stores_are_not_mapped() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path(), "coast,width=300,height=40");
    assert!(is_mapped(&path));
    let bytes = std::fs::read(&path).unwrap();
    let lengths = (0..5000).step_by(37).chain([4095, 4096, 4097, bytes.len() / 2, bytes.len() - 1]);
    for length in lengths {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(!is_mapped(&path), "{length}");
    }
    std::fs::write(&path, [&bytes[..], &[0]].concat()).unwrap();
    assert!(!is_mapped(&path));
}

/// Whatever byte changes: the file is refused, or it still describes itself to the last byte.
#[test]
fn no_changed_byte_of_the_front_is_overlooked() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path(), "coast,width=300,height=40");
    let bytes = std::fs::read(&path).unwrap();
    let front = bytes.len() - 2 * 256 * 64 * 4;
    let mut refused = 0;
    for at in 0..front {
        patch(&path, at, &[bytes[at] ^ [0x01, 0x80, 0xFF][at % 3]]);
        refused += usize::from(!is_mapped(&path));
        patch(&path, at, &bytes[at..=at]);
    }
    // What may change unseen: values that describe the grid (its place, CRS, nodata, names).
    assert!(refused > front * 9 / 10, "{refused} of {front}");
}

#[test]
fn directories_that_lie_about_sizes_are_refused_before_anything_is_allocated() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path(), "rough,size=40");
    let bytes = std::fs::read(&path).unwrap();
    // Every field of every entry, the number of entries and the directory's own place.
    for at in (16..16 + 8 + 20 * 18).step_by(2) {
        for lie in [u64::MAX, 1 << 63, 1 << 31, 1 << 40, 0] {
            patch(&path, at, &lie.to_le_bytes());
            is_mapped(&path);
        }
        patch(&path, at, &bytes[at..at + 8]);
    }
}

#[test]
fn a_wrong_tile_offset_is_seen_in_stores_of_one_and_of_many_tiles() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["rough,size=40", "rough,width=3000,height=100"] {
        let path = make(folder.path(), name);
        let bytes = std::fs::read(&path).unwrap();
        let tags = u64::from_le_bytes(bytes[16..24].try_into().unwrap()) as usize;
        let entries = bytes[24..24 + 20 * tags].chunks(20).zip(0..);
        let table = |tag: u16| {
            let (entry, k) = entries.clone().find(|(e, _)| e[..2] == tag.to_le_bytes()).unwrap();
            let single = entry[4] == 1;
            let place = u64::from_le_bytes(entry[12..].try_into().unwrap()) as usize;
            if single { 24 + 20 * k + 12 } else { place }
        };
        for tag in [324, 325] {
            let mut changed = bytes.clone();
            changed[table(tag) + 1] ^= 0x10;
            std::fs::write(&path, &changed).unwrap();
            assert!(!is_mapped(&path), "tag {tag} of {name}");
        }
    }
}

#[test]
fn other_files_are_left_to_others() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    for bytes in [&b""[..], b"II*\0", b"II+\0\x08\0\0\0\x10\0\0\0\0\0\0\0", &[0; 5000]] {
        std::fs::write(&path, bytes).unwrap();
        assert!(!is_mapped(&path));
    }
    assert!(!is_mapped(folder.path()));
    let error = try_open(&folder.path().join("b.tif"), &GridOpenOptions::default()).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::BadInput);
}

#[test]
fn options_apply() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path(), "integer,size=64");
    let first = try_open(&path, &GridOpenOptions::default()).unwrap().unwrap();
    let mut height = [0.0];
    first.read_f32(Rect::new(3, 3, 1, 1), &mut height).unwrap();
    let nodata = Some(f64::from(height[0]));
    let options = GridOpenOptions { nodata, ..GridOpenOptions::default() };
    let second = try_open(&path, &options).unwrap().unwrap();
    second.read_f32(Rect::new(3, 3, 1, 1), &mut height).unwrap();
    assert!(height[0].is_nan() && second.info().nodata == nodata);
    let options = GridOpenOptions { band: 2, ..GridOpenOptions::default() };
    assert_eq!(try_open(&path, &options).err().unwrap().kind(), ErrorKind::Usage);
}
