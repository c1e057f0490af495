//! The CRS of a LAS file, from WKT or GeoKeys.

use terrane_base::error::Result;
use terrane_base::geom::{Crs, GeoKeys, wkt};
use terrane_files::RawFile;

use super::vlr::VlrHeader;

/// User id of CRS VLRs.
pub(crate) const PROJECTION: &str = "LASF_Projection";
/// Record id of WKT.
pub(crate) const WKT: u16 = 2112;
/// Record ids of GeoKeys and their parameters.
const KEYS: [u16; 3] = [34_735, 34_736, 34_737];
/// Bit of the global encoding: the CRS is WKT.
pub(crate) const IS_WKT: u16 = 1 << 4;

/// The CRS of the VLRs: WKT if the header states it or if the GeoKeys are empty. The two definitions are never mixed,
/// except for vertical parameters that WKT may lack.
pub(super) fn read(file: &RawFile, vlrs: &[VlrHeader], encoding: u16) -> Result<Crs> {
    let data = |id: u16| vlrs.iter().find(|vlr| vlr.is(PROJECTION, id)).map(|vlr| vlr.data(file));
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
    Ok(choose(text, keys, encoding & IS_WKT != 0))
}

/// Chooses one of two definitions.
fn choose(text: Crs, keys: Crs, is_text: bool) -> Crs {
    match text.is_named() && (is_text || keys.to_wkt().is_none()) {
        true => with_heights(text, &keys),
        false => with_heights(keys, &text),
    }
}

/// `first` with the vertical parameters of `second` if it has none and both have the same horizontal unit.
fn with_heights(first: Crs, second: &Crs) -> Crs {
    if !first.is_named() {
        return second.clone();
    }
    let is_silent = first.vertical_epsg.is_none() && first.vertical_unit.is_none();
    if !is_silent || first.horizontal_unit() != second.horizontal_unit() {
        return first;
    }
    Crs {
        vertical_epsg: second.vertical_epsg,
        vertical_unit: second.vertical_unit.clone(),
        ..first
    }
}

fn of_text(bytes: &[u8]) -> Crs {
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
    wkt::of_srs(text)
}

fn of_keys(keys: &[u8], doubles: &[u8], ascii: &[u8]) -> Crs {
    let numbers = keys.as_chunks::<2>().0.iter().map(|pair| u16::from_le_bytes(*pair)).collect();
    let doubles = doubles.as_chunks::<8>().0.iter().map(|eight| f64::from_le_bytes(*eight));
    let ascii = String::from_utf8_lossy(ascii).into_owned();
    GeoKeys::new(numbers, doubles.collect(), ascii).into_crs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_counts_where_the_header_says_so_and_two_definitions_are_never_mixed() {
        let text = r#"PROJCS["feet",GEOGCS["x",DATUM["y",SPHEROID["z",6378137,298.257]],UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],UNIT["Foot_US",0.304800609601219]]"#;
        let of = |keys: &[u16]| GeoKeys::new(keys.to_vec(), vec![], String::new()).into_crs();
        let keys =
            of(&[1, 1, 0, 4, 1024, 0, 1, 1, 3072, 0, 1, 32104, 3076, 0, 1, 9003, 4099, 0, 1, 9003]);
        assert_eq!((keys.epsg, keys.horizontal_unit()), (None, "US survey foot"));
        let found = choose(of_text(text.as_bytes()), keys.clone(), true);
        assert_eq!((found.epsg, found.wkt.as_deref()), (None, Some(text)));
        assert!(found.geo_keys.is_empty());
        assert_eq!(found.vertical_unit.as_deref(), Some("US survey foot"));
        let metres = of(&[1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 32104, 4099, 0, 1, 9001]);
        assert_eq!(choose(of_text(text.as_bytes()), metres, true).vertical_unit, None);
        assert_eq!(choose(of_text(text.as_bytes()), keys.clone(), false), keys);
        assert_eq!(
            choose(of_text(text.as_bytes()), Crs::default(), false).wkt.as_deref(),
            Some(text)
        );
        assert_eq!(choose(Crs::default(), keys.clone(), true), keys);
    }
}
