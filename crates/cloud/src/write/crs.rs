//! CRS VLRs.

use super::vlr::Vlr;
use crate::las::{PROJECTION, WKT};
use terrane_base::geom::Crs;

/// Key numbers and values of the OGC GeoTIFF standard 1.1 (19-008r4).
mod key {
    pub(super) const MODEL_TYPE: u16 = 1024;
    pub(super) const GEODETIC_CRS: u16 = 2048;
    pub(super) const PROJECTED_CRS: u16 = 3072;
    pub(super) const VERTICAL_CRS: u16 = 4096;
    pub(super) const PROJECTED: u16 = 1;
    pub(super) const GEOGRAPHIC: u16 = 2;
}

/// CRS VLRs: WKT for point formats 6 to 10 if known, or if there are no GeoKeys; GeoKeys otherwise; none if neither
/// is known.
pub(super) fn records(crs: &Crs, is_new: bool) -> Vec<Vlr> {
    let keys = keys(crs);
    match crs.to_wkt().filter(|_| is_new || keys.is_empty()) {
        Some(text) => {
            let data = [text.as_bytes(), &[0]].concat();
            vec![Vlr { user: PROJECTION.into(), number: WKT, about: "OGC WKT".into(), data }]
        }
        None => keys,
    }
}

/// The GeoKeys of the input, or those of the codes.
fn keys(crs: &Crs) -> Vec<Vlr> {
    let directory = if crs.geo_keys.is_empty() { made(crs) } else { crs.geo_keys.clone() };
    let doubles = crs.geo_doubles.iter().flat_map(|value| value.to_le_bytes()).collect();
    let mut ascii = crs.geo_ascii.as_bytes().to_vec();
    if !ascii.is_empty() && ascii.last() != Some(&0) {
        ascii.push(0);
    }
    let parts: [(u16, &str, Vec<u8>); 3] = [
        (
            34_735,
            "GeoKeyDirectoryTag",
            directory.iter().flat_map(|key| key.to_le_bytes()).collect(),
        ),
        (34_736, "GeoDoubleParamsTag", doubles),
        (34_737, "GeoAsciiParamsTag", ascii),
    ];
    let present = parts.into_iter().filter(|(_, _, data)| !data.is_empty());
    present
        .map(|(number, about, data)| Vlr {
            user: PROJECTION.into(),
            number,
            about: about.into(),
            data,
        })
        .collect()
}

fn made(crs: &Crs) -> Vec<u16> {
    let [code, vertical] =
        [crs.epsg, crs.vertical_epsg].map(|code| code.and_then(|code| u16::try_from(code).ok()));
    let Some(code) = code else { return Vec::new() };
    let (model, system) = match crs.horizontal_unit() {
        "degree" => (key::GEOGRAPHIC, key::GEODETIC_CRS),
        _ => (key::PROJECTED, key::PROJECTED_CRS),
    };
    let mut entries = vec![[key::MODEL_TYPE, 0, 1, model], [system, 0, 1, code]];
    entries.extend(vertical.map(|code| [key::VERTICAL_CRS, 0, 1, code]));
    let is_high = crs.vertical_epsg.is_some();
    let mut directory = vec![1, 1, is_high.into(), entries.len() as u16];
    directory.extend(entries.concat());
    directory
}
