//! GeoKeys to a coordinate reference system: codes, names and units; the raw keys are kept.
//! GeoTIFF 1.1 (OGC 19-008r4) section 7.1.2.

use super::{Crs, wkt};

/// The tag that texts lie in.
const GEO_ASCII_PARAMS: u16 = 34_737;
const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const CITATION: u16 = 1026;
const GEODETIC_CRS: u16 = 2048;
const GEODETIC_CITATION: u16 = 2049;
const PROJECTED_CRS: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const VERTICAL_CRS: u16 = 4096;
const VERTICAL_UNITS: u16 = 4099;
/// Before well-known text that stands where a name does, because the system has no code.
const ESRI_TEXT: &str = "ESRI PE String = ";

/// The key directory and its parameter tags.
#[derive(Clone, Debug, Default)]
pub struct GeoKeys {
    raw: Vec<u16>,
    doubles: Vec<f64>,
    ascii: String,
}

impl GeoKeys {
    /// From the key directory and its parameters; damaged keys are skipped one by one.
    pub fn new(raw: Vec<u16>, doubles: Vec<f64>, ascii: String) -> Self {
        Self { raw, doubles, ascii }
    }

    /// True when raster positions mean samples (PixelIsPoint), not cell corners.
    pub fn pixel_is_point(&self) -> bool {
        self.short(RASTER_TYPE) == Some(2)
    }

    /// What the keys say, with the raw keys kept.
    pub fn into_crs(self) -> Crs {
        let geographic = self.geographic();
        let horizontal = if geographic == Some(true) { GEODETIC_CRS } else { PROJECTED_CRS };
        let epsg = self.code(horizontal).or_else(|| self.geocentric_code());
        let in_3d = self.geographic_3d_code();
        let citation = self.citation(geographic);
        let named = citation.as_deref().and_then(|text| text.strip_prefix(ESRI_TEXT));
        let named =
            named.map_or(Crs { citation: citation.clone(), ..Crs::default() }, wkt::from_text);
        Crs {
            epsg: in_3d.or(epsg).or(named.epsg),
            vertical_epsg: self.code(VERTICAL_CRS).filter(|_| in_3d.is_none()),
            citation: named.citation,
            wkt: named.wkt,
            geographic: geographic.or(named.geographic),
            vertical_unit: self.short(VERTICAL_UNITS).and_then(unit_name).map(str::to_owned),
            vertical_unit_text: None,
            geo_keys: self.raw,
            geo_doubles: self.doubles,
            geo_ascii: self.ascii,
        }
    }

    /// By the model type, or by which code is present.
    fn geographic(&self) -> Option<bool> {
        match self.short(MODEL_TYPE) {
            Some(1 | 3) => Some(false),
            Some(2) => Some(true),
            _ if self.short(PROJECTED_CRS).is_some() => Some(false),
            _ if self.short(GEODETIC_CRS).is_some() => Some(true),
            _ => None,
        }
    }

    fn geocentric_code(&self) -> Option<u32> {
        (self.short(MODEL_TYPE) == Some(3)).then(|| self.code(GEODETIC_CRS)).flatten()
    }

    /// Files of latitude, longitude and ellipsoidal height put the code of the 3D system where that
    /// of a vertical one belongs. No vertical system has a code in this range.
    fn geographic_3d_code(&self) -> Option<u32> {
        let code = self.code(VERTICAL_CRS).filter(|code| (4883..=4999).contains(code));
        if self.geographic() == Some(true) { code } else { None }
    }

    fn citation(&self, geographic: Option<bool>) -> Option<String> {
        let own = if geographic == Some(true) { GEODETIC_CITATION } else { PROJECTED_CITATION };
        [CITATION, own, GEODETIC_CITATION].iter().find_map(|key| self.text(*key))
    }

