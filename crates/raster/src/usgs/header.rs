//! The first record (type A) of a USGS DEM: fields at fixed columns.

use super::fields::{UsgsDemFieldReader, decimal};
use crate::grid::SampleType;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, wkt};
use terrane_base::limits;
use terrane_files::RawFile;

/// Record length without a newline, in bytes.
const RECORD: u64 = 1024;
/// Offset of the profiles in the old form, whose records are not padded.
const OLD_START: u64 = 893;
const ARC_SECONDS: f64 = 3600.0;

/// Content of the header record.
pub(super) struct UsgsDemHeader {
    pub(super) name: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) transform: Affine,
    /// Divisor of positions in the file: 3600 for arc seconds.
    pub(super) divisor: f64,
    pub(super) geographic: bool,
    pub(super) epsg: Option<u32>,
    /// Name of the CRS.
    pub(super) system: String,
    pub(super) vertical_unit: &'static str,
    /// Height of one stored unit (vertical resolution).
    pub(super) resolution: f64,
    /// Offset of the first profile.
    pub(super) data: u64,
    /// Record length with its newline, if profiles are aligned to records.
    pub(super) record_bytes: Option<u64>,
}

impl UsgsDemHeader {
    pub(super) fn read(file: &RawFile) -> Result<Self> {
        let record = UsgsDemRecord(file.head(RECORD)?);
        if record.0.len() < 864 {
            return Err(Error::bad_input(format!(
                "file is truncated: {} bytes, expected a first record of 1024 bytes",
                file.size()
            )));
        }
        let (data, record_bytes) = data_start(file)?;
        let grid = UsgsDemGrid::read(&record, file, data)?;
        let datum = if record_bytes.is_some() { record.text(890, 2) } else { "1" };
        // Geographic models leave the zone blank.
        let zone = if grid.system == 0 { 0 } else { record.integer("zone", 162, 6)? };
        let (epsg, system) = system(grid.system, zone, datum);
        let vertical_unit = match record.integer("unit of heights", 534, 6)? {
            1 => "foot",
            2 => "metre",
            other => {
                return Err(Error::unsupported(format!("height unit {other} is not supported")));
            }
        };
        Ok(Self {
            name: record.text(0, 40).split_whitespace().collect::<Vec<_>>().join(" "),
            width: grid.width,
            height: grid.height,
            transform: grid.transform,
            divisor: grid.divisor,
            geographic: grid.system == 0,
            epsg,
            system,
            vertical_unit,
            resolution: grid.resolution,
            data,
            record_bytes,
        })
    }

    /// `int16` for whole metres, else `float32`, as in GDAL.
    pub(super) fn sample_type(&self) -> SampleType {
        let whole = self.vertical_unit == "metre" && self.resolution >= 1.0;
        if whole { SampleType::I16 } else { SampleType::F32 }
    }
}

/// Size and georeference.
struct UsgsDemGrid {
    /// 0 geographic, 1 UTM, 2 state plane.
    system: i64,
    width: u32,
    height: u32,
    transform: Affine,
    divisor: f64,
    resolution: f64,
}

impl UsgsDemGrid {
    fn read(record: &UsgsDemRecord, file: &RawFile, data: u64) -> Result<Self> {
        let system = record.integer("reference system", 156, 6)?;
        let (dx, dy) =
            (record.decimal("x spacing", 816, 12)?, record.decimal("y spacing", 828, 12)?);
        let resolution = record.decimal("height resolution", 840, 12)?;
        if dx <= 0.0 || dy <= 0.0 || resolution <= 0.0 {
            return Err(Error::bad_input(format!(
                "spacing {dx} x {dy} and height resolution {resolution} must be above 0"
            )));
        }
        let corner = |i: usize| record.decimal("corner", 546 + 24 * i, 24);
        let west = corner(0)?.min(corner(2)?);
        let mut south = corner(1)?.min(corner(7)?);
        let mut north = corner(3)?.max(corner(5)?);
        let geographic = system == 0;
        // Other than in degrees, the samples lie on multiples of the spacing.
        let west = if geographic { west } else { first_x(file, data)? };
        if !geographic {
            (south, north) = ((south / dy).floor() * dy, (north / dy).ceil() * dy);
        }
        let divisor = if geographic { ARC_SECONDS } else { 1.0 };
        let transform = Affine {
            x0: west / divisor,
            a: dx / divisor,
            b: 0.0,
            y0: north / divisor,
            d: 0.0,
            e: -dy / divisor,
        };
        let rows = ((north - south) / dy + 1.5).floor();
        let profiles = record.integer("number of profiles", 858, 6)?;
        if !transform.is_valid() || profiles < 1 || rows.is_nan() || rows < 1.0 {
            return Err(Error::bad_input("corners and spacing in the header do not define a grid"));
        }
        limits::check("number of rows", rows as u64, limits::MAX_SIDE)?;
        limits::check("number of profiles", profiles as u64, limits::MAX_SIDE)?;
        check_size(profiles as u64, rows as u64, file.size())?;
        let (width, height) = (profiles as u32, rows as u32);
        Ok(Self { system, width, height, transform, divisor, resolution })
    }
}

