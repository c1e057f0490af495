//! The CRS of a file.

use super::unit::plain;
use serde::{Deserialize, Serialize};

/// GeoKey of the raster type (PixelIsArea, PixelIsPoint); [`Affine`](crate::geom::Affine) accounts for it.
pub(super) const RASTER_TYPE: u16 = 1025;

/// The CRS of a file. Equality compares the definitions; [`agrees`](Crs::agrees) compares their meaning.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Crs {
    /// EPSG code of the horizontal CRS; `None` if units are overridden.
    pub epsg: Option<u32>,
    /// EPSG code of the vertical CRS; `None` if units are overridden.
    pub vertical_epsg: Option<u32>,
    /// Human-readable name (GeoTIFF citation, first name of a WKT).
    pub citation: Option<String>,
    /// WKT, if the file had it (a `.prj` sidecar).
    pub wkt: Option<String>,
    /// True for latitude/longitude.
    pub geographic: Option<bool>,
    /// Unit of z, if stated ("metre", "foot", ...).
    pub vertical_unit: Option<String>,
    /// Unit of z as spelled in the file ("m", "METERS"), for exact copies; `None` if equal to `vertical_unit`.
    pub vertical_unit_text: Option<String>,
    /// Raw GeoKeyDirectory (tag 34735), kept so that a GeoTIFF copy carries it unchanged.
    pub geo_keys: Vec<u16>,
    /// Raw GeoDoubleParams (tag 34736).
    pub geo_doubles: Vec<f64>,
    /// Raw GeoAsciiParams (tag 34737).
    pub geo_ascii: String,
}

impl Crs {
    /// Name of the unit of z; `None` if not stated.
    pub fn heights_unit(&self) -> Option<&str> {
        self.vertical_unit.as_deref().map(str::trim).filter(|unit| !unit.is_empty())
    }

    /// Compares the texts of two definitions whose meaning is unknown.
    pub(super) fn says_the_same(&self, other: &Self) -> bool {
        if !self.geo_keys.is_empty() && !other.geo_keys.is_empty() {
            return self.keys().eq(other.keys())
                && self.geo_doubles == other.geo_doubles
                && self.geo_ascii == other.geo_ascii;
        }
        let [own, others] = [self, other].map(|crs| crs.wkt.as_deref().map(plain));
        own == others && (&self.citation, self.geographic) == (&other.citation, other.geographic)
    }

    /// The GeoKeys with inline values, except the raster type.
    pub(super) fn keys(&self) -> impl Iterator<Item = &[u16]> {
        let entries = self.geo_keys.get(4..).unwrap_or_default().chunks_exact(4);
        entries.filter(|entry| entry[0] != RASTER_TYPE && entry[1] == 0)
    }

    /// True when nothing at all is known.
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }

    /// True if the file states a CRS, or at least a name of one.
    pub fn is_named(&self) -> bool {
        self.epsg.is_some()
            || self.vertical_epsg.is_some()
            || self.citation.is_some()
            || self.wkt.is_some()
            || self.geographic.is_some()
            || self.keys().next().is_some()
    }
}
