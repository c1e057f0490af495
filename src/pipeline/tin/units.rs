//! Names of the units of a coordinate reference system, as far as the input tells.

use crate::geom::Crs;

/// GeoKey ProjLinearUnits (OGC GeoTIFF 1.1, table of keys).
const PROJ_LINEAR_UNITS: u16 = 3076;

/// The unit of x and y.
pub(in crate::pipeline) fn horizontal_unit(crs: &Crs) -> &'static str {
    match (crs.geographic, linear_unit(crs)) {
        (Some(true), _) => "degree",
        (_, Some(unit)) => unit,
        _ => "units",
    }
}

/// The unit of the heights.
pub(in crate::pipeline) fn vertical_unit(crs: &Crs) -> Option<&str> {
    crs.vertical_unit.as_deref().map(str::trim).filter(|unit| !unit.is_empty())
}

fn linear_unit(crs: &Crs) -> Option<&'static str> {
    match short_key(&crs.geo_keys, PROJ_LINEAR_UNITS).or_else(|| utm_unit(crs.epsg?))? {
        9001 => Some("metre"),
        9002 => Some("foot"),
        9003 => Some("US survey foot"),
        _ => None,
    }
}

/// The UTM zones of WGS 84, north and south, are in metres.
fn utm_unit(epsg: u32) -> Option<u16> {
    matches!(epsg, 32601..=32660 | 32701..=32760).then_some(9001)
}

/// Value of a key that is stored in the directory itself: entries of four after a header of four.
fn short_key(keys: &[u16], wanted: u16) -> Option<u16> {
    let entries = keys.get(4..)?.chunks_exact(4);
    let mut found = entries.filter(|entry| entry[0] == wanted && entry[1] == 0);
    found.next().map(|entry| entry[3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_come_from_keys_codes_or_stay_unknown() {
        let geo_keys = vec![1, 1, 0, 1, PROJ_LINEAR_UNITS, 0, 1, 9003];
        assert_eq!(horizontal_unit(&Crs { geo_keys, ..Crs::default() }), "US survey foot");
        assert_eq!(horizontal_unit(&Crs { epsg: Some(32611), ..Crs::default() }), "metre");
        assert_eq!(horizontal_unit(&Crs { geographic: Some(true), ..Crs::default() }), "degree");
        assert_eq!(horizontal_unit(&Crs { geo_keys: vec![1, 1], ..Crs::default() }), "units");
        assert_eq!(vertical_unit(&Crs::default()), None);
    }
}