    /// Keys as (id, location, count, value).
    fn keys(&self) -> impl Iterator<Item = (u16, u16, u16, u16)> + '_ {
        let keys = self.raw.chunks_exact(4).skip(1);
        let count = usize::from(self.raw.get(3).copied().unwrap_or(0));
        keys.take(count).map(|k| (k[0], k[1], k[2], k[3]))
    }

    /// A value stored in the directory itself.
    fn short(&self, id: u16) -> Option<u16> {
        self.keys().find(|k| k.0 == id && k.1 == 0).map(|k| k.3)
    }

    /// An EPSG code: 32767 is "user-defined" and 0 "undefined".
    fn code(&self, id: u16) -> Option<u32> {
        self.short(id).filter(|code| !matches!(code, 0 | 32767..)).map(u32::from)
    }

    fn text(&self, id: u16) -> Option<String> {
        let (_, _, count, first) = self.keys().find(|k| k.0 == id && k.1 == GEO_ASCII_PARAMS)?;
        let first = usize::from(first);
        let bytes = self.ascii.as_bytes().get(first..)?;
        let bytes = &bytes[..bytes.len().min(usize::from(count))];
        let text = String::from_utf8_lossy(bytes);
        let text = text.trim_end_matches(['|', '\0']).trim();
        (!text.is_empty()).then(|| text.to_owned())
    }
}

/// Name of an EPSG length unit.
fn unit_name(code: u16) -> Option<&'static str> {
    Some(match code {
        9001 => "metre",
        9002 => "foot",
        9003 => "US survey foot",
        9014 => "fathom",
        9036 => "kilometre",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(raw: &[u16], ascii: &str) -> GeoKeys {
        GeoKeys { raw: raw.to_vec(), doubles: Vec::new(), ascii: ascii.to_owned() }
    }

    #[test]
    fn projected_with_vertical() {
        let raw = [
            1, 1, 0, 6, 1024, 0, 1, 1, 1025, 0, 1, 2, 1026, 34737, 22, 0, 3072, 0, 1, 32611, 4096,
            0, 1, 5703, 4099, 0, 1, 9001,
        ];
        let keys = keys(&raw, "WGS 84 / UTM zone 11N|rest|");
        assert!(keys.pixel_is_point());
        let crs = keys.into_crs();
        assert_eq!((crs.epsg, crs.vertical_epsg), (Some(32611), Some(5703)));
        assert_eq!(crs.label(), "EPSG:32611 (WGS 84 / UTM zone 11N)");
        assert_eq!(crs.geographic, Some(false));
        assert_eq!(crs.vertical_unit.as_deref(), Some("metre"));
        assert_eq!(crs.geo_keys, raw);
    }

    #[test]
    fn well_known_text_in_the_citation() {
        let text = r#"ESRI PE String = PROJCS["mine",GEOGCS["x"]]|"#;
        let length = text.len() as u16;
        let raw = [1, 1, 0, 2, 1024, 0, 1, 32_767, 3073, 34_737, length, 0];
        let crs = keys(&raw, text).into_crs();
        assert_eq!((crs.citation.as_deref(), crs.geographic), (Some("mine"), Some(false)));
        assert_eq!(crs.wkt.as_deref(), Some(r#"PROJCS["mine",GEOGCS["x"]]"#));
    }

    #[test]
    fn user_defined_codes_are_no_codes() {
        let crs = keys(&[1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 32767], "").into_crs();
        assert_eq!((crs.epsg, crs.geographic), (None, Some(true)));
    }

    #[test]
    fn a_3d_system_in_the_vertical_key() {
        let raw = [1, 1, 1, 3, 1024, 0, 1, 2, 2048, 0, 1, 4258, 4096, 0, 1, 4937];
        let crs = keys(&raw, "").into_crs();
        assert_eq!((crs.epsg, crs.vertical_epsg), (Some(4937), None));
    }

    #[test]
    fn damaged_keys_say_nothing() {
        for raw in [&[][..], &[1], &[1, 1, 0, 9], &[1, 1, 0, 9, 1026, 34737, 9, 9, 7]] {
            let crs = keys(raw, "abc").into_crs();
            assert_eq!((crs.epsg, crs.citation), (None, None));
        }
    }
}
