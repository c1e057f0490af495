//! USGS ASCII DEM (.dem): profiles of heights from south to north, which may start at different rows. Decoded
//! into a temporary file at opening.

mod fields;
mod header;

use std::path::Path;

use crate::format::{GridOpenOptions, RasterFormat, only_band};
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::raw;
use crate::spool::SampleSpool;
use crate::strided::{StridedGrid, StridedLayout};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Crs;
use terrane_files::RawFile;

use fields::UsgsDemFieldReader;
use header::UsgsDemHeader;

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "USGS DEM",
    extensions: &["dem"],
    about: "ASCII quadrangles with or without newlines; binary .dem with a .hdr is read as raw",
    sniff: |_| false,
    open,
};

/// Value of void samples.
const VOID: f64 = -32767.0;
/// Maximum record length with its newline, in bytes.
const MAX_RECORD: u64 = 1024 + 2;
/// Maximum offset of a profile from its position, in cells.
const SLACK: f64 = 0.05;

fn open(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    // Old global grids are raw data that ends in .dem.
    if raw::header_beside(path).is_some() && !is_text(path)? {
        return raw::open(path, options);
    }
    let grid = read(path, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(grid))
}

/// True if the file begins with text.
fn is_text(path: &Path) -> Result<bool> {
    let head = RawFile::open(path)?.head(144)?;
    Ok(head.iter().all(|byte| matches!(byte, b' '..=b'~' | b'\r' | b'\n' | b'\t')))
}

fn read(path: &Path, options: &GridOpenOptions) -> Result<StridedGrid> {
    only_band(options.band)?;
    let file = RawFile::open(path)?;
    let header = UsgsDemHeader::read(&file)?;
    let spool = SampleSpool::new(path, options.temp_dir.as_deref())?;
    let spool = unpack(&file, &header, spool)?;
    let layout = StridedLayout::columns(header.height, header.sample_type().bytes());
    StridedGrid::new(spool, info(&header, options), layout)
}

fn info(header: &UsgsDemHeader, options: &GridOpenOptions) -> GridInfo {
    let crs = Crs {
        epsg: header.epsg,
        citation: Some(header.system.clone()),
        geographic: Some(header.geographic),
        vertical_unit: Some(header.vertical_unit.to_owned()),
        vertical_unit_text: Some(
            if header.vertical_unit == "metre" { "m" } else { "ft" }.to_owned(),
        ),
        ..Crs::default()
    };
    GridInfo {
        transform: header.transform,
        georeferenced: true,
        pixel_is_point: true,
        crs,
        nodata: Some(options.nodata.unwrap_or(VOID)),
        block: (1, header.height),
        details: vec![
            ("compression".to_owned(), "none (text)".to_owned()),
            ("name".to_owned(), header.name.clone()),
            ("height resolution".to_owned(), header.resolution.to_string()),
        ],
        ..GridInfo::plain(FORMAT.name, header.width, header.height, header.sample_type())
    }
}

/// Decodes each profile into a column from north to south.
fn unpack(file: &RawFile, header: &UsgsDemHeader, mut spool: SampleSpool) -> Result<RawFile> {
    let mut fields = UsgsDemFieldReader::new(file, header.data);
    let mut column = Vec::new();
    for i in 0..header.width {
        let place = format!("profile {} of {}", i + 1, header.width);
        let heights = profile(&mut fields, header, i).map_err(|e| e.at(&place))?;
        column.clear();
        heights.iter().for_each(|height| push(&mut column, *height, header.sample_type()));
        spool.write(&column)?;
        if let Some(record) = header.record_bytes {
            fields.align(header.data, record).map_err(|e| e.at(&place))?;
        }
    }
    fields.finish(MAX_RECORD)?;
    spool.finish()
}

fn push(out: &mut Vec<u8>, height: f64, kind: SampleType) {
    match kind {
        SampleType::I16 => out.extend_from_slice(&(height as i16).to_ne_bytes()),
        _ => out.extend_from_slice(&(height as f32).to_ne_bytes()),
    }
}

/// Heights of profile `i` from north to south; void where the profile has none.
fn profile(
    fields: &mut UsgsDemFieldReader<'_>,
    header: &UsgsDemHeader,
    i: u32,
) -> Result<Vec<f64>> {
    let (_, number) = (fields.integer()?, fields.integer()?);
    if number != i64::from(i) + 1 {
        return Err(Error::bad_input(format!("profile number is {number}")));
    }
    let (rows, columns) = (fields.integer()?, fields.integer()?);
    if columns != 1 || !(0..=i64::from(header.height)).contains(&rows) {
        return Err(Error::bad_input(format!(
            "{rows} x {columns} heights declared, the grid has {} rows",
            header.height
        )));
    }
    let (x, y) = (fields.decimal()? / header.divisor, fields.decimal()? / header.divisor);
    let datum = fields.decimal()?;
    let (_, _) = (fields.decimal()?, fields.decimal()?);
    let [col, bottom] = header.transform.invert(x, y);
    if (col - f64::from(i)).abs() > SLACK {
        let [expected, _] = header.transform.apply(f64::from(i), 0.0);
        let message = format!("x is {x}, expected {expected}");
        return Err(Error::bad_input(message));
    }
    let first = bottom.round();
    if !(first < f64::from(header.height) && first - rows as f64 >= -1.0) {
        return Err(Error::bad_input(format!(
            "{rows} heights from y {y} upwards exceed the grid of {} rows",
            header.height
        )));
    }
    let mut heights = vec![VOID; header.height as usize];
    let (first, rows) = (first.max(0.0) as usize, rows as usize);
    for up in 0..rows {
        heights[first - up] = height(fields, header, datum)?;
    }
    Ok(heights)
}

fn height(fields: &mut UsgsDemFieldReader<'_>, header: &UsgsDemHeader, datum: f64) -> Result<f64> {
    let stored = fields.integer()? as f64;
    if stored == VOID {
        return Ok(VOID);
    }
    let height = stored * header.resolution + datum;
    match header.sample_type() {
        SampleType::I16 => {
            let whole = height.round();
            match (f64::from(i16::MIN)..=f64::from(i16::MAX)).contains(&whole) {
                true => Ok(whole),
                false => Err(Error::bad_input(format!("height {height} is out of range"))),
            }
        }
        _ => Ok(height),
    }
}
