//! DTED levels 0 to 2 (MIL-PRF-89020B): one degree of heights in columns from west to east, each from south
//! to north with a checksum. All checksums are verified at opening, and the heights are kept in a temporary
//! file.

use std::path::Path;

use crate::format::{GridOpenOptions, RasterFormat, only_band};
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::spool::SampleSpool;
use crate::strided::{StridedGrid, StridedLayout};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs};
use terrane_base::limits;
use terrane_files::RawFile;

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "DTED",
    extensions: &["dt0", "dt1", "dt2"],
    about: "levels 0 to 2; checksums are verified, missing columns of partial cells are void",
    sniff: |head| head.starts_with(b"UHL1"),
    open,
};

const LABEL_BYTES: u64 = 80;
/// Maximum number of tape labels before the user header label.
const MAX_LABELS: u64 = 8;
const DSI_BYTES: u64 = 648;
const ACC_BYTES: u64 = 2700;
/// Header of a column: sentinel, block count, longitude and latitude counts.
const COLUMN_HEAD: usize = 8;
const CHECKSUM_BYTES: usize = 4;
const SENTINEL: u8 = 0xaa;
const VOID: i16 = -32767;
/// Lowest valid height; values below were written in two's complement, against the standard.
const LOWEST: i16 = -16000;

fn open(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let grid = read(path, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(grid))
}

fn read(path: &Path, options: &GridOpenOptions) -> Result<StridedGrid> {
    only_band(options.band)?;
    let file = RawFile::open(path)?;
    let header = DtedHeader::read(&file)?;
    let spool = DtedColumns { file: &file, header: &header }
        .spool(SampleSpool::new(path, options.temp_dir.as_deref())?)?;
    let info = header.info(options);
    let layout = StridedLayout::columns(header.height, SampleType::I16.bytes());
    StridedGrid::new(spool, info, layout)
}

/// Content of the header records.
struct DtedHeader {
    width: u32,
    height: u32,
    transform: Affine,
    /// EPSG code and name of the geographic CRS.
    datum: (Option<u32>, String),
    vertical_datum: String,
    level: String,
    /// True if the data set is declared as a partial cell.
    is_partial: bool,
    /// Offset of the first column.
    data: u64,
}

impl DtedHeader {
    fn read(file: &RawFile) -> Result<Self> {
        let start = label_start(file)?;
        let label = file.read_vec(start, LABEL_BYTES)?;
        let dsi = file.read_vec(start + LABEL_BYTES, DSI_BYTES)?;
        let data = start + LABEL_BYTES + DSI_BYTES + ACC_BYTES;
        let label = DtedText(&label);
        let dsi = DtedText(&dsi);
        if dsi.at(0, 3) != "DSI" {
            return Err(Error::bad_input(
                "data set identification (DSI) is missing after the label",
            ));
        }
        let (width, height) =
            (label.side("longitude lines", 47)?, label.side("latitude points", 51)?);
        let transform = transform(&label, width, height)?;
        Ok(Self {
            width,
            height,
            transform,
            datum: datum(dsi.at(144, 5)),
            vertical_datum: dsi.at(141, 3).trim().to_owned(),
            level: dsi.at(59, 5).trim().to_owned(),
            is_partial: !matches!(dsi.at(289, 2).trim(), "" | "00"),
            data,
        })
    }

    fn info(&self, options: &GridOpenOptions) -> GridInfo {
        let crs = Crs {
            epsg: self.datum.0,
            citation: Some(self.datum.1.clone()),
            geographic: Some(true),
            vertical_unit: Some("metre".to_owned()),
            vertical_unit_text: Some("m".to_owned()),
            ..Crs::default()
        };
        GridInfo {
            transform: self.transform,
            georeferenced: true,
            pixel_is_point: true,
            crs,
            nodata: Some(options.nodata.unwrap_or(f64::from(VOID))),
            block: (1, self.height),
            details: vec![
                ("level".to_owned(), self.level.clone()),
                ("vertical datum".to_owned(), self.vertical_datum.clone()),
                ("byte order".to_owned(), "big-endian".to_owned()),
            ],
            ..GridInfo::plain(FORMAT.name, self.width, self.height, SampleType::I16)
        }
    }
}

