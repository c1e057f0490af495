//! Names of the units of a coordinate reference system, as far as the input tells.

use terrane_base::geom::Crs;

/// The unit of x and y.
pub(crate) fn horizontal_unit(crs: &Crs) -> &'static str {
    match crs.horizontal_unit() {
        "unit" => "units",
        unit => unit,
    }
}

/// The unit of the heights.
pub(crate) fn vertical_unit(crs: &Crs) -> Option<&str> {
    crs.vertical_unit.as_deref().map(str::trim).filter(|unit| !unit.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_come_from_keys_codes_or_stay_unknown() {
        let geo_keys = vec![1, 1, 0, 1, 3076, 0, 1, 9003];
        assert_eq!(horizontal_unit(&Crs { geo_keys, ..Crs::default() }), "US survey foot");
        assert_eq!(horizontal_unit(&Crs { epsg: Some(32611), ..Crs::default() }), "metre");
        assert_eq!(horizontal_unit(&Crs { geographic: Some(true), ..Crs::default() }), "degree");
        assert_eq!(horizontal_unit(&Crs { geo_keys: vec![1, 1], ..Crs::default() }), "units");
        assert_eq!(vertical_unit(&Crs::default()), None);
    }
}
