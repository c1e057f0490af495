//! The coordinate reference system of a LAS file, from well-known text or GeoKeys.

use crate::error::Result;
use crate::files::RawFile;
use crate::geom::{Crs, GeoKeys, wkt};

use super::vlr::Vlr;

/// Who writes records of reference systems.
const USER: &str = "LASF_Projection";
/// Well-known text.
const WKT: u16 = 2112;
/// GeoKeys with their numbers and texts.
const KEYS: [u16; 3] = [34_735, 34_736, 34_737];
/// Bit of the global encoding: the system is given as well-known text.
const IS_WKT: u16 = 1 << 4;

/// What the records say. Text comes first where the header says so or where there are no keys; what
/// one of them leaves open, the other fills in.
pub(super) fn read(file: &RawFile, vlrs: &[Vlr], encoding: u16) -> Result<Crs> {
    let data = |id: u16| vlrs.iter().find(|vlr| vlr.is(USER, id)).map(|vlr| vlr.data(file));
    let text = data(WKT).transpose()?.map_or_else(Crs::default, |bytes| of_text(&bytes));
    let [keys, doubles, ascii] = KEYS.map(data);
    let keys = match keys.transpose()? {
        Some(keys) => of_keys(
            &keys,
            &doubles.transpose()?.unwrap_or_default(),
            &ascii.transpose()?.unwrap_or_default(),
        ),
        None => Crs::default(),
    };
    Ok(match encoding & IS_WKT != 0 || keys.epsg.is_none() && keys.citation.is_none() {
        true if !text.is_unknown() => join(text, keys),
        _ => join(keys, text),
    })
}

/// `first`, with its gaps filled from `second` where that is of the same system.
fn join(first: Crs, second: Crs) -> Crs {
    if first.is_unknown() {
        return second;
    }
    let alike = match (first.epsg, second.epsg) {
        (Some(a), Some(b)) => a == b,
        _ => !second.is_unknown(),
    };
    if !alike {
        return first;
    }
    Crs {
        epsg: first.epsg.or(second.epsg),
        vertical_epsg: first.vertical_epsg.or(second.vertical_epsg),
        wkt: first.wkt.or(second.wkt),
        geographic: first.geographic.or(second.geographic),
        vertical_unit: first.vertical_unit.or(second.vertical_unit),
        ..first
    }
}

fn of_text(bytes: &[u8]) -> Crs {
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
    if text.is_empty() { Crs::default() } else { wkt::from_text(text) }
}

fn of_keys(keys: &[u8], doubles: &[u8], ascii: &[u8]) -> Crs {
    let numbers = keys.as_chunks::<2>().0.iter().map(|pair| u16::from_le_bytes(*pair)).collect();
    let doubles = doubles.as_chunks::<8>().0.iter().map(|eight| f64::from_le_bytes(*eight));
    let ascii = String::from_utf8_lossy(ascii).into_owned();
    GeoKeys::new(numbers, doubles.collect(), ascii).into_crs()
}
