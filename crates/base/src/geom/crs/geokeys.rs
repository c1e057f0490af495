//! GeoKeys to CRS: codes, names and units; raw keys are kept. GeoTIFF 1.1 (OGC 19-008r4), section 7.1.2.

use super::definition::{EpsgName, GeographicCrs, Horizontal, Projected, VerticalCrs, value_of};
use super::method::{ProjectionMethod, ProjectionParameter};
use super::system::{Crs, RASTER_TYPE};
use super::unit::LengthUnit;
use super::{codes, vertical, wkt};

/// Tags of the double and ASCII parameters.
const GEO_DOUBLE_PARAMS: u16 = 34_736;
const GEO_ASCII_PARAMS: u16 = 34_737;
const MODEL_TYPE: u16 = 1024;
const CITATION: u16 = 1026;
const GEODETIC_CRS: u16 = 2048;
const GEODETIC_CITATION: u16 = 2049;
const DATUM: u16 = 2050;
const PRIME_MERIDIAN: u16 = 2051;
const ANGULAR_UNITS: u16 = 2054;
const ELLIPSOID: u16 = 2056;
const SEMI_MAJOR_AXIS: u16 = 2057;
const SEMI_MINOR_AXIS: u16 = 2058;
const INVERSE_FLATTENING: u16 = 2059;
const PRIME_MERIDIAN_LONGITUDE: u16 = 2061;
const PROJECTED_CRS: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const PROJECTION: u16 = 3074;
const METHOD: u16 = 3075;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
const VERTICAL_CRS: u16 = 4096;
const VERTICAL_UNITS: u16 = 4099;
/// Key value "user-defined": other keys give the definition.
const USER_DEFINED: u16 = 32_767;
/// Prefix of WKT in a citation, written for CRSs without a code.
const ESRI_TEXT: &str = "ESRI PE String = ";
/// Projection method of UTM zones, and their common parameters.
const TRANSVERSE_MERCATOR: u16 = 1;

/// The key directory and its parameter tags.
#[derive(Clone, Debug, Default)]
pub struct GeoKeys {
    raw: Vec<u16>,
    doubles: Vec<f64>,
    ascii: String,
}

impl GeoKeys {
    /// From the key directory and its parameters; damaged keys are skipped.
    pub fn new(raw: Vec<u16>, doubles: Vec<f64>, ascii: String) -> Self {
        Self { raw, doubles, ascii }
    }

    /// The keys of `crs`.
    pub(super) fn of(crs: &Crs) -> Self {
        Self::new(crs.geo_keys.clone(), crs.geo_doubles.clone(), crs.geo_ascii.clone())
    }

    /// True when raster positions mean samples (PixelIsPoint), not cell corners.
    pub fn pixel_is_point(&self) -> bool {
        self.short(RASTER_TYPE) == Some(2)
    }

    /// The CRS with its raw keys. A code is dropped if its unit is overridden.
    pub fn into_crs(self) -> Crs {
        let geographic = self.geographic();
        let horizontal = if geographic == Some(true) { GEODETIC_CRS } else { PROJECTED_CRS };
        let own = self.code(horizontal).filter(|code| self.unit_is_that_of(*code));
        let epsg = own.or_else(|| self.geocentric_code());
        let in_3d = self.geographic_3d_code();
        let named = match self.esri_text() {
            Some(text) => wkt::from_text(&text),
            None => Crs { citation: self.citation(geographic), ..Crs::default() },
        };
        // Beside WKT, keys may describe only a part of the CRS.
        let geographic = named.geographic.or(geographic);
        let vertical = self.vertical();
        let ellipsoidal = in_3d.map(|_| "metre".to_owned());
        Crs {
            epsg: in_3d.or(epsg).or(named.epsg),
            vertical_epsg: match &vertical {
                Some(own) => own.code,
                None => self.vertical_code(),
            }
            .or(named.vertical_epsg),
            citation: named.citation,
            wkt: named.wkt,
            geographic,
            vertical_unit: vertical
                .map(|own| own.unit)
                .or_else(|| self.vertical_unit())
                .map(|unit| unit.name)
                .or(named.vertical_unit)
                .or(ellipsoidal),
            vertical_unit_text: None,
            geo_keys: self.raw,
            geo_doubles: self.doubles,
            geo_ascii: self.ascii,
        }
    }

