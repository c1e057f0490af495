//! Masks of GeoTIFFs: internal ones, `.msk` files and alpha bands make voids, or are refused.

use std::path::{Path, PathBuf};

use crate::raster_support::tiff_builder::{Spec, Value};
use crate::raster_support::{self, open_band, read_all, read_in_windows};
use terrane::ErrorKind;
use terrane_engine::{Cancel, Silent};
use terrane_raster::{GridOpenOptions, open};
use terrane_terrain::convert::{self, ConvertJob};

const WIDTH: usize = 37;
const HEIGHT: usize = 21;

fn ramp(col: usize, row: usize, band: usize) -> f64 {
    (1 + col + WIDTH * row + 1000 * band) as f64
}

/// Which samples are kept: none of the last column, and about two of three others.
fn kept(col: usize, row: usize, band: usize) -> f64 {
    f64::from(u8::from(!(col * 7 + row * 5 + band).is_multiple_of(3) && col + 1 < WIDTH))
}

/// A mask of `bits` bits, of the kind that NewSubfileType `kind` says.
fn mask(bits: usize, kind: u16) -> Spec {
    let mut spec = Spec::new(WIDTH, HEIGHT, 1, bits);
    spec.extra = vec![(254, Value::Short(vec![kind])), (262, Value::Short(vec![4]))];
    spec
}

fn put(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    raster_support::write_anew(&path, bytes);
    path
}

/// Heights are those of the ramp where kept, and void elsewhere, in any window.
fn assert_masked(path: &Path, band: u32, what: &str) {
    let source = open_band(path, band).unwrap_or_else(|e| panic!("{what}: {e}"));
    let heights = read_all(source.as_ref()).unwrap();
    let narrow = read_in_windows(source.as_ref(), 10).unwrap();
    let band = band as usize - 1;
    for (i, (height, narrow)) in heights.iter().zip(narrow).enumerate() {
        let (col, row) = (i % WIDTH, i / WIDTH);
        let expected = if kept(col, row, 0) > 0.0 { ramp(col, row, band) } else { f64::NAN };
        let same = raster_support::same(*height, expected);
        assert!(same && raster_support::same(narrow.into(), expected), "{what}: {col}, {row}");
    }
}

fn details(path: &Path, name: &str) -> Vec<String> {
    let source = open_band(path, 1).unwrap();
    let details = source.info().details.iter().filter(|d| d.0 == name);
    details.map(|d| d.1.clone()).collect()
}

#[test]
fn internal_masks_of_every_kind_make_voids() {
    let folder = tempfile::tempdir().unwrap();
    for compression in [1, 5, 8, 32773, 50000] {
        for bits in [1, 8] {
            for (tile, big) in [(None, false), (Some((16, 16)), true)] {
                let mut spec = Spec::new(WIDTH, HEIGHT, 2, 16);
                (spec.tile, spec.big_tiff, spec.big_endian, spec.bands) = (tile, big, big, 2);
                let mut mask = mask(bits, 4);
                (mask.tile, mask.big_tiff, mask.big_endian) = (tile, big, big);
                mask.compression = compression;
                let mut bytes = spec.build(ramp);
                mask.append(&mut bytes, &kept);
                let path = put(folder.path(), "m.tif", &bytes);
                for band in [1, 2] {
                    assert_masked(&path, band, &format!("{compression} {bits} {tile:?}"));
                }
                assert_eq!(details(&path, "mask"), ["internal"]);
            }
        }
    }
}

#[test]
fn overviews_and_masks_of_overviews_are_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = Spec::new(WIDTH, HEIGHT, 2, 16).build(ramp);
    for kind in [1, 5] {
        let mut small = Spec::new(9, 5, 1, 8);
        small.extra = vec![(254, Value::Short(vec![kind]))];
        small.append(&mut bytes, &|_, _, _| 0.0);
    }
    let path = put(folder.path(), "o.tif", &bytes);
    assert!(details(&path, "mask").is_empty());
    mask(1, 4).append(&mut bytes, &kept);
    assert_masked(&put(folder.path(), "o.tif", &bytes), 1, "after overviews");
}

