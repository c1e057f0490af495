//! What is known of a coordinate reference system, carried from input to output.

use serde::{Deserialize, Serialize};

use super::wkt;

/// GeoKey of the unit of projected coordinates.
const PROJECTED_LINEAR_UNITS: u16 = 3076;
/// GeoKey of what raster positions mean: maps account for it.
const RASTER_TYPE: u16 = 1025;

/// A coordinate reference system as found in a file. Equality is of what the file said.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Crs {
    /// EPSG code of the horizontal (or compound) system.
    pub epsg: Option<u32>,
    /// EPSG code of the vertical system.
    pub vertical_epsg: Option<u32>,
    /// Human-readable name (GeoTIFF citation, first name of a WKT).
    pub citation: Option<String>,
    /// Well-known text, where the file had it (a `.prj` sidecar).
    pub wkt: Option<String>,
    /// True for latitude/longitude.
    pub geographic: Option<bool>,
    /// Unit of z, when the file says it ("metre", "foot", ...).
    pub vertical_unit: Option<String>,
    /// The unit of z as the file spells it ("m", "METERS"), so that a copy spells it alike; `None`
    /// where `vertical_unit` is that spelling.
    pub vertical_unit_text: Option<String>,
    /// Raw GeoKeyDirectory (tag 34735), kept so that a GeoTIFF copy carries it unchanged.
    pub geo_keys: Vec<u16>,
    /// Raw GeoDoubleParams (tag 34736).
    pub geo_doubles: Vec<f64>,
    /// Raw GeoAsciiParams (tag 34737).
    pub geo_ascii: String,
}

impl Crs {
    /// One line for people and for mesh comments: "EPSG:32611 (WGS 84 / UTM zone 11N)".
    pub fn label(&self) -> String {
        match (self.epsg, &self.citation) {
            (Some(code), Some(name)) => format!("EPSG:{code} ({name})"),
            (Some(code), None) => format!("EPSG:{code}"),
            (None, Some(name)) => name.clone(),
            (None, None) => "unknown".to_owned(),
        }
    }

    /// Unit of x and y: "degree", "metre", "foot", "US survey foot", or "unit" when unknown.
    pub fn horizontal_unit(&self) -> &'static str {
        match (self.geographic, self.geo_key(PROJECTED_LINEAR_UNITS)) {
            (Some(true), _) => "degree",
            (_, Some(9001)) => "metre",
            (_, Some(9002)) => "foot",
            (_, Some(9003)) => "US survey foot",
            _ => self.unit_of_wkt().unwrap_or("unit"),
        }
    }

    /// A short value of the GeoKeyDirectory: entries of four, after a header of four.
    fn geo_key(&self, key: u16) -> Option<u16> {
        let entries = self.geo_keys.get(4..)?.chunks_exact(4);
        entries.filter(|e| e[0] == key && e[1] == 0).map(|e| e[3]).next()
    }

    fn unit_of_wkt(&self) -> Option<&'static str> {
        let known = self.epsg.and_then(|code| crs_definitions::from_code(code.try_into().ok()?));
        wkt::horizontal_unit(self.wkt.as_deref().or(known.map(|system| system.wkt))?)
    }

    /// Whether two systems are one, as far as the files tell.
    pub fn agrees(&self, other: &Self) -> bool {
        if let (Some(a), Some(b)) = (self.vertical_epsg, other.vertical_epsg)
            && a != b
        {
            return false;
        }
        match (self.epsg, other.epsg) {
            (Some(a), Some(b)) => a == b,
            (None, None) if !self.geo_keys.is_empty() && !other.geo_keys.is_empty() => {
                self.keys().eq(other.keys())
                    && self.geo_doubles == other.geo_doubles
                    && self.citation == other.citation
            }
            (None, None) => {
                (&self.wkt, &self.citation, self.geographic)
                    == (&other.wkt, &other.citation, other.geographic)
            }
            _ => false,
        }
    }

    /// The GeoKeys that hold their value, but for what raster positions mean.
    fn keys(&self) -> impl Iterator<Item = &[u16]> {
        let entries = self.geo_keys.get(4..).unwrap_or_default().chunks_exact(4);
        entries.filter(|entry| entry[0] != RASTER_TYPE && entry[1] == 0)
    }

    /// True when nothing at all is known.
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_comes_from_keys_text_or_code() {
        let degrees = Crs { geographic: Some(true), ..Crs::default() };
        assert_eq!(degrees.horizontal_unit(), "degree");
        let keys = Crs { geo_keys: vec![1, 1, 0, 1, 3076, 0, 1, 9003], ..Crs::default() };
        assert_eq!(keys.horizontal_unit(), "US survey foot");
        let wkt = r#"PROJCS["x",GEOGCS["y",UNIT["Degree",0.017]],UNIT["Foot_US",0.3048]]"#;
        let text = Crs { wkt: Some(wkt.to_owned()), ..Crs::default() };
        assert_eq!(text.horizontal_unit(), "US survey foot");
        assert_eq!(Crs { epsg: Some(32611), ..Crs::default() }.horizontal_unit(), "metre");
        assert_eq!(Crs::default().horizontal_unit(), "unit");
    }
}
