//! ESRI headers: one key and value per line, in any case and order.

use std::collections::HashMap;

use super::header::{Interleave, RawRasterHeader, count, number, once, whole};
use crate::grid::SampleType;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs};
use terrane_base::limits;

/// Values by key, keys in lower case.
struct EsriHeaderValues<'a>(HashMap<String, &'a str>);

impl<'a> EsriHeaderValues<'a> {
    fn of(text: &'a str) -> Result<Self> {
        let pairs = text.lines().filter_map(|line| {
            let mut words = line.split_whitespace();
            Some((words.next()?.to_lowercase(), words.next()?))
        });
        once(pairs).map(Self)
    }

    /// The value of the first of `keys` that is present, with the key.
    fn get(&self, keys: &[&'static str]) -> Option<(&'static str, &'a str)> {
        keys.iter().find_map(|key| Some((*key, *self.0.get(*key)?)))
    }

    fn number(&self, keys: &[&'static str]) -> Result<Option<f64>> {
        self.get(keys).map(|(key, value)| number(key, value)).transpose()
    }

    fn whole(&self, key: &'static str) -> Result<Option<u64>> {
        self.get(&[key]).map(|(key, value)| whole(key, value)).transpose()
    }

    fn side(&self, key: &'static str) -> Result<u32> {
        let (_, value) =
            self.get(&[key]).ok_or_else(|| Error::bad_input(format!("header lacks {key}")))?;
        count(key, value, limits::MAX_SIDE)
    }
}

/// Sample sizes in bits to try if NBITS is missing.
const BITS: [u64; 4] = [8, 16, 32, 64];

/// Parses a header; `ending` is the extension of the data file, which decides between floats and integers if
/// the header does not, and `bytes` its length, from which the sample size is inferred.
pub(super) fn read(text: &str, ending: &str, bytes: u64) -> Result<RawRasterHeader> {
    let values = EsriHeaderValues::of(text)?;
    let header = match values.whole("nbits")? {
        Some(bits) => with(&values, ending, sample_type(&values, ending, bits)?)?,
        None => by_length(&values, ending, bytes)?,
    };
    Ok(RawRasterHeader { big_endian: big_endian(&values, header.sample_type)?, ..header })
}

/// The header with the sample size that matches the length of the data.
fn by_length(values: &EsriHeaderValues<'_>, ending: &str, bytes: u64) -> Result<RawRasterHeader> {
    let mut fitting = Vec::new();
    for bits in BITS {
        // Wide samples of unknown kind are floats, as in GDAL.
        let kind = match values.get(&["pixeltype"]) {
            None if bits == 32 => Ok(SampleType::F32),
            _ => sample_type(values, ending, bits),
        };
        let Ok(kind) = kind else { continue };
        let header = with(values, ending, kind)?;
        if header.lengths().is_some_and(|lengths| lengths.contains(&bytes)) {
            fitting.push(header);
        }
    }
    if fitting.len() > 1 {
        fitting.retain(RawRasterHeader::is_dense);
    }
    match fitting.pop().filter(|_| fitting.is_empty()) {
        Some(header) => Ok(header),
        None => Err(Error::bad_input(format!(
            "header lacks NBITS, and the data size of {bytes} bytes is ambiguous"
        ))
        .remedy("add a line such as NBITS 16, or copy the data again")),
    }
}

/// The header for samples of this type, before the byte order is known.
fn with(
    values: &EsriHeaderValues<'_>,
    ending: &str,
    sample_type: SampleType,
) -> Result<RawRasterHeader> {
    let (width, height) = (values.side("ncols")?, values.side("nrows")?);
    let bands = match values.get(&["nbands"]) {
        Some((key, value)) => count(key, value, limits::MAX_BANDS)?,
        None => 1,
    };
    Ok(RawRasterHeader {
        kind: "ESRI",
        width,
        height,
        bands,
        sample_type,
        big_endian: false,
        interleave: interleave(values, ending)?,
        skip: values.whole("skipbytes")?.unwrap_or(0),
        band_row_bytes: values.whole("bandrowbytes")?,
        total_row_bytes: values.whole("totalrowbytes")?,
        band_gap_bytes: values.whole("bandgapbytes")?.unwrap_or(0),
        transform: transform(values, height)?,
        nodata: nodata(values)?,
        scale: Vec::new(),
        offset: Vec::new(),
        crs: Crs::default(),
    })
}

fn nodata(values: &EsriHeaderValues<'_>) -> Result<Option<f64>> {
    values.number(&["nodata", "nodata_value"])
}

fn interleave(values: &EsriHeaderValues<'_>, ending: &str) -> Result<Interleave> {
    match values.get(&["layout"]) {
        Some((_, name)) => Interleave::named(name)
            .ok_or_else(|| Error::unsupported(format!("layout {name} is not supported"))),
        None => Ok(Interleave::named(ending).unwrap_or(Interleave::Bil)),
    }
}

/// Without BYTEORDER, ESRI's programs use the native order and GDAL big-endian.
fn big_endian(values: &EsriHeaderValues<'_>, sample_type: SampleType) -> Result<bool> {
    let Some((_, order)) = values.get(&["byteorder"]) else {
        return match sample_type.bytes() {
            1 => Ok(false),
            _ => Err(Error::bad_input(
                "header lacks BYTEORDER, and defaults differ between programs",
            )
            .remedy("add a line BYTEORDER I (little-endian, usual) or BYTEORDER M")),
        };
    };
    match order.to_ascii_uppercase().as_str() {
        "I" | "L" | "LSBFIRST" | "LITTLE_ENDIAN" | "INTEL" => Ok(false),
        "M" | "B" | "MSBFIRST" | "BIG_ENDIAN" | "MOTOROLA" => Ok(true),
        _ => Err(Error::unsupported(format!("byte order {order} is not supported"))),
    }
}

/// Number type of PIXELTYPE.
#[derive(PartialEq)]
enum EsriPixelType {
    Signed,
    Unsigned,
    Float,
}

fn sample_type(values: &EsriHeaderValues<'_>, ending: &str, bits: u64) -> Result<SampleType> {
    let stated = match values.get(&["pixeltype"]).map(|(_, name)| name.to_ascii_uppercase()) {
        None => None,
        Some(name) => Some(match name.as_str() {
            "SIGNEDINT" | "SIGNED" | "INT" => EsriPixelType::Signed,
            "UNSIGNEDINT" | "UNSIGNED" | "UINT" => EsriPixelType::Unsigned,
            "FLOAT" => EsriPixelType::Float,
            _ => return Err(Error::unsupported(format!("pixel type {name} is not supported"))),
        }),
    };
    let by_ending = stated.is_none() && ending == "flt" && bits == 32;
    let is_float = stated == Some(EsriPixelType::Float) || by_ending;
    // Old global grids have nodata -9999 and no pixel type: a negative nodata value implies signed samples.
    let signed = stated == Some(EsriPixelType::Signed)
        || (stated.is_none() && ending != "flt" && nodata(values)?.is_some_and(|v| v < 0.0));
    match (bits, is_float, signed) {
        (32, true, _) => Ok(SampleType::F32),
        (64, true, _) => Ok(SampleType::F64),
        (8, false, true) => Ok(SampleType::I8),
        (8, false, false) => Ok(SampleType::U8),
        (16, false, true) => Ok(SampleType::I16),
        (16, false, false) => Ok(SampleType::U16),
        (32, false, true) => Ok(SampleType::I32),
        (32, false, false) => Ok(SampleType::U32),
        _ => {
            let kind = if is_float { "float" } else { "integer" };
            Err(Error::unsupported(format!("{bits}-bit {kind} samples are not supported")))
        }
    }
}

/// Transform from the upper left sample (ULXMAP), or from the lower left corner or sample (GridFloat).
fn transform(values: &EsriHeaderValues<'_>, height: u32) -> Result<Option<Affine>> {
    let size = values.number(&["cellsize"])?;
    let dx = values.number(&["xdim"])?.or(size);
    let dy = values.number(&["ydim"])?.or(size);
    let upper = (values.number(&["ulxmap"])?, values.number(&["ulymap"])?);
    let corner = (values.number(&["xllcorner"])?, values.number(&["yllcorner"])?);
    let centre = (values.number(&["xllcenter"])?, values.number(&["yllcenter"])?);
    let up = f64::from(height - 1);
    let (x0, y0, dx, dy) = match (upper, corner, centre, dx, dy) {
        ((Some(x), Some(y)), _, _, dx, dy) => (x, y, dx.unwrap_or(1.0), dy.unwrap_or(1.0)),
        (_, (Some(x), Some(y)), _, Some(dx), Some(dy)) => {
            (x + 0.5 * dx, y + (up + 0.5) * dy, dx, dy)
        }
        (_, _, (Some(x), Some(y)), Some(dx), Some(dy)) => (x, y + up * dy, dx, dy),
        _ => return Ok(None),
    };
    let map = Affine { x0, a: dx, b: 0.0, y0, d: 0.0, e: -dy };
    if dx <= 0.0 || dy <= 0.0 || !map.is_valid() {
        return Err(Error::bad_input("invalid cell size or position in the header"));
    }
    Ok(Some(map))
}