/// Checks the size of the file: a profile takes at least its 144-byte header, and a grid that is nearly all
/// void is rejected.
fn check_size(profiles: u64, rows: u64, bytes: u64) -> Result<()> {
    let least = profiles * 144;
    if least > bytes {
        return Err(Error::bad_input(format!(
            "file is truncated: {profiles} profiles need {least} bytes, found {bytes}"
        )));
    }
    limits::check("number of samples per byte of the file", profiles * rows / bytes, 1000)
}

/// x of the first profile.
fn first_x(file: &RawFile, data: u64) -> Result<f64> {
    let mut fields = UsgsDemFieldReader::new(file, data);
    for _ in 0..4 {
        fields.integer().map_err(|e| e.at("profile 1"))?;
    }
    fields.decimal().map_err(|e| e.at("profile 1"))
}

/// Offset of the first profile, and the record length unless the file has the old form.
fn data_start(file: &RawFile) -> Result<(u64, Option<u64>)> {
    if has_first_profile(file, RECORD) {
        let after = file.read_vec(RECORD, 2.min(file.size() - RECORD))?;
        let newline = after.iter().take_while(|byte| matches!(byte, b'\n' | b'\r')).count() as u64;
        return Ok((RECORD + newline, Some(RECORD + newline)));
    }
    if has_first_profile(file, OLD_START) {
        return Ok((OLD_START, None));
    }
    Err(Error::bad_input("is not a USGS DEM: no profile at byte 1024 or 893"))
}

/// True if the first profile of a file begins at `offset`, with row 1 and column 1.
fn has_first_profile(file: &RawFile, offset: u64) -> bool {
    if offset >= file.size() {
        return false;
    }
    let mut fields = UsgsDemFieldReader::new(file, offset);
    matches!((fields.integer(), fields.integer()), (Ok(1), Ok(1)))
}

/// EPSG code and name of the CRS.
fn system(system: i64, zone: i64, datum: &str) -> (Option<u32>, String) {
    // Name, name in Esri's CRS names, and code of the geographic CRS.
    let (name, datum, geographic) = match datum.trim() {
        "2" => ("WGS 72", "WGS_1972", 4322),
        "3" => ("WGS 84", "WGS_1984", 4326),
        "4" => ("NAD83", "NAD_1983", 4269),
        _ => ("NAD27", "NAD_1927", 4267),
    };
    // The zone is negative in the south.
    let number = u32::try_from(zone.unsigned_abs()).ok();
    match system {
        0 => (Some(geographic), name.to_owned()),
        1 => (
            number.and_then(|number| wkt::utm_code(datum, zone > 0, number)),
            format!("{name} / UTM zone {}{}", zone.abs(), if zone < 0 { "S" } else { "N" }),
        ),
        2 => (None, format!("{name} / state plane zone {zone}")),
        other => (None, format!("{name} / reference system {other}")),
    }
}

/// Bytes of the record.
struct UsgsDemRecord(Vec<u8>);

impl UsgsDemRecord {
    fn text(&self, offset: usize, bytes: usize) -> &str {
        let field = self.0.get(offset..self.0.len().min(offset + bytes)).unwrap_or_default();
        std::str::from_utf8(field).unwrap_or_default()
    }

    fn decimal(&self, what: &str, offset: usize, bytes: usize) -> Result<f64> {
        let text = self.text(offset, bytes);
        decimal(text.as_bytes()).ok_or_else(|| {
            Error::bad_input(format!("{what} is {:?}, expected a number", text.trim()))
        })
    }

    fn integer(&self, what: &str, offset: usize, bytes: usize) -> Result<i64> {
        let text = self.text(offset, bytes).trim();
        text.parse()
            .map_err(|_| Error::bad_input(format!("{what} is {text:?}, expected an integer")))
    }
}