    /// By the model type, or by the codes present.
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

    /// Files with latitude, longitude and ellipsoidal height put the code of the 3D CRS in the key of the vertical
    /// CRS. No vertical CRS has a code in this range.
    fn geographic_3d_code(&self) -> Option<u32> {
        let code = self.code(VERTICAL_CRS).filter(|code| (4883..=4999).contains(code));
        let own = self
            .code(GEODETIC_CRS)
            .filter(|code| codes::geographic(*code).is_some_and(|geographic| geographic.is_3d));
        if self.geographic() == Some(true) { code.or(own) } else { None }
    }

    fn vertical_code(&self) -> Option<u32> {
        self.code(VERTICAL_CRS).filter(|_| self.geographic_3d_code().is_none())
    }

    fn vertical_unit(&self) -> Option<LengthUnit> {
        self.short(VERTICAL_UNITS).and_then(LengthUnit::of_code)
    }

    /// The vertical CRS, in the unit of the keys; without a name if the keys state only a unit.
    pub(super) fn vertical(&self) -> Option<VerticalCrs> {
        let Some(code) = self.vertical_code() else {
            let datum = EpsgName { name: unknown(), code: None };
            let unit = self.vertical_unit().filter(|_| self.geographic() == Some(false))?;
            return Some(VerticalCrs { name: unknown(), code: None, datum, unit, is_down: false });
        };
        let known = vertical::by_code(code)?;
        let unit = self.vertical_unit().unwrap_or_else(|| known.unit.clone());
        let code = known.code.filter(|_| known.unit.is(&unit));
        Some(VerticalCrs { code, unit, ..known })
    }

    fn citation(&self, geographic: Option<bool>) -> Option<String> {
        let own = if geographic == Some(true) { GEODETIC_CITATION } else { PROJECTED_CITATION };
        let named = [CITATION, own, GEODETIC_CITATION].iter().find_map(|key| self.text(*key))?;
        Some(named.strip_prefix("PCS Name = ").map_or(named.clone(), str::to_owned))
    }

    /// WKT of a CRS that GeoKeys cannot express.
    fn esri_text(&self) -> Option<String> {
        let texts = [PROJECTED_CITATION, CITATION, GEODETIC_CITATION].map(|key| self.text(key));
        let mut texts = texts.iter().flatten();
        texts.find_map(|text| text.strip_prefix(ESRI_TEXT)).map(str::to_owned)
    }

    /// True unless the keys state another linear unit than the CRS with `code`.
    fn unit_is_that_of(&self, code: u32) -> bool {
        match (self.linear_unit(), codes::horizontal(code)) {
            (Some(unit), Some(Horizontal::Projected(known))) => known.unit.is(&unit),
            _ => true,
        }
    }

    pub(super) fn linear_unit(&self) -> Option<LengthUnit> {
        match self.short(LINEAR_UNITS)? {
            USER_DEFINED => {
                let size = self.double(LINEAR_UNIT_SIZE).filter(|size| *size > 0.0)?;
                Some(LengthUnit { name: "user-defined".to_owned(), size })
            }
            code => LengthUnit::of_code(code),
        }
    }

    /// The horizontal CRS; `None` if unknown.
    pub(super) fn horizontal(&self) -> Option<Horizontal> {
        match self.geographic() {
            Some(true) => {
                let code = self.geographic_3d_code();
                code.and_then(codes::geographic).or_else(|| self.base()).map(Horizontal::Geographic)
            }
            Some(false) if self.short(MODEL_TYPE) != Some(3) => {
                self.projected().map(Horizontal::Projected)
            }
            Some(false) => None,
            None => {
                let name = self.text(CITATION).unwrap_or_else(unknown);
                self.linear_unit().map(|unit| Horizontal::Local { name, unit })
            }
        }
    }

