//! Every real file is read exactly as GDAL reads it, or refused with the reason.

use std::collections::BTreeSet;
use std::path::Path;

use crate::data;
use crate::raster_support::{crc, open_band, read_all, read_in_windows, same};
use terrane_raster::{GridInfo, GridSource};

const GOLDEN: &str = include_str!("golden.tsv");

fn rows() -> impl Iterator<Item = Vec<&'static str>> {
    GOLDEN.lines().filter(|line| !line.starts_with('#')).map(|line| line.split('\t').collect())
}

fn number(text: &str) -> f64 {
    text.parse().unwrap_or_else(|_| panic!("golden table: {text}"))
}

fn optional(text: &str) -> Option<f64> {
    (text != "-").then(|| number(text))
}

/// Transforms agree to a billionth of a cell.
fn same_transform(info: &GridInfo, golden: &str) -> bool {
    if golden == "-" {
        return !info.georeferenced;
    }
    let golden: Vec<f64> = golden.split(',').map(number).collect();
    let ours = info.transform.to_gdal();
    let cell = golden[1].abs();
    info.georeferenced && ours.iter().zip(&golden).all(|(a, b)| (a - b).abs() <= 1e-9 * cell)
}

fn check(source: &dyn GridSource, row: &[&str]) -> Result<(), String> {
    let [
        _,
        _,
        bands,
        width,
        height,
        kind,
        nodata,
        scale,
        offset,
        transform,
        epsg,
        point,
        valid,
        sum,
        crc32,
    ] = row
    else {
        return Err("golden table: wrong number of fields".to_owned());
    };
    let info = source.info();
    let expect = |what: &str, ok: bool| {
        if ok { Ok(()) } else { Err(format!("{what} differs: {info:?}")) }
    };
    expect("size", (info.width, info.height) == (number(width) as u32, number(height) as u32))?;
    expect("bands", info.bands == number(bands) as u32)?;
    expect("type", *kind == "*" || info.sample_type.name() == *kind)?;
    expect(
        "nodata",
        match (info.nodata, optional(nodata)) {
            (Some(a), Some(b)) => same(a, b) || a as f32 == b as f32,
            (a, b) => a.is_none() && b.is_none(),
        },
    )?;
    expect("scale", info.scale == number(scale) && info.offset == number(offset))?;
    expect("transform", same_transform(info, transform))?;
    expect("EPSG", info.crs.epsg.map(f64::from) == optional(epsg))?;
    expect("point", info.pixel_is_point == (*point == "point"))?;
    let heights = read_all(source).map_err(|e| e.to_string())?;
    let valid_heights = heights.iter().filter(|h| !h.is_nan());
    expect("valid count", valid_heights.clone().count() == number(valid) as usize)?;
    let total: f64 = valid_heights.sum();
    expect("sum", (total - number(sum)).abs() <= 1e-6 * (1.0 + number(sum).abs()))?;
    expect("checksum", crc(&heights) == *crc32)?;
    check_windows(source, &heights)
}

/// The f32 path, in windows that straddle blocks, agrees with the f64 path.
fn check_windows(source: &dyn GridSource, heights: &[f64]) -> Result<(), String> {
    let narrow = read_in_windows(source, 257).map_err(|e| e.to_string())?;
    let differs =
        narrow.iter().zip(heights).any(|(n, h)| !same(f64::from(*n), f64::from(*h as f32)));
    if differs { Err("f32 windows differ".to_owned()) } else { Ok(()) }
}

fn check_row(folder: &Path, row: &[&str]) -> Result<(), String> {
    let path = folder.join(row[0]);
    if row[1] == "!" {
        return match open_band(&path, 1) {
            Ok(_) => Err("opened, but should be refused".to_owned()),
            Err(e) if e.to_string().contains(row[2]) => Ok(()),
            Err(e) => Err(format!("wrong refusal: {e}")),
        };
    }
    let source = open_band(&path, row[1].parse().unwrap()).map_err(|e| e.to_string())?;
    check(source.as_ref(), row)
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn every_real_file_reads_as_gdal_reads_it() {
    let folder = data::at("");
    let mut failures = Vec::new();
    let mut ran = 0;
    for row in rows() {
        ran += 1;
        if let Err(why) = check_row(&folder, &row) {
            failures.push(format!("{} band {}: {why}", row[0], row[1]));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(ran > 70, "only {ran} rows");
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn no_real_file_is_missing_from_the_table() {
    let folder = data::at("");
    let known: BTreeSet<&str> = rows().map(|row| row[0]).collect();
    let mut seen = 0;
    for part in ["dem", "dem/formats"] {
        for entry in std::fs::read_dir(folder.join(part)).unwrap() {
            let name = format!("{part}/{}", entry.unwrap().file_name().to_string_lossy());
            let is_sidecar = name.ends_with(".prj") || name == "dem/formats";
            assert!(is_sidecar || known.contains(name.as_str()), "{name} has no golden row");
            seen += usize::from(!is_sidecar);
        }
    }
    assert_eq!(seen, known.len());
}
