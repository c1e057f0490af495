//! Damaged files and header lies: a right answer or an error, in bounded memory, never a panic.

mod raster_support;

use std::path::Path;

use raster_support::mutation::{Random, guarded, mutate};
use raster_support::tiff_builder::{Spec, Value};
use raster_support::{crc, data_folder, open_band, write_anew};

const TABLE: &str = include_str!("raster_support/hostile.tsv");
/// Far below what any of the lying headers asks for.
const MOST_MEMORY: u64 = 1 << 30;

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
fn every_damaged_file_of_the_corpus() {
    let Some(folder) = data_folder() else { return };
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
    assert!(terrane::pipeline::peak_memory().is_none_or(|bytes| bytes < MOST_MEMORY));
}

fn ramp(col: usize, row: usize, band: usize) -> f64 {
    (col + 3 * row + 5 * band) as f64
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let mut seeds = Vec::new();
    for compression in [1, 5, 8, 32773, 50000] {
        for (format, bits, predictor, tiled) in [(2, 16, 2, true), (3, 32, 3, false)] {
            let mut spec = Spec::new(20, 18, format, bits);
            spec.compression = compression;
            spec.predictor = predictor;
            spec.tile = tiled.then_some((16, 16));
            spec.big_tiff = tiled;
            spec.bands = if tiled { 1 } else { 2 };
            let keys = vec![1, 1, 0, 2, 1024, 0, 1, 1, 1026, 34737, 4, 0];
            let items = r#"<Item name="S" sample="0" role="scale">0.5</Item>"#;
            spec.extra = vec![
                (33550, Value::Double(vec![1.0, 1.0, 0.0])),
                (33922, Value::Double(vec![0.0; 6])),
                (34735, Value::Short(keys)),
                (34737, Value::Text("abc|".to_owned())),
                (42112, Value::Text(items.to_owned())),
                (42113, Value::Text("-9999".to_owned())),
            ];
            seeds.push(("m.tif", spec.build(ramp)));
        }
    }
    let header = "ncols 4\nnrows 3\nxllcorner 1\nyllcorner 2\ncellsize 0.5\nNODATA_value -9\n";
    seeds.push(("m.asc", format!("{header}1 2 3 4\n5 6 7 8.5\n-9 nan 1e3 ,5\n").into_bytes()));
    seeds
}

#[test]
fn thousands_of_mutations_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut read, mut refused) = (0, 0);
    for (name, seed) in seeds() {
        let path = folder.path().join(name);
        write_anew(&path, &seed);
        assert!(matches!(guarded(&path), Ok(Ok(_))), "{name} is sound before it is damaged");
        for _ in 0..300 {
            let mut bytes = seed.clone();
            mutate(&mut bytes, &mut random);
            write_anew(&path, &bytes);
            match guarded(&path) {
                Ok(Ok(_)) => read += 1,
                Ok(Err(_)) => refused += 1,
                Err(panic) => panic!("{name}: {panic}\n{bytes:?}"),
            }
        }
    }
    assert!(read > 300 && refused > 300, "{read} read, {refused} refused");
    assert!(terrane::pipeline::peak_memory().is_none_or(|bytes| bytes < MOST_MEMORY));
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
    check("odd.hgt", Some(b"hello"), "5 bytes is not the length of an SRTM tile");
    check("odd.hgt.zip", Some(b"PK\x03\x04nonsense"), "damaged zip archive");
    check(
        "note.asc",
        Some(b"hello world"),
        "line 1: \"hello\" is neither a header key nor a number",
    );
}
