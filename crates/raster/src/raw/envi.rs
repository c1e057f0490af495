//! ENVI headers: `key = value`, with lists in braces that may span lines.

use std::collections::HashMap;

use super::header::{Interleave, RawRasterHeader, count, number, once, whole};
use crate::grid::SampleType;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, wkt};
use terrane_base::limits;

/// Values by key, keys in lower case, braces removed.
struct EnviHeaderValues(HashMap<String, String>);

impl EnviHeaderValues {
    fn of(text: &str) -> Result<Self> {
        let mut values = Vec::new();
        let mut lines = text.lines();
        while let Some(line) = lines.next() {
            let Some((key, value)) = line.split_once('=') else { continue };
            let mut value = value.trim().to_owned();
            let mut is_open = value.starts_with('{') && !value.contains('}');
            while is_open {
                let Some(more) = lines.next() else { break };
                value = value + " " + more.trim();
                is_open = !more.contains('}');
            }
            let value = value.trim_start_matches('{').split('}').next().unwrap_or_default().trim();
            values.push((key.trim().to_lowercase(), value.to_owned()));
        }
        once(values.into_iter()).map(Self)
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(String::as_str)
    }

    fn count(&self, key: &str, most: u64) -> Result<u32> {
        let value = self.get(key).ok_or_else(|| Error::bad_input(format!("header lacks {key}")))?;
        count(key, value, most)
    }

    fn whole(&self, key: &str) -> Result<Option<u64>> {
        self.get(key).map(|value| whole(key, value)).transpose()
    }

    /// A list of numbers; empty if missing.
    fn list(&self, key: &str) -> Result<Vec<f64>> {
        let items = self.get(key).into_iter().flat_map(|value| value.split(','));
        items.map(|item| number(key, item.trim())).collect()
    }
}

/// Reads a header.
pub(super) fn read(text: &str) -> Result<RawRasterHeader> {
    let values = EnviHeaderValues::of(text)?;
    check_plain(&values)?;
    let map = values.get("map info").map(MapInfo::read).transpose()?;
    let crs = match values.get("coordinate system string") {
        Some(wkt) if !wkt.is_empty() => wkt::from_text(wkt),
        _ => map.as_ref().map(|map| map.crs.clone()).unwrap_or_default(),
    };
    let ignore = values.get("data ignore value").map(|v| number("data ignore value", v));
    Ok(RawRasterHeader {
        kind: "ENVI",
        width: values.count("samples", limits::MAX_SIDE)?,
        height: values.count("lines", limits::MAX_SIDE)?,
        bands: values.get("bands").map_or(Ok(1), |v| count("bands", v, limits::MAX_BANDS))?,
        sample_type: sample_type(&values)?,
        big_endian: values.whole("byte order")?.unwrap_or(0) == 1,
        interleave: interleave(&values)?,
        skip: values.whole("header offset")?.unwrap_or(0),
        band_row_bytes: None,
        total_row_bytes: None,
        band_gap_bytes: 0,
        transform: map.map(|map| map.transform),
        nodata: ignore.transpose()?,
        scale: values.list("data gain values")?,
        offset: values.list("data offset values")?,
        crs,
    })
}

/// Rejects rare features that change the layout of samples.
fn check_plain(values: &EnviHeaderValues) -> Result<()> {
    if values.get("file compression").is_some_and(|v| v != "0") {
        return Err(Error::unsupported("compressed ENVI files are not supported"));
    }
    for key in ["major frame offsets", "minor frame offsets"] {
        if values.list(key)?.iter().any(|bytes| *bytes != 0.0) {
            return Err(Error::unsupported(format!("ENVI {key} are not supported")));
        }
    }
    match values.whole("byte order")? {
        Some(0 | 1) | None => Ok(()),
        Some(order) => Err(Error::bad_input(format!("byte order is {order}, expected 0 or 1"))),
    }
}

fn interleave(values: &EnviHeaderValues) -> Result<Interleave> {
    let name = values.get("interleave").unwrap_or("bsq");
    Interleave::named(name)
        .ok_or_else(|| Error::unsupported(format!("interleave {name} is not supported")))
}