    fn projected(&self) -> Option<Projected> {
        let named = self.code(PROJECTED_CRS);
        if let Some(known) = named {
            let Horizontal::Projected(known) = codes::horizontal(known)? else { return None };
            let unit = self.linear_unit().filter(|unit| !known.unit.is(unit));
            return Some(unit.map_or(known.clone(), |unit| known.in_unit(unit)));
        }
        let unit = match self.short(LINEAR_UNITS) {
            Some(_) => self.linear_unit()?,
            None => LengthUnit::metre(),
        };
        let name = self.citation(Some(false)).unwrap_or_else(unknown);
        let name = EpsgName { name, code: None };
        if let Some(zone) = self.utm_zone() {
            let method = ProjectionMethod::of_code(TRANSVERSE_MERCATOR, |_| false)?;
            let (base, metre) = (self.base()?, LengthUnit::metre());
            let known = Projected::new(name, base, method, |role| value_of(&zone, role), metre)?;
            return Some(known.in_unit(unit));
        }
        let method = self.short(METHOD)?;
        let method = ProjectionMethod::of_code(method, |role| self.parameter(role).is_some())?;
        Projected::new(name, self.base()?, method, |role| self.parameter(role), unit)
    }

    /// Parameter of the projection, by the first of its keys that is present.
    fn parameter(&self, role: ProjectionParameter) -> Option<f64> {
        role.keys().iter().find_map(|key| self.double(*key))
    }

    /// Parameters of a UTM zone that the keys name by code only.
    fn utm_zone(&self) -> Option<[(ProjectionParameter, f64); 4]> {
        let code = self.short(PROJECTION)?;
        let (zone, north) = match code {
            16_001..=16_060 => (code - 16_000, 0.0),
            16_101..=16_160 => (code - 16_100, 10_000_000.0),
            _ => return None,
        };
        Some([
            (ProjectionParameter::Longitude, 6.0 * f64::from(zone) - 183.0),
            (ProjectionParameter::Scale, 0.9996),
            (ProjectionParameter::Easting, 500_000.0),
            (ProjectionParameter::Northing, north),
        ])
    }

    /// The geographic CRS: by its code, by the code of its datum, or by its ellipsoid.
    fn base(&self) -> Option<GeographicCrs> {
        if !self.is_in_degrees() {
            return None;
        }
        if let Some(code) = self.code(GEODETIC_CRS) {
            return codes::geographic(code);
        }
        let known = match self.code(DATUM) {
            Some(code) => codes::geographic_with(|known| known.datum.code == Some(code))?,
            None => self.figure()?,
        };
        let from_greenwich = self.meridian()?;
        let name = self.part_of_citation("GCS Name").or_else(|| self.text(GEODETIC_CITATION));
        let meridian = self.part_of_citation("Primem").filter(|_| from_greenwich != 0.0);
        Some(GeographicCrs {
            name: name.unwrap_or_else(unknown),
            code: None,
            meridian: meridian.unwrap_or_else(|| "Greenwich".to_owned()),
            from_greenwich,
            is_3d: false,
            ..known
        })
    }

    /// A geographic CRS with an unknown datum on the ellipsoid of the keys.
    fn figure(&self) -> Option<GeographicCrs> {
        let code = self.code(ELLIPSOID);
        let known =
            code.and_then(|code| codes::geographic_with(|own| own.ellipsoid.code == Some(code)));
        let (axis, flattening) = match (self.axes(), &known) {
            (Some(axes), _) => axes,
            (None, Some(known)) => (known.axis, known.flattening),
            (None, None) => return None,
        };
        let named = self.part_of_citation("Ellipsoid").unwrap_or_else(unknown);
        let ellipsoid = known.map_or(EpsgName { name: named, code: None }, |known| known.ellipsoid);
        let datum = self.part_of_citation("Datum").unwrap_or_else(unknown);
        Some(GeographicCrs {
            name: String::new(),
            code: None,
            datum: EpsgName { name: datum, code: None },
            ellipsoid,
            axis,
            flattening,
            meridian: String::new(),
            from_greenwich: 0.0,
            is_3d: false,
        })
    }

    /// True if keys describe the ellipsoid, known or not.
    pub(super) fn defines_ellipsoid(&self) -> bool {
        let mut codes = [GEODETIC_CRS, PROJECTED_CRS, DATUM, ELLIPSOID].into_iter();
        codes.any(|key| self.short(key).is_some_and(|code| code != 0))
            || self.double(SEMI_MAJOR_AXIS).is_some()
            || !self.is_in_degrees()
    }

