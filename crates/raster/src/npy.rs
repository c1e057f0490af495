//! NumPy arrays (.npy, format versions 1 to 3) of two dimensions: rows, columns.

use std::path::Path;

use crate::format::{GridOpenOptions, RasterFormat, only_band};
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::strided::{StridedGrid, StridedLayout, check_exact};
use crate::{prj, world};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_base::limits;
use terrane_files::RawFile;

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "NumPy",
    extensions: &["npy"],
    about: "two-dimensional arrays; georeference from .wld and .prj",
    sniff: |head| head.starts_with(MAGIC),
    open,
};

const MAGIC: &[u8] = b"\x93NUMPY";
/// Maximum header size in bytes; headers of plain arrays take 118.
const MAX_HEADER: u64 = 64 << 10;

fn open(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let grid = read(path, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(grid))
}

fn read(path: &Path, options: &GridOpenOptions) -> Result<StridedGrid> {
    only_band(options.band)?;
    let file = RawFile::open(path)?;
    let (start, bytes) = header_range(&file)?;
    limits::check("header size in bytes", bytes, MAX_HEADER)?;
    let header = file.read_vec(start, bytes)?;
    let header = NpyHeader::read(&String::from_utf8_lossy(&header))?;
    let map = world::sidecar_transform(path, &["npyw", "wld"])?;
    let order = if header.by_column { "by column" } else { "by row" };
    let info = GridInfo {
        transform: map.unwrap_or(Affine::LATTICE),
        georeferenced: map.is_some(),
        crs: prj::sidecar_crs(path)?,
        nodata: options.nodata,
        details: vec![
            ("descr".to_owned(), header.descr.clone()),
            ("order".to_owned(), order.to_owned()),
        ],
        ..GridInfo::plain(FORMAT.name, header.width, header.height, header.sample_type)
    };
    let size = header.sample_type.bytes();
    let layout = match header.by_column {
        true => StridedLayout::columns(header.height, size),
        false => StridedLayout::rows(header.width, size),
    };
    let layout = StridedLayout { offset: start + bytes, big_endian: header.big_endian, ..layout };
    let end = layout.end(header.width, header.height, size);
    check_exact(&file, end.as_ref().map(std::slice::from_ref))?;
    StridedGrid::new(file, info, layout)
}

/// Offset and length of the header text.
fn header_range(file: &RawFile) -> Result<(u64, u64)> {
    let head = file.head(12)?;
    if !head.starts_with(MAGIC) {
        return Err(Error::bad_input("is not a NumPy file: magic \\x93NUMPY is missing"));
    }
    match head[MAGIC.len()..] {
        [1, _, a, b, ..] => Ok((10, u64::from(u16::from_le_bytes([a, b])))),
        [2 | 3, _, a, b, c, d] => Ok((12, u64::from(u32::from_le_bytes([a, b, c, d])))),
        [version, ..] if version > 3 => {
            Err(Error::unsupported(format!("NumPy format version {version} is not supported")))
        }
        _ => Err(Error::bad_input("file is truncated: its header is not complete")),
    }
}

/// Content of the header.
#[derive(Debug, PartialEq)]
struct NpyHeader {
    descr: String,
    sample_type: SampleType,
    big_endian: bool,
    by_column: bool,
    width: u32,
    height: u32,
}

impl NpyHeader {
    /// Reads `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }`.
    fn read(text: &str) -> Result<Self> {
        let descr = after_key(text, "descr")?;
        if descr.starts_with('[') {
            return Err(Error::unsupported("structured arrays are not supported"));
        }
        let mut quoted = descr.split(['\'', '"']);
        let (Some(""), Some(descr)) = (quoted.next(), quoted.next()) else {
            return Err(Error::bad_input("descr in the header is not a type"));
        };
        let (sample_type, big_endian) = sample_type(descr)?;
        let order = after_key(text, "fortran_order")?;
        let by_column = order.starts_with("True");
        if !by_column && !order.starts_with("False") {
            return Err(Error::bad_input("fortran_order in the header is neither True nor False"));
        }
        let (height, width) = shape(after_key(text, "shape")?)?;
        Ok(Self { descr: descr.to_owned(), sample_type, big_endian, by_column, width, height })
    }
}

/// The text after `'key':`.
fn after_key<'a>(text: &'a str, key: &str) -> Result<&'a str> {
    let quoted = [format!("'{key}'"), format!("\"{key}\"")];
    let rest = quoted.iter().find_map(|key| text.split_once(key.as_str())).map(|pair| pair.1);
    let value = rest.and_then(|rest| rest.trim_start().strip_prefix(':'));
    value.map(str::trim_start).ok_or_else(|| Error::bad_input(format!("header lacks {key}")))
}

/// Type and byte order of a code such as "<f4".
fn sample_type(descr: &str) -> Result<(SampleType, bool)> {
    let big_endian = match descr.as_bytes().first() {
        Some(b'>') => true,
        Some(b'<') => false,
        _ => cfg!(target_endian = "big"),
    };
    let kind = match descr.trim_start_matches(['<', '>', '|', '=']) {
        "i1" => SampleType::I8,
        "u1" => SampleType::U8,
        "i2" => SampleType::I16,
        "u2" => SampleType::U16,
        "i4" => SampleType::I32,
        "u4" => SampleType::U32,
        "f2" => SampleType::F16,
        "f4" => SampleType::F32,
        "f8" => SampleType::F64,
        "b1" => return Err(Error::unsupported("boolean arrays are not supported")),
        other => {
            return Err(Error::unsupported(format!("arrays of type {other} are not supported"))
                .remedy("save them as float32 or float64"));
        }
    };
    Ok((kind, big_endian))
}

/// The numbers of "(3, 4)...".
fn sides(text: &str) -> Option<Vec<u64>> {
    let (inside, _) = text.strip_prefix('(')?.split_once(')')?;
    let sides = inside.split(',').map(str::trim).filter(|side| !side.is_empty());
    // Python 2 wrote long integers with an L.
    sides.map(|side| side.trim_end_matches('L').parse().ok()).collect()
}

/// Rows and columns of "(3, 4)...".
fn shape(text: &str) -> Result<(u32, u32)> {
    let sides = sides(text)
        .ok_or_else(|| Error::bad_input("shape in the header is not a list of numbers"))?;
    let &[height, width] = sides.as_slice() else {
        return Err(Error::unsupported(format!(
            "arrays of {} dimensions are not supported",
            sides.len()
        )));
    };
    if height == 0 || width == 0 {
        return Err(Error::bad_input(format!("array is empty: {height} x {width}")));
    }
    limits::check("number of rows", height, limits::MAX_SIDE)?;
    limits::check("number of columns", width, limits::MAX_SIDE)?;
    Ok((height as u32, width as u32))
}
