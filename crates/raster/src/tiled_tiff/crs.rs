//! GeoKeys of a store: copied from the source, or generated from its CRS.

use super::tags::{TiffTagValues, tag};
use terrane_base::geom::{Crs, is_geographic};

/// Key numbers and values of the OGC GeoTIFF standard 1.1 (19-008r4).
mod key {
    pub(super) const MODEL_TYPE: u16 = 1024;
    pub(super) const RASTER_TYPE: u16 = 1025;
    pub(super) const GEODETIC_CRS: u16 = 2048;
    pub(super) const PROJECTED_CRS: u16 = 3072;
    pub(super) const PROJECTED_CITATION: u16 = 3073;
    pub(super) const VERTICAL_CRS: u16 = 4096;
    pub(super) const PROJECTED: u16 = 1;
    pub(super) const GEOGRAPHIC: u16 = 2;
    pub(super) const PIXEL_IS_AREA: u16 = 1;
    pub(super) const PIXEL_IS_POINT: u16 = 2;
    pub(super) const USER_DEFINED: u16 = 32_767;
}

/// The three GeoKey tags; all empty if the CRS is unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GeoKeyTags {
    pub(crate) directory: Vec<u16>,
    pub(super) doubles: Vec<f64>,
    pub(super) ascii: String,
}

impl GeoKeyTags {
    /// The keys of `crs`, with PixelIsPoint or PixelIsArea.
    pub(crate) fn of(crs: &Crs, point: bool) -> Self {
        let raster_type = if point { key::PIXEL_IS_POINT } else { key::PIXEL_IS_AREA };
        if crs.geo_keys.len() >= 4 {
            let directory = citation_keys(raster_type, &crs.geo_keys);
            let ascii = crs.geo_ascii.trim_end_matches('\0').replace('\0', " ");
            return Self { directory, doubles: crs.geo_doubles.clone(), ascii };
        }
        Self::made(crs, raster_type)
    }

    /// True for PixelIsPoint.
    pub(super) fn is_point(&self) -> bool {
        self.directory
            .chunks_exact(4)
            .skip(1)
            .any(|entry| matches!(entry, [key::RASTER_TYPE, 0, _, key::PIXEL_IS_POINT]))
    }

    fn made(crs: &Crs, raster_type: u16) -> Self {
        let epsg = crs.epsg.and_then(|code| u16::try_from(code).ok());
        match (epsg, crs.to_wkt()) {
            (Some(code), _) => Self::by_code(code, crs, raster_type),
            (None, Some(wkt)) => Self::by_text(&wkt, raster_type),
            (None, None) if raster_type == key::PIXEL_IS_POINT => Self::by_type(raster_type),
            (None, None) => Self::default(),
        }
    }

    /// Only the raster type.
    fn by_type(raster_type: u16) -> Self {
        let directory = directory(&[[key::RASTER_TYPE, 0, 1, raster_type]]);
        Self { directory, ..Self::default() }
    }

    fn by_code(code: u16, crs: &Crs, raster_type: u16) -> Self {
        let geographic = crs.geographic.unwrap_or_else(|| may_be_geographic(code));
        let (model, system) = match geographic {
            true => (key::GEOGRAPHIC, key::GEODETIC_CRS),
            false => (key::PROJECTED, key::PROJECTED_CRS),
        };
        let mut entries = vec![
            [key::MODEL_TYPE, 0, 1, model],
            [key::RASTER_TYPE, 0, 1, raster_type],
            [system, 0, 1, code],
        ];
        let vertical = crs.vertical_epsg.and_then(|code| u16::try_from(code).ok());
        entries.extend(vertical.map(|code| [key::VERTICAL_CRS, 0, 1, code]));
        Self { directory: directory(&entries), ..Self::default() }
    }

    /// WKT without a code is stored in the citation in ESRI's form, where GDAL reads it if the model is
    /// user-defined.
    fn by_text(wkt: &str, raster_type: u16) -> Self {
        let ascii = format!("ESRI PE String = {}|", wkt.replace('\0', " "));
        let Ok(length) = u16::try_from(ascii.len()) else { return Self::default() };
        let entries = [
            [key::MODEL_TYPE, 0, 1, key::USER_DEFINED],
            [key::RASTER_TYPE, 0, 1, raster_type],
            [key::PROJECTED_CITATION, tag::GEO_ASCII, length, 0],
        ];
        let mut directory = directory(&entries);
        directory[2] = u16::from(wkt.contains("VERT_CS"));
        Self { directory, doubles: Vec::new(), ascii }
    }

    pub(crate) fn tags(&self) -> Vec<(u16, TiffTagValues)> {
        let mut tags = Vec::new();
        if !self.directory.is_empty() {
            tags.push((tag::GEO_KEYS, TiffTagValues::Short(self.directory.clone())));
        }
        if !self.doubles.is_empty() {
            tags.push((tag::GEO_DOUBLES, TiffTagValues::Double(self.doubles.clone())));
        }
        if !self.ascii.is_empty() {
            tags.push((tag::GEO_ASCII, TiffTagValues::Ascii(self.ascii.clone())));
        }
        tags
    }
}

/// Adds GeoKeys to a CRS that is known by its code only.
pub fn complete(crs: Crs) -> Crs {
    let GeoKeyTags { directory, doubles, ascii } = GeoKeyTags::of(&crs, false);
    Crs { geo_keys: directory, geo_doubles: doubles, geo_ascii: ascii, ..crs }
}

/// The keys of a source with the given raster type. Sources without one are PixelIsArea.
fn citation_keys(raster_type: u16, keys: &[u16]) -> Vec<u16> {
    let mut keys = keys.to_vec();
    let mut entries = keys.chunks_exact_mut(4).skip(1);
    match entries.find(|entry| matches!(entry, [key::RASTER_TYPE, 0, ..])) {
        Some(entry) => entry[3] = raster_type,
        None if raster_type == key::PIXEL_IS_POINT => {
            let known =
                keys.chunks_exact(4).skip(1).take_while(|e| e[0] < key::RASTER_TYPE).count();
            let at = 4 + 4 * known;
            keys.splice(at..at, [key::RASTER_TYPE, 0, 1, raster_type]);
            keys[3] = keys[3].saturating_add(1);
        }
        None => {}
    }
    keys
}

/// Key directory, of revision 1.1 (2019) if there is a vertical CRS: GDAL ignores it in older ones.
fn directory(entries: &[[u16; 4]]) -> Vec<u16> {
    let is_high = entries.iter().any(|entry| entry[0] == key::VERTICAL_CRS);
    let mut directory = vec![1, 1, is_high.into(), entries.len() as u16];
    directory.extend(entries.concat());
    directory
}

/// Codes from 4000 to 4999 are assumed to be geographic.
fn may_be_geographic(code: u16) -> bool {
    is_geographic(code.into()).unwrap_or((4000..5000).contains(&code))
}