#[test]
fn a_mask_that_was_never_written_voids_everything() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = Spec::new(WIDTH, HEIGHT, 2, 16).build(ramp);
    let mut mask = mask(1, 4);
    mask.sparse = vec![0, 1, 2];
    mask.append(&mut bytes, &kept);
    let source = open_band(&put(folder.path(), "s.tif", &bytes), 1).unwrap();
    assert!(read_all(source.as_ref()).unwrap().iter().all(|z| z.is_nan()));
}

#[test]
fn masks_beside_the_file_make_voids_even_beside_a_store() {
    let folder = tempfile::tempdir().unwrap();
    let path = put(folder.path(), "b.tif", &Spec::new(WIDTH, HEIGHT, 2, 16).build(ramp));
    let store = folder.path().join("c.tif");
    let job = ConvertJob::new(path.to_str().unwrap(), &store);
    convert::run(&job, &Silent, &Cancel::default()).unwrap();
    let mut beside = mask(8, 0);
    beside.compression = 8;
    let bytes = beside.build(kept);
    put(folder.path(), "b.tif.msk", &bytes);
    put(folder.path(), "c.tif.msk", &bytes);
    assert_masked(&path, 1, "beside");
    assert_masked(&store, 1, "beside a store");
    assert_eq!(details(&path, "mask"), ["b.tif.msk"]);
    let again = job.with(|options| {
        options.file.replacing.overwrite = true;
    });
    let error = convert::run(&again, &Silent, &Cancel::default()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::CannotWrite);
    assert!(error.to_string().contains("c.tif.msk: mask of an earlier file"), "{error}");
    put(folder.path(), "b.tif.msk", b"hello");
    let error = open_band(&path, 1).err().unwrap().to_string();
    assert!(error.contains("b.tif.msk: is not a TIFF"), "{error}");
}

#[test]
fn a_mask_beside_other_formats_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let text = b"ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 4\n";
    let path = put(folder.path(), "a.asc", text);
    assert!(open_band(&path, 1).is_ok());
    put(folder.path(), "a.asc.msk", &mask(8, 0).build(kept));
    let error = open_band(&path, 1).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    let text = error.to_string();
    assert!(text.contains("a.asc.msk") && text.contains("gdal_translate"), "{text}");
}

#[test]
fn a_band_for_each_band_in_a_mask_beside_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut spec = Spec::new(WIDTH, HEIGHT, 2, 16);
    spec.bands = 2;
    let path = put(folder.path(), "n.tif", &spec.build(ramp));
    let mut beside = mask(1, 0);
    beside.bands = 2;
    put(
        folder.path(),
        "n.tif.msk",
        &beside.build(|c, r, b| if b == 1 { kept(c, r, 0) } else { 1.0 }),
    );
    assert_masked(&path, 2, "second of two");
    let first = read_all(open_band(&path, 1).unwrap().as_ref()).unwrap();
    assert!(first.iter().all(|z| !z.is_nan()));
}

#[test]
fn an_alpha_band_makes_voids_of_the_others() {
    let folder = tempfile::tempdir().unwrap();
    for (format, bits) in [(1, 16), (2, 16), (3, 32)] {
        for (kind, separate, compression) in [(1, false, 8), (2, true, 1), (2, false, 50000)] {
            let mut spec = Spec::new(WIDTH, HEIGHT, format, bits);
            (spec.bands, spec.separate, spec.compression) = (3, separate, compression);
            spec.extra = vec![(338, Value::Short(vec![0, kind]))];
            let value = |c, r, b| if b == 2 { 255.0 * kept(c, r, 0) } else { ramp(c, r, b) };
            let path = put(folder.path(), "a.tif", &spec.build(value));
            assert_masked(&path, 1, "alpha");
            assert_masked(&path, 2, "alpha");
            assert_eq!(details(&path, "mask"), ["alpha (band 3)"]);
            let alpha = read_all(open_band(&path, 3).unwrap().as_ref()).unwrap();
            assert!(alpha.iter().all(|z| !z.is_nan()));
        }
    }
    let mut spec = Spec::new(WIDTH, HEIGHT, 1, 8);
    (spec.bands, spec.extra) = (2, vec![(338, Value::Short(vec![0]))]);
    let source = open_band(&put(folder.path(), "a.tif", &spec.build(|_, _, _| 0.0)), 1).unwrap();
    assert!(read_all(source.as_ref()).unwrap().iter().all(|z| *z == 0.0), "not declared alpha");
}

