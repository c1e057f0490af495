//! SRTM tiles and ESRI ASCII grids: values, georeference, damage.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::raster_support::{open_band, read_all, read_in_windows, same};
use terrane_base::geom::Rect;
use terrane_raster::{GridOpenOptions, SampleType, open};

const SIDE: usize = 1201;

fn tile() -> Vec<u8> {
    let sample = |i: usize| if i == 5 { i16::MIN } else { (i % 2000) as i16 - 100 };
    (0..SIDE * SIDE).flat_map(|i| sample(i).to_be_bytes()).collect()
}

fn zipped(name: &str, bytes: &[u8]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(bytes).unwrap();
    zip.finish().unwrap().into_inner()
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn refusal(path: &Path) -> String {
    match open_band(path, 1) {
        Err(error) => error.to_string(),
        Ok(source) => panic!("opened: {:?}", source.info()),
    }
}

#[test]
fn a_tile_plain_and_zipped() {
    let folder = tempfile::tempdir().unwrap();
    let plain = write(folder.path(), "S02W010.hgt", &tile());
    let zip = write(folder.path(), "any.hgt.zip", &zipped("S02W010.hgt", &tile()));
    for path in [plain, zip] {
        let source = open_band(&path, 1).unwrap();
        let info = source.info();
        assert_eq!((info.width, info.height, info.sample_type), (1201, 1201, SampleType::I16));
        assert_eq!(info.transform.apply(0.0, 0.0), [-10.0, -1.0]);
        let [x, y] = info.transform.apply(1200.0, 1200.0);
        assert!((x + 9.0).abs() < 1e-12 && (y + 2.0).abs() < 1e-12);
        assert_eq!(info.crs.epsg, Some(4326));
        let heights = read_all(source.as_ref()).unwrap();
        assert!(heights[5].is_nan());
        assert_eq!((heights[4], heights[6], heights[SIDE]), (-96.0, -94.0, 1101.0));
        let narrow = read_in_windows(source.as_ref(), 500).unwrap();
        assert!(narrow.iter().zip(&heights).all(|(n, h)| same(f64::from(*n), *h)));
    }
}

#[test]
fn an_unnamed_tile_has_no_place() {
    let folder = tempfile::tempdir().unwrap();
    let source = open_band(&write(folder.path(), "hill.hgt", &tile()), 1).unwrap();
    assert!(!source.info().georeferenced);
}

#[test]
fn zip_bombs_and_wrong_archives_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bomb = zipped("N00E000.hgt", &vec![0; 40 << 20]);
    assert!(
        refusal(&write(folder.path(), "a.hgt.zip", &bomb)).contains("does not match an SRTM tile")
    );
    let other = zipped("readme.txt", b"hello");
    assert!(refusal(&write(folder.path(), "b.hgt.zip", &other)).contains("lacks x, y or z"));
    // A directory that claims the length of a tile for an entry that is longer.
    let mut liar = zipped("N00E000.hgt", &vec![0; 4 << 20]);
    let claimed = (2 * SIDE as u32 * SIDE as u32).to_le_bytes();
    for i in 0..liar.len() - 4 {
        if liar[i..i + 4] == (4_u32 << 20).to_le_bytes() {
            liar[i..i + 4].copy_from_slice(&claimed);
        }
    }
    assert!(refusal(&write(folder.path(), "c.hgt.zip", &liar)).contains("damaged zip"));
    let mut cut = zipped("N00E000.hgt", &tile());
    cut.truncate(cut.len() / 2);
    assert!(refusal(&write(folder.path(), "d.hgt.zip", &cut)).contains("damaged zip"));
}

#[test]
fn text_grids_of_all_manners() {
    let folder = tempfile::tempdir().unwrap();
    let check = |text: &str, kind: SampleType, origin: [f64; 2], heights: &[f64]| {
        let source = open_band(&write(folder.path(), "t.asc", text.as_bytes()), 1).unwrap();
        assert_eq!(source.info().sample_type, kind, "{text}");
        assert_eq!(source.info().transform.apply(0.0, 0.0), origin, "{text}");
        let read = read_all(source.as_ref()).unwrap();
        assert!(read.iter().zip(heights).all(|(a, b)| same(*a, *b)), "{text}: {read:?}");
        assert_eq!(read.len(), heights.len());
    };
    const VOID: f64 = f64::NAN;
    check(
        "ncols 2\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 4\nNODATA_value -9\n1 2\n-9 4\n",
        SampleType::I16,
        [12.0, 26.0],
        &[1.0, 2.0, VOID, 4.0],
    );
    check(
        "NROWS 2\r\nNCOLS 1\r\nXLLCENTER 10\r\nYLLCENTER 20\r\nDX 4\r\nDY 2\r\n100000\r\n7",
        SampleType::I32,
        [10.0, 22.0],
        &[100_000.0, 7.0],
    );
    check(
        "\u{feff}ncols 3 nrows 1 xllcorner 0 yllcorner 0 cellsize 2 nan\n0.5\n1.#QNAN\n",
        SampleType::F32,
        [1.0, 1.0],
        &[VOID, 0.5, VOID],
    );
}