fn sample_type(values: &EnviHeaderValues) -> Result<SampleType> {
    match values.whole("data type")?.unwrap_or(1) {
        1 => Ok(SampleType::U8),
        2 => Ok(SampleType::I16),
        3 => Ok(SampleType::I32),
        4 => Ok(SampleType::F32),
        5 => Ok(SampleType::F64),
        12 => Ok(SampleType::U16),
        13 => Ok(SampleType::U32),
        6 | 9 => Err(Error::unsupported("complex samples are not supported")),
        14 | 15 => Err(Error::unsupported("64-bit integer samples are not supported")),
        other => Err(Error::unsupported(format!("ENVI data type {other} is not supported"))),
    }
}

/// The `map info` list: projection, reference pixel, its position, cell size, and more.
struct MapInfo {
    transform: Affine,
    crs: Crs,
}

impl MapInfo {
    fn read(text: &str) -> Result<Self> {
        let items: Vec<&str> = text.split(',').map(str::trim).collect();
        let [projection, col, row, x, y, dx, dy, rest @ ..] = items.as_slice() else {
            return Err(Error::bad_input("map info has fewer than 7 items"));
        };
        let numbers = [col, row, dx, dy, x, y].map(|value| number("map info", value));
        let [col, row, dx, dy, x, y] = numbers;
        let (col, row, dx, dy) = (col?, row?, dx?, dy?);
        // The reference pixel counts from 1 at the outer corner of the first sample.
        let west = x? - (col - 1.0) * dx;
        let north = y? + (row - 1.0) * dy;
        let transform = Affine::from_gdal([west, dx, 0.0, north, 0.0, -dy]);
        if dx <= 0.0 || dy <= 0.0 || !transform.is_valid() {
            return Err(Error::bad_input("invalid cell size or position in map info"));
        }
        check_rotation(rest)?;
        Ok(Self { transform, crs: crs(projection, rest) })
    }
}

fn check_rotation(items: &[&str]) -> Result<()> {
    let rotated = items.iter().filter_map(|item| item.split_once('=')).any(|(key, value)| {
        key.trim().eq_ignore_ascii_case("rotation") && value.trim().parse() != Ok(0.0)
    });
    if rotated { Err(Error::unsupported("rotated ENVI map info is not supported")) } else { Ok(()) }
}

/// A datum that `map info` names: its name in Esri's CRS names, and the EPSG code of its geographic CRS.
fn known_datum(name: &str) -> Option<(&'static str, u32)> {
    match name.to_ascii_lowercase().as_str() {
        "wgs-84" | "wgs84" | "wgs 84" => Some(("WGS_1984", 4326)),
        "north america 1983" | "nad83" => Some(("NAD_1983", 4269)),
        "north america 1927" | "nad27" => Some(("NAD_1927", 4267)),
        _ => None,
    }
}

/// CRS named by `map info` alone.
fn crs(projection: &str, rest: &[&str]) -> Crs {
    if projection.to_ascii_lowercase().starts_with("geographic") {
        let name = rest.iter().find(|item| !item.contains('=') && item.parse::<f64>().is_err());
        let epsg = name.and_then(|name| known_datum(name)).map(|(_, geographic)| geographic);
        let citation = Some(projection.to_owned());
        return Crs { epsg, citation, geographic: Some(true), ..Crs::default() };
    }
    let (Some(zone), Some(half)) = (rest.first(), rest.get(1)) else { return Crs::default() };
    if !projection.eq_ignore_ascii_case("utm") {
        return Crs { citation: Some(projection.to_owned()), ..Crs::default() };
    }
    let north = !half.eq_ignore_ascii_case("south");
    let datum = rest.get(2).and_then(|name| known_datum(name));
    let epsg = datum
        .zip(zone.parse::<u32>().ok())
        .and_then(|((datum, _), zone)| wkt::utm_code(datum, north, zone));
    let citation = Some(format!("UTM zone {zone} {half}"));
    Crs { epsg, citation, geographic: Some(false), ..Crs::default() }
}
