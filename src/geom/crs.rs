//! What is known of a coordinate reference system, carried from input to output.

/// A coordinate reference system as found in a file. Equality is of what the file said.
#[derive(Clone, Debug, Default, PartialEq)]
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

    /// True when nothing at all is known.
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }
}