    fn is_in_degrees(&self) -> bool {
        matches!(self.short(ANGULAR_UNITS), None | Some(9102 | 9122))
    }

    /// Semi-major axis and inverse flattening.
    fn axes(&self) -> Option<(f64, f64)> {
        let axis = self.double(SEMI_MAJOR_AXIS)?;
        let minor = self.double(SEMI_MINOR_AXIS);
        // A sphere has the inverse flattening 0.
        let by_minor = minor.map(|minor| if minor == axis { 0.0 } else { axis / (axis - minor) });
        Some((axis, self.double(INVERSE_FLATTENING).or(by_minor)?))
    }

    fn meridian(&self) -> Option<f64> {
        match (self.double(PRIME_MERIDIAN_LONGITUDE), self.short(PRIME_MERIDIAN)) {
            (Some(longitude), _) => Some(longitude),
            (None, None | Some(8901)) => Some(0.0),
            (None, Some(_)) => None,
        }
    }

    /// The value of "name = value|" in the citation of the geographic CRS.
    fn part_of_citation(&self, name: &str) -> Option<String> {
        let text = self.text(GEODETIC_CITATION)?;
        let mut parts = text.split('|').filter_map(|part| part.split_once('='));
        let (_, value) = parts.find(|(own, _)| own.trim() == name)?;
        Some(value.trim().to_owned()).filter(|value| !value.is_empty())
    }

    /// The first key of this number whose value is in a location: 0 for the directory itself, or a tag.
    fn key(&self, id: u16, location: u16) -> Option<GeoKey> {
        let (keys, _) = self.raw.as_chunks::<4>();
        let number = usize::from(self.raw.get(3).copied().unwrap_or(0));
        let mut keys = keys.iter().skip(1).take(number);
        let [_, _, count, value] = keys.find(|key| key[..2] == [id, location])?;
        Some(GeoKey { count: *count, value: *value })
    }

    /// A value stored in the directory itself.
    fn short(&self, id: u16) -> Option<u16> {
        self.key(id, 0).map(|key| key.value)
    }

    /// An EPSG code: 32767 is "user-defined" and 0 "undefined".
    fn code(&self, id: u16) -> Option<u32> {
        self.short(id).filter(|code| !matches!(code, 0 | USER_DEFINED..)).map(u32::from)
    }

    /// A number.
    fn double(&self, id: u16) -> Option<f64> {
        let GeoKey { value, .. } = self.key(id, GEO_DOUBLE_PARAMS)?;
        self.doubles.get(usize::from(value)).copied().filter(|number| number.is_finite())
    }

    fn text(&self, id: u16) -> Option<String> {
        let GeoKey { count, value } = self.key(id, GEO_ASCII_PARAMS)?;
        let bytes = self.ascii.as_bytes().get(usize::from(value)..)?;
        let bytes = &bytes[..bytes.len().min(usize::from(count))];
        let text = String::from_utf8_lossy(bytes);
        let text = text.trim_end_matches(['|', '\0']).trim();
        (!text.is_empty()).then(|| text.to_owned())
    }
}

/// Name of a CRS without one.
fn unknown() -> String {
    "unknown".to_owned()
}

/// Entry of the key directory.
struct GeoKey {
    /// Number of values.
    count: u16,
    /// The value, or the index of the first one in its location.
    value: u16,
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
        assert_eq!(crs.label(), "EPSG:32611+5703 (WGS 84 / UTM zone 11N)");
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
    fn a_text_counts_beside_keys_that_describe_a_part_of_it() {
        let system = r#"PROJCS["far",GEOGCS["x"],PROJECTION["Mollweide"],UNIT["Meter",1.0]]"#;
        let ascii = format!("unknown|ESRI PE String = {system}|");
        let length = (ascii.len() - 8) as u16;
        let raw = [
            [1, 1, 1, 4],
            [1026, 34_737, 8, 0],
            [2048, 0, 1, 32_767],
            [3073, 34_737, length, 8],
            [3076, 0, 1, 9001],
        ];
        let crs = keys(raw.as_flattened(), &ascii).into_crs();
        assert_eq!((crs.geographic, crs.horizontal_unit()), (Some(false), "metre"));
        assert_eq!((crs.wkt.as_deref(), crs.to_wkt().as_deref()), (Some(system), Some(system)));
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