/// Offset of the user header label, after any tape labels.
fn label_start(file: &RawFile) -> Result<u64> {
    for i in 0..MAX_LABELS {
        let label = file.read_vec(i * LABEL_BYTES, LABEL_BYTES)?;
        if label.starts_with(b"UHL") {
            return Ok(i * LABEL_BYTES);
        }
        // Copies of tapes begin with the labels of the volume and the file.
        if !label.starts_with(b"HDR") && !label.starts_with(b"VOL") {
            break;
        }
    }
    Err(Error::bad_input("is not DTED: user header label (UHL) is missing"))
}

/// Fields of fixed width.
struct DtedText<'a>(&'a [u8]);

impl DtedText<'_> {
    /// The field of `bytes` bytes at `offset`; empty if it is missing or not ASCII.
    fn at(&self, offset: usize, bytes: usize) -> &str {
        let field = self.0.get(offset..offset + bytes).unwrap_or_default();
        // ASCII alone, so that columns of the text are those of its bytes.
        std::str::from_utf8(field).ok().filter(|text| text.is_ascii()).unwrap_or_default()
    }

    fn side(&self, name: &str, offset: usize) -> Result<u32> {
        match self.at(offset, 4).trim().parse() {
            Ok(count) if count >= 2 => Ok(count),
            _ => Err(Error::bad_input(format!("{name} is not an integer of 2 or more"))),
        }
    }

    /// A coordinate in degrees, stored as DDDMMSSH.
    fn degrees(&self, offset: usize) -> Option<f64> {
        let text = self.at(offset, 8);
        let [degrees, minutes, seconds] = [0..3, 3..5, 5..7]
            .map(|digits| text.get(digits)?.trim().parse::<u32>().ok().map(f64::from));
        let size = degrees? + minutes? / 60.0 + seconds? / 3600.0;
        match text.get(7..)? {
            "N" | "E" => Some(size),
            "S" | "W" => Some(-size),
            _ => None,
        }
    }

    /// Sample interval in degrees, stored in tenths of an arc second.
    fn interval(&self, offset: usize) -> Option<f64> {
        let tenths: u32 = self.at(offset, 4).trim().parse().ok()?;
        (tenths > 0).then(|| f64::from(tenths) / 36_000.0)
    }
}

fn transform(label: &DtedText<'_>, width: u32, height: u32) -> Result<Affine> {
    let west = label.degrees(4).ok_or_else(|| Error::bad_input("invalid origin longitude"))?;
    let south = label.degrees(12).ok_or_else(|| Error::bad_input("invalid origin latitude"))?;
    // Where intervals are left out, a cell is one degree.
    let dx = label.interval(20).unwrap_or(1.0 / f64::from(width - 1));
    let dy = label.interval(24).unwrap_or(1.0 / f64::from(height - 1));
    let north = south + f64::from(height - 1) * dy;
    Ok(Affine { x0: west, a: dx, b: 0.0, y0: north, d: 0.0, e: -dy })
}

fn datum(name: &str) -> (Option<u32>, String) {
    match name.trim() {
        "WGS84" => (Some(4326), "WGS 84".to_owned()),
        "WGS72" => (Some(4322), "WGS 72".to_owned()),
        "" => (None, "unknown datum".to_owned()),
        other => (None, other.to_owned()),
    }
}

/// Column records.
struct DtedColumns<'a> {
    file: &'a RawFile,
    header: &'a DtedHeader,
}

