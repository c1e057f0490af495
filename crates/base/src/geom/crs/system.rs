//! A coordinate reference system as found in a file.

use super::unit::plain;
use serde::{Deserialize, Serialize};

/// GeoKey of what raster positions mean: maps account for it.
pub(super) const RASTER_TYPE: u16 = 1025;

/// A coordinate reference system as found in a file. Equality is of what the file said; whether two
/// are one system is for [`agrees`](Crs::agrees) to tell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Crs {
    /// EPSG code of the horizontal system, where it is that system: none where units are overridden.
    pub epsg: Option<u32>,
    /// EPSG code of the vertical system, likewise.
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
    /// Unit of z by the name that it was given; `None` where it has none.
    pub fn heights_unit(&self) -> Option<&str> {
        self.vertical_unit.as_deref().map(str::trim).filter(|unit| !unit.is_empty())
    }

    /// The same in what the files say, where it is not known what that means.
    pub(super) fn says_the_same(&self, other: &Self) -> bool {
        if !self.geo_keys.is_empty() && !other.geo_keys.is_empty() {
            return self.keys().eq(other.keys())
                && self.geo_doubles == other.geo_doubles
                && self.geo_ascii == other.geo_ascii;
        }
        let plain = |text: &Option<String>| text.as_deref().map(plain);
        plain(&self.wkt) == plain(&other.wkt)
            && (&self.citation, self.geographic) == (&other.citation, other.geographic)
    }

    /// The GeoKeys that hold their value, but for what raster positions mean.
    pub(super) fn keys(&self) -> impl Iterator<Item = &[u16]> {
        let entries = self.geo_keys.get(4..).unwrap_or_default().chunks_exact(4);
        entries.filter(|entry| entry[0] != RASTER_TYPE && entry[1] == 0)
    }

    /// True when nothing at all is known.
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }

    /// True when the file says where on Earth x and y are, or at least what they are called.
    pub fn is_named(&self) -> bool {
        self.epsg.is_some()
            || self.vertical_epsg.is_some()
            || self.citation.is_some()
            || self.wkt.is_some()
            || self.geographic.is_some()
            || self.keys().next().is_some()
    }
}