#[test]
fn masks_that_are_not_supported_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |mask: &Spec, words: &[&str]| {
        let mut bytes = Spec::new(WIDTH, HEIGHT, 2, 16).build(ramp);
        mask.append(&mut bytes, &|_, _, _| 0.0);
        let error = open_band(&put(folder.path(), "r.tif", &bytes), 1).err().unwrap();
        assert_eq!(error.kind(), ErrorKind::Unsupported);
        let text = error.to_string();
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
        assert!(text.contains("is not supported") && text.contains("gdal_translate"), "{text}");
    };
    refused(&mask(16, 4), &["internal mask", "16 bits"]);
    let fax = Spec { compression: 4, ..mask(1, 4) };
    refused(&fax, &["internal mask", "CCITT group 4"]);
    let small = Spec { width: 5, ..mask(1, 4) };
    refused(&small, &["internal mask", "5 x 21", "37 x 21"]);
}

#[test]
fn a_damaged_second_directory_is_an_error_and_a_ring_ends() {
    let folder = tempfile::tempdir().unwrap();
    let image = Spec::new(WIDTH, HEIGHT, 2, 16).build(ramp);
    let mut beyond = image.clone();
    let end = beyond.len();
    beyond[end - 4..].copy_from_slice(&(end as u32 + 7).to_le_bytes());
    let error = open_band(&put(folder.path(), "d.tif", &beyond), 1).err().unwrap().to_string();
    assert!(error.contains("directory at offset") && error.contains("truncated"), "{error}");
    let mut ring = image.clone();
    let first: [u8; 4] = ring[4..8].try_into().unwrap();
    ring[end - 4..].copy_from_slice(&first);
    assert!(open_band(&put(folder.path(), "d.tif", &ring), 1).is_ok());
    assert!(open_band(&put(folder.path(), "d.tif", &image[..end - 4]), 1).is_ok());
}

#[test]
fn blocks_of_masks_keep_to_the_cache() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = Spec::new(WIDTH, HEIGHT, 2, 16).build(ramp);
    let mut mask = mask(1, 4);
    mask.rows_per_strip = HEIGHT;
    mask.append(&mut bytes, &kept);
    let path = put(folder.path(), "c.tif", &bytes);
    let with = |cache_bytes| GridOpenOptions { cache_bytes, ..GridOpenOptions::default() };
    let error = open(path.to_str().unwrap(), &with(3 * WIDTH * HEIGHT - 1)).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::Resource);
    let source = open(path.to_str().unwrap(), &with(3 * WIDTH * HEIGHT)).unwrap();
    source.release(source.info().bounds());
    assert!(read_all(source.as_ref()).unwrap()[0].is_nan());
}

#[test]
fn a_masked_grid_of_integers_needs_a_nodata_value_to_be_converted() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = Spec::new(WIDTH, HEIGHT, 2, 16).build(ramp);
    mask(1, 4).append(&mut bytes, &kept);
    let path = put(folder.path(), "g.tif", &bytes);
    let store = folder.path().join("s.tif");
    let mut job = ConvertJob::new(path.to_str().unwrap(), &store);
    let error = convert::run(&job, &Silent, &Cancel::default()).unwrap_err().to_string();
    assert!(error.contains("‹nodata›"), "{error}");
    job.options.grid.nodata = Some(-9999.0);
    convert::run(&job, &Silent, &Cancel::default()).unwrap();
    assert_masked(&store, 1, "converted");
}