#[test]
fn damaged_text_grids_name_the_line() {
    let folder = tempfile::tempdir().unwrap();
    let header = "ncols 2\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 4\n";
    let check = |text: String, expected: &str| {
        let error = refusal(&write(folder.path(), "t.asc", text.as_bytes()));
        assert!(error.contains(expected), "{error}");
    };
    check(format!("{header}1 2\n3 x4\n"), "line 7: \"x4\" is not a number");
    check(format!("{header}10 20\n30\n"), "line 8: file is truncated: found 3 of 4 values");
    check(format!("{header}1 2\n3 4\n5\n"), "line 8: more values than the 4 declared");
    check(header.replace("nrows 2", "nrows 1000000000") + "1", "file is truncated");
    check(header.replace("nrows 2", "nrows 2000000000") + "1", "exceeds the limit");
    check(header.replace("nrows 2", "nrows 1.5") + "1", "expected a positive integer");
    check(header.replace("nrows 2", "") + "1", "header lacks nrows");
    check(header.replace("cellsize 4", "cellsize 0") + "1", "invalid cell size");
    check(header.replace("cellsize 4", "cellsize"), "line 6: cellsize is not followed by a number");
    check(header.to_owned(), "ends inside the header");
    check(format!("{header}{}", "1".repeat(400)), "too long");
    check(format!("{header}1 2\n3 6e999\n"), "line 7: \"6e999\" is not a number");
    check(format!("{header}1 2\n3 \"4\n"), "line 7: \"\\\"4\" is not a number");
    check(
        header.replace("nrows 2", "ncols 3\nnrows 2") + "1 2\n3 4\n",
        "conflicting values of ncols",
    );
}

#[test]
fn rows_that_are_lines_are_so_all_along() {
    let folder = tempfile::tempdir().unwrap();
    let header = "ncols 3\nnrows 4\nxllcorner 10\nyllcorner 20\ncellsize 4\n";
    let write = |lines: &str| write(folder.path(), "t.asc", format!("{header}{lines}").as_bytes());
    for (lines, place) in [
        ("1 2 3\n4 5\n6 7 8 9\n10 11 12\n", "line 7"),
        ("1 2 3\n4 5 6 7\n8 9\n10 11 12\n", "line 7"),
        ("1 2 3\n4 5 6\n7 8 9\n10 1\r1\n", "line 9"),
        ("1 2 3\n4 5 6\n7 8\r9\n10 11 12\n", "line 8"),
    ] {
        let told = refusal(&write(lines));
        assert!(told.contains(place) && told.contains("than the first line"), "{told}");
    }
    let count: Vec<f64> = (1..13).map(f64::from).collect();
    for lines in [
        "1 2 3\n4 5 6\n7 8 9\n10 11 12\n",
        "1 2 3\r\n\r\n4 5 6\r\n7 8 9\r\n10 11 12",
        "1 2 3\r4 5 6\r7 8 9\r10 11 12\r",
        "1 2 3 4 5 6 7 8 9 10 11 12",
        "1 2\n3 4\n5 6\n7 8\n9 10\n11 12\n",
        "1 2 3 4\n5 6 7 8\n9 10 11 12\n",
        "1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n11\n12\n",
    ] {
        let grid = open_band(&write(lines), 1).unwrap_or_else(|e| panic!("{lines:?}: {e}"));
        assert_eq!(read_all(grid.as_ref()).unwrap(), count, "{lines:?}");
    }
    let grid = open_band(&write("1 2 3\n4 5 1e39\n7 8 9\n-3e300 11 1.5\n"), 1).unwrap();
    let found = read_all(grid.as_ref()).unwrap();
    assert_eq!((found[5], found[9], found[11]), (1e39, -3e300, 1.5));
}

/// Many blocks of rows, read backwards in small windows within a cache of two blocks.
#[test]
fn a_text_grid_is_read_out_of_core() {
    const WIDTH: u32 = 700;
    const HEIGHT: u32 = 600;
    let folder = tempfile::tempdir().unwrap();
    let mut text = format!("ncols {WIDTH}\nnrows {HEIGHT}\nxllcorner 0\nyllcorner 0\ncellsize 1\n");
    for i in 0..WIDTH * HEIGHT {
        text += &format!("{}.5{}", i % 10_007, if i % 13 == 0 { '\n' } else { ' ' });
    }
    let path = write(folder.path(), "big.asc", text.as_bytes());
    let options = GridOpenOptions { cache_bytes: 600 << 10, ..GridOpenOptions::default() };
    let source = open(path.to_str().unwrap(), &options).unwrap();
    let rows = source.info().block.1;
    assert!(rows < HEIGHT / 4, "blocks of {rows} rows");
    for row in (0..HEIGHT - 3).rev().step_by(41) {
        let rect = Rect::new(600, row, 100, 3);
        let mut out = vec![0.0; rect.len()];
        source.read_f32(rect, &mut out).unwrap();
        let expected = ((row + 2) * WIDTH + 699) % 10_007;
        assert_eq!(out[299], expected as f32 + 0.5);
        source.release(rect);
    }
    let tight = GridOpenOptions { cache_bytes: 1000, ..GridOpenOptions::default() };
    assert!(open(path.to_str().unwrap(), &tight).is_err());
}

#[test]
fn a_prj_beside_the_grid_gives_the_crs() {
    let folder = tempfile::tempdir().unwrap();
    let text = "ncols 1\nnrows 1\nxllcorner 10\nyllcorner 20\ncellsize 4\n5\n";
    let path = write(folder.path(), "t.asc", text.as_bytes());
    assert!(open_band(&path, 1).unwrap().info().crs.is_unknown());
    let wkt = r#"PROJCS["WGS 84 / UTM zone 31N",AUTHORITY["EPSG","32631"]]"#;
    write(folder.path(), "t.prj", wkt.as_bytes());
    let source = open_band(&path, 1).unwrap();
    assert_eq!(source.info().crs.epsg, Some(32631));
    assert_eq!(source.info().crs.wkt.as_deref(), Some(wkt));
}