impl DtedColumns<'_> {
    /// Verifies and decodes all columns into columns from north to south; missing ones are void.
    fn spool(&self, mut spool: SampleSpool) -> Result<RawFile> {
        let count = self.count()?;
        let bytes = self.record_bytes();
        let column_bytes = u64::from(self.header.height) * 2;
        spool.fill(
            &VOID.to_ne_bytes(),
            u64::from(self.header.width) * u64::from(self.header.height),
        )?;
        let (mut record, mut next) = (vec![0; bytes as usize], 0);
        let mut in_order = true;
        for i in 0..count {
            self.file.read_at(self.header.data + i * bytes, &mut record)?;
            let column = self.check(&record, i, next)?;
            in_order &= u64::from(column) == i;
            next = column + 1;
            spool.replace(u64::from(column) * column_bytes, &decode(&record))?;
        }
        if count < u64::from(self.header.width) && in_order && !self.header.is_partial {
            return Err(self.truncated());
        }
        spool.finish()
    }

    fn record_bytes(&self) -> u64 {
        (COLUMN_HEAD + CHECKSUM_BYTES) as u64 + 2 * u64::from(self.header.height)
    }

    /// Number of complete records in the file, at most the number of columns.
    fn count(&self) -> Result<u64> {
        let (bytes, width) = (self.record_bytes(), u64::from(self.header.width));
        let room = self.file.size().saturating_sub(self.header.data);
        let count = (room / bytes).min(width);
        if count == 0 || (count < width && !room.is_multiple_of(bytes)) {
            return Err(self.truncated());
        }
        limits::check("number of columns", count, limits::MAX_SIDE)?;
        match room - count * bytes {
            0 => Ok(count),
            more => Err(Error::bad_input(format!("{more} extra bytes after the last column"))
                .remedy("copy the file again")),
        }
    }

    fn truncated(&self) -> Error {
        let expected = self.header.data + self.record_bytes() * u64::from(self.header.width);
        Error::bad_input(format!(
            "file is truncated: {} columns need {expected} bytes, found {}",
            self.header.width,
            self.file.size()
        ))
    }

    /// The column number of `record`, which is at least `least`.
    fn check(&self, record: &[u8], i: u64, least: u32) -> Result<u32> {
        let place = format!("column {}", i + 1);
        let (body, sum) = record.split_at(record.len() - CHECKSUM_BYTES);
        if body.first() != Some(&SENTINEL) {
            return Err(Error::bad_input("sentinel 0xAA is missing").at(place));
        }
        let stored = sum.iter().fold(0, |sum, byte| sum << 8 | u32::from(*byte));
        let found = body.iter().fold(0, |sum: u32, byte| sum.wrapping_add(u32::from(*byte)));
        if stored != found {
            return Err(Error::bad_input(format!("checksum is {found}, expected {stored}"))
                .at(place)
                .remedy("copy the file again"));
        }
        let column = u32::from(body[4]) << 8 | u32::from(body[5]);
        if column < least || column >= self.header.width {
            let message = format!(
                "longitude count is {column}, expected {least} to {}",
                self.header.width - 1
            );
            return Err(Error::bad_input(message).at(place));
        }
        Ok(column)
    }
}

/// The heights of a record from north to south.
fn decode(record: &[u8]) -> Vec<u8> {
    let heights = &record[COLUMN_HEAD..record.len() - CHECKSUM_BYTES];
    heights.as_chunks::<2>().0.iter().rev().flat_map(|h| height(*h).to_ne_bytes()).collect()
}

/// Heights are stored in sign-magnitude form, not two's complement.
fn height(stored: [u8; 2]) -> i16 {
    let bits = u16::from_be_bytes(stored);
    let size = (bits & 0x7fff) as i16;
    let signed = if bits & 0x8000 == 0 { size } else { -size };
    if signed < LOWEST && signed != VOID { bits as i16 } else { signed }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_have_a_sign_bit() {
        assert_eq!(height([0, 5]), 5);
        assert_eq!(height([0x80, 5]), -5);
        assert_eq!(height([0xff, 0xff]), VOID);
        assert_eq!(height([0xff, 0xf0]), -16, "two's complement of careless writers");
    }

    #[test]
    fn corners_in_degrees() {
        let label = DtedText(b"0063000W 123N");
        assert_eq!(label.degrees(0), Some(-6.5));
        assert_eq!(label.degrees(5), None);
        assert_eq!(label.degrees(900), None);
    }
}
