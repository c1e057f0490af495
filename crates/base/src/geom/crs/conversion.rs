//! Parts of coordinate operations: the conversion from longitude and latitude in PROJ syntax, the datum, and the
//! vertical reference.

use super::definition::{CrsDefinition, GeographicCrs, Horizontal, Projected, VerticalCrs};
use super::geokeys::GeoKeys;
use super::method::{ProjectionMethod, ProjectionParameter};
use super::node::CrsWktNode;
use super::system::Crs;
use super::unit::plain;
use super::{codes, read, vertical, wkt, write};
use crate::error::{Error, Result};
use crate::geom::Spheroid;

/// Datum of a CRS, and its ellipsoid.
#[derive(Clone, Debug, PartialEq)]
pub struct Datum {
    /// Name in the CRS.
    pub name: String,
    /// EPSG code, if known.
    pub code: Option<u32>,
    /// Semi-major axis of the ellipsoid, in metres.
    pub axis: f64,
    /// Inverse flattening; 0 for a sphere.
    pub flattening: f64,
}

/// Conversion of longitudes and latitudes (from Greenwich) to coordinates of a CRS.
#[derive(Clone, Debug, PartialEq)]
pub struct Conversion {
    /// PROJ string without a datum shift.
    pub proj: String,
    /// Datum of the longitudes and latitudes.
    pub datum: Datum,
}

/// Reference surface of the heights of a CRS.
#[derive(Clone, Debug, PartialEq)]
pub enum VerticalReference {
    /// Not stated.
    Unknown,
    /// Above the ellipsoid, in metres.
    Ellipsoidal,
    /// Above (or, for depths, below) a surface of a vertical datum.
    Above {
        /// Name of the vertical CRS.
        name: String,
        /// EPSG code of its datum, or the name of the datum.
        datum: std::result::Result<u32, String>,
        /// Metres per unit.
        metres: f64,
        /// True for depths.
        is_down: bool,
    },
}

/// Parameters used of PROJ strings of codes: the projection, without datum and ellipsoid.
const PARAMETERS: [&str; 20] = [
    "proj", "lat_0", "lat_1", "lat_2", "lat_ts", "lon_0", "lonc", "alpha", "gamma", "k", "k_0",
    "x_0", "y_0", "zone", "south", "no_uoff", "units", "to_meter", "axis", "pm",
];

impl Crs {
    /// The conversion from longitude and latitude.
    ///
    /// # Errors
    /// CRSs without a position on the globe, and unsupported projections.
    pub fn conversion(&self) -> Result<Conversion> {
        if let Some(code) = self.epsg {
            return by_code(code).map_err(|error| error.at(self.label()));
        }
        let refused = match self.parts().0 {
            Some(Horizontal::Projected(own)) => {
                return own.conversion().map_err(|e| e.at(self.label()));
            }
            Some(Horizontal::Geographic(own)) => return Ok(own.conversion()),
            Some(Horizontal::Local { .. }) => "a local (engineering) CRS cannot be transformed",
            None if self.is_named() => "the projection of this CRS is unknown",
            None => {
                return Err(Error::bad_input("CRS is missing")
                    .remedy("set the CRS in the file or in a .prj file beside it"));
            }
        };
        Err(Error::unsupported(refused)
            .at(self.label())
            .remedy("set a georeferenced CRS in the file or in a .prj file beside it"))
    }

    /// The ellipsoid, of any body; `None` if the CRS states none.
    ///
    /// # Errors
    /// Unsupported: the stated ellipsoid is unknown.
    pub fn spheroid(&self) -> Result<Option<Spheroid>> {
        let figure = match self.parts().0 {
            Some(Horizontal::Geographic(own)) => Some((own.axis, own.flattening)),
            Some(Horizontal::Projected(own)) => Some((own.base.axis, own.base.flattening)),
            Some(Horizontal::Local { .. }) => return Ok(None),
            None => None,
        };
        match figure.map(|(axis, flattening)| Spheroid::new(axis, flattening)) {
            Some(Some(known)) => Ok(Some(known)),
            None if !self.depends_on_ellipsoid() => Ok(None),
            _ => {
                let what = format!("the ellipsoid of {} is unknown", self.label());
                Err(Error::unsupported(what)
                    .remedy("set the CRS as an EPSG code, or as WKT with its ellipsoid"))
            }
        }
    }

    fn depends_on_ellipsoid(&self) -> bool {
        self.epsg.is_some() || self.wkt.is_some() || GeoKeys::of(self).defines_ellipsoid()
    }

    /// The vertical reference.
    pub fn heights(&self) -> VerticalReference {
        match self.parts() {
            (_, Some(own)) => own.heights(),
            (Some(Horizontal::Geographic(own)), None) if own.is_3d => {
                VerticalReference::Ellipsoidal
            }
            _ => VerticalReference::Unknown,
        }
    }

    /// True for Mercator projections, whose scale grows without limit towards the poles.
    pub fn is_mercator(&self) -> bool {
        let names = ["+proj=merc ", "+proj=webmerc "];
        self.conversion().is_ok_and(|own| names.iter().any(|name| own.proj.starts_with(name)))
    }

    /// The horizontal CRS alone, for values other than heights.
    #[must_use]
    pub fn without_heights(&self) -> Self {
        let heights = self.heights();
        if heights == VerticalReference::Unknown && self.vertical_unit.is_none() {
            return self.clone();
        }
        let plain = match (self.epsg, self.parts().0) {
            (Some(code), _) if heights != VerticalReference::Ellipsoidal => {
                wkt::of_srs(&format!("EPSG:{code}"))
            }
            (_, Some(mut horizontal)) => {
                if let Horizontal::Geographic(own) = &mut horizontal {
                    own.is_3d = false;
                }
                wkt::from_text(&CrsDefinition { horizontal, vertical: None }.wkt())
            }
            (_, None) => self.clone(),
        };
        Self { vertical_epsg: None, vertical_unit: None, vertical_unit_text: None, ..plain }
    }

    /// This CRS with the vertical CRS of `other`, unless it has one.
    #[must_use]
    pub fn with_heights_of(&self, other: &Self) -> Self {
        let given = match self.heights() {
            VerticalReference::Unknown => other.parts().1,
            _ => return self.clone(),
        };
        let unit = other.vertical_unit.clone();
        let text = other.vertical_unit_text.clone();
        let plain = Self { vertical_unit: unit, vertical_unit_text: text, ..self.clone() };
        match (given, self.epsg) {
            (Some(VerticalCrs { code: Some(up), .. }), Some(code)) => wkt::of_codes(code, up),
            (Some(up), _) => match self.to_wkt() {
                Some(text) => {
                    let name = text.split('"').nth(1).unwrap_or_default();
                    wkt::from_text(&write::compound(name, &text, &up))
                }
                None => plain,
            },
            (None, _) => plain,
        }
    }
}

impl VerticalCrs {
    fn heights(&self) -> VerticalReference {
        VerticalReference::Above {
            name: self.name.clone(),
            datum: (self.datum.code.or_else(|| vertical::datum_code(&self.datum.name)))
                .ok_or_else(|| plain(&self.datum.name)),
            metres: self.unit.size,
            is_down: self.is_down,
        }
    }
}

fn by_code(code: u32) -> Result<Conversion> {
    let definition = u16::try_from(code).ok().and_then(crs_definitions::from_code);
    let definition =
        definition.and_then(|own| Some((own.proj4, CrsWktNode::all(own.wkt)?, own.wkt)));
    let (proj4, nodes, wkt) = definition.ok_or_else(|| {
        Error::unsupported(format!("unknown EPSG code {code}"))
            .remedy("set another EPSG code, or give the CRS as WKT")
    })?;
    let words = proj4.split_whitespace().map(|word| word.trim_start_matches('+'));
    let words: Vec<&str> = words.collect();
    let projection = proj_value(&words, "proj");
    let (datum, is_degrees) = datum(&nodes).ok_or_else(|| no_place(projection))?;
    match projection {
        "longlat" if !is_degrees => return Err(grads()),
        "krovak" if faces_south(&nodes) => return Err(turned()),
        "geocent" | "" => return Err(no_place(projection)),
        _ => {}
    }
    // Web Mercator treats longitudes and latitudes on the ellipsoid as spherical.
    let is_sphere_of_ellipsoid = wkt.contains("EXTENSION[\"PROJ4\"");
    let figure = match is_sphere_of_ellipsoid {
        true => format!("+a={0} +b={0}", proj_value(&words, "a")),
        false => datum.figure(),
    };
    let parameters = words
        .iter()
        .filter(|word| PARAMETERS.contains(&word.split('=').next().unwrap_or_default()));
    // The unit of a geographic CRS is not a length unit.
    let parameters = parameters.map(|word| format!("+{word}")).collect::<Vec<_>>().join(" ");
    Ok(Conversion { proj: format!("{parameters} {figure}"), datum })
}

/// The value of a parameter of a PROJ string; empty without it.
fn proj_value<'a>(words: &[&'a str], name: &str) -> &'a str {
    let value = words.iter().find_map(|word| word.strip_prefix(name)?.strip_prefix('='));
    value.unwrap_or_default()
}

/// Datum of a WKT, and whether its angles are in degrees.
fn datum(nodes: &[CrsWktNode<'_>]) -> Option<(Datum, bool)> {
    let node = read::find(nodes, &read::GEOGRAPHIC)?;
    let datum = node.child(&["DATUM", "ENSEMBLE", "TRF", "GEODETICDATUM"])?;
    let ellipsoid = datum.child(&["SPHEROID", "ELLIPSOID"])?;
    let known = Datum {
        name: datum.name().to_owned(),
        code: datum.code(),
        axis: read::number(ellipsoid, 1.0)?,
        flattening: ellipsoid.number(1)?,
    };
    match read::geographic(node).filter(|_| known.code.is_none()) {
        Some(own) => Some((own.to_datum(), true)),
        None => Some((known, read::is_in_degrees(node))),
    }
}

fn no_place(kind: &str) -> Error {
    let what = match kind {
        "geocent" => "geocentric CRSs are not supported",
        _ => "its position on the globe is unknown",
    };
    Error::unsupported(what).remedy("use a geographic or projected CRS")
}

fn grads() -> Error {
    Error::unsupported("angular units other than degrees are not supported")
        .remedy("use a geographic CRS in degrees or a projected CRS on the same datum")
}

fn turned() -> Error {
    Error::unsupported("axes to the south and west are not supported")
        .remedy("use the CRS with axes to the east and north: EPSG:5514 for EPSG:5513")
}

fn faces_south(nodes: &[CrsWktNode<'_>]) -> bool {
    nodes
        .iter()
        .flat_map(CrsWktNode::children)
        .any(|node| node.is(&["AXIS"]) && node.has_word("SOUTH"))
}

impl Datum {
    /// The ellipsoid in PROJ syntax.
    fn figure(&self) -> String {
        match self.flattening {
            0.0 => format!("+a={0} +b={0}", self.axis),
            flattening => format!("+a={} +rf={flattening}", self.axis),
        }
    }
}

impl GeographicCrs {
    /// Its datum; looked up by name if it has no code.
    pub(super) fn to_datum(&self) -> Datum {
        let code = self.datum.code.or_else(|| {
            codes::geographic_with(|own| own.same_figure(self) && own.same_datum(self))?.datum.code
        });
        Datum { name: self.datum.name.clone(), code, axis: self.axis, flattening: self.flattening }
    }

    fn meridian(&self) -> String {
        match self.from_greenwich {
            0.0 => String::new(),
            east => format!(" +pm={east}"),
        }
    }

    fn conversion(&self) -> Conversion {
        let datum = self.to_datum();
        Conversion { proj: format!("+proj=longlat {}{}", datum.figure(), self.meridian()), datum }
    }
}

impl Projected {
    fn conversion(&self) -> Result<Conversion> {
        let datum = self.base.to_datum();
        let projection = self.method.proj(|role| self.value(role)).ok_or_else(|| {
            let name = self.method.name.replace('_', " ");
            Error::unsupported(format!(
                "the projection {name} is not supported with these parameters"
            ))
            .remedy("reproject the data to another CRS first")
        })?;
        let [east, north] = [ProjectionParameter::Easting, ProjectionParameter::Northing]
            .map(|role| self.value(role) * self.unit.size);
        let unit = self.unit.size;
        let proj = format!(
            "{projection} +x_0={east} +y_0={north} +to_meter={unit} {}{}",
            datum.figure(),
            self.base.meridian()
        );
        Ok(Conversion { proj, datum })
    }

    fn value(&self, role: ProjectionParameter) -> f64 {
        let found = self.method.roles.iter().position(|own| *own == role);
        found.map_or(0.0, |at| self.values[at])
    }
}

impl ProjectionMethod {
    /// The projection in PROJ syntax, without the origin and the unit of x and y; `None` if PROJ does not support
    /// these parameters.
    fn proj(&self, value: impl Fn(ProjectionParameter) -> f64) -> Option<String> {
        use ProjectionParameter::{
            Azimuth, GridAngle, Latitude, Longitude, Parallel1, Parallel2, Scale,
        };
        let [lat, lon, first, second] = [Latitude, Longitude, Parallel1, Parallel2].map(&value);
        let scale = value(Scale);
        let origin = format!("+lat_0={lat} +lon_0={lon}");
        let [alpha, gamma] = [Azimuth, GridAngle].map(&value);
        let oblique = format!("+lat_0={lat} +lonc={lon} +alpha={alpha} +gamma={gamma} +k={scale}");
        let is_swiss = alpha == 90.0 && gamma == 90.0;
        let is_pole = lat.abs() == 90.0;
        Some(match self.code {
            1 => format!("+proj=tmerc {origin} +k={scale}"),
            3 => format!("+proj=omerc +no_uoff {oblique}"),
            9815 if is_swiss => format!("+proj=somerc {origin} +k_0={scale}"),
            9815 => format!("+proj=omerc {oblique}"),
            7 if self.roles.contains(&Scale) => format!("+proj=merc +lon_0={lon} +k={scale}"),
            7 => format!("+proj=merc +lon_0={lon} +lat_ts={first}"),
            8 => format!("+proj=lcc {origin} +lat_1={first} +lat_2={second}"),
            9 => format!("+proj=lcc {origin} +lat_1={lat} +k_0={scale}"),
            10 => format!("+proj=laea {origin}"),
            11 => format!("+proj=aea {origin} +lat_1={first} +lat_2={second}"),
            12 => format!("+proj=aeqd {origin}"),
            13 => format!("+proj=eqdc {origin} +lat_1={first} +lat_2={second}"),
            14 => format!("+proj=stere {origin} +k={scale}"),
            // The latitude is that of true scale; with a scale factor it is the pole.
            15 if is_pole || scale == 1.0 => {
                let pole = 90.0_f64.copysign(lat);
                format!("+proj=stere +lat_0={pole} +lat_ts={lat} +lon_0={lon} +k={scale}")
            }
            16 => format!("+proj=sterea {origin} +k={scale}"),
            17 => format!("+proj=eqc {origin} +lat_ts={first}"),
            18 => format!("+proj=cass {origin}"),
            19 => format!("+proj=gnom {origin}"),
            20 => format!("+proj=mill +lon_0={lon}"),
            21 => format!("+proj=ortho {origin}"),
            22 => format!("+proj=poly {origin}"),
            23 => format!("+proj=robin +lon_0={lon}"),
            24 => format!("+proj=sinu +lon_0={lon}"),
            27 => format!("+proj=tmerc +axis=wsu {origin} +k={scale}"),
            28 => format!("+proj=cea +lon_0={lon} +lat_ts={first}"),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::wkt::{from_text, of_srs};

    #[test]
    fn a_code_is_its_projection_on_its_own_ellipsoid_without_any_shift() {
        let lambert = of_srs("EPSG:27572").conversion().unwrap();
        assert!(lambert.proj.contains("+proj=lcc") && lambert.proj.contains("+pm=paris"));
        assert!(!lambert.proj.contains("towgs84"), "{}", lambert.proj);
        assert_eq!((lambert.datum.code, lambert.datum.axis), (Some(6807), 6_378_249.2));
        let british = of_srs("EPSG:27700").conversion().unwrap();
        assert!(british.proj.contains("+a=6377563.396 +rf=299.3249646"), "{}", british.proj);
        let web = of_srs("EPSG:3857").conversion().unwrap();
        assert!(web.proj.contains("+a=6378137 +b=6378137") && web.datum.code == Some(6326));
        let compound = of_srs("EPSG:6339+6360").conversion().unwrap();
        assert!(compound.proj.starts_with("+proj=utm +zone=10"), "{}", compound.proj);
    }

    #[test]
    fn text_without_codes_has_the_datum_it_names() {
        let text = r#"PROJCS["x",GEOGCS["GCS_North_American_1983",DATUM["D_North_American_1983",SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",1640416.5],PARAMETER["Central_Meridian",-100.0],PARAMETER["Latitude_Of_Origin",39.5],UNIT["Foot_US",0.3048006096012192]]"#;
        let found = from_text(text).conversion().unwrap();
        assert_eq!(found.datum.code, Some(6269));
        assert!(found.proj.contains("+to_meter=0.3048006096012192"), "{}", found.proj);
    }

    #[test]
    fn what_has_no_place_is_refused_by_what_it_is() {
        let local = r#"LOCAL_CS["site",UNIT["metre",1]]"#;
        let labrd = "EPSG:8441";
        for (text, word) in [
            ("EPSG:65000", "unknown EPSG code"),
            ("EPSG:70001", "unknown EPSG code"),
            (local, "a local (engineering) CRS"),
            ("EPSG:4978", "geocentric"),
            ("EPSG:4807", "angular units"),
            ("EPSG:5513", "south and west"),
            ("", "CRS is missing"),
            ("some words", "projection of this CRS is unknown"),
        ] {
            let told = of_srs(text).conversion().unwrap_err().to_string();
            assert!(told.contains(word), "{text}: {told}");
        }
        assert!(of_srs(labrd).conversion().is_ok(), "the crate of operations tells of it");
    }

    #[test]
    fn values_that_are_no_heights_have_no_unit_of_heights() {
        let feet = Crs { vertical_unit: Some("foot".to_owned()), ..of_srs("EPSG:32611") };
        for system in [of_srs("EPSG:6339+6360"), of_srs("EPSG:4979"), of_srs("EPSG:7415"), feet] {
            let bare = system.without_heights();
            assert_eq!(
                (bare.heights(), bare.vertical_metres()),
                (VerticalReference::Unknown, None),
                "{system:?}"
            );
            assert!(!bare.wkt_has_heights() && bare.conversion().is_ok());
            assert_eq!(bare.geographic, system.geographic);
            assert_eq!(bare.horizontal_unit(), system.horizontal_unit());
        }
        assert_eq!(of_srs("EPSG:2056").without_heights(), of_srs("EPSG:2056"));
        assert_eq!(Crs::default().without_heights(), Crs::default());
    }

    #[test]
    fn heights_are_kept_where_the_target_has_none() {
        let source = of_srs("EPSG:6339+6360");
        let kept = of_srs("EPSG:4326").with_heights_of(&source);
        assert_eq!((kept.epsg, kept.vertical_epsg), (Some(4326), Some(6360)));
        assert_eq!(kept.heights(), source.heights());
        let own = of_srs("EPSG:4326+5773");
        assert_eq!(own.with_heights_of(&source), own);
        let feet = Crs { vertical_unit: Some("foot".to_owned()), ..of_srs("EPSG:6339+5703") };
        let kept = of_srs("EPSG:4326").with_heights_of(&feet);
        assert_eq!(kept.vertical_metres(), Some(0.3048));
        assert!(matches!(kept.heights(), VerticalReference::Above { datum: Ok(5103), .. }));
        let unit = Crs { vertical_unit: Some("foot".to_owned()), ..of_srs("EPSG:6339") };
        assert_eq!(of_srs("EPSG:4326").with_heights_of(&unit).vertical_metres(), Some(0.3048));
        assert_eq!(of_srs("EPSG:4979").heights(), VerticalReference::Ellipsoidal);
    }

    #[test]
    fn a_vertical_datum_is_known_by_its_name() {
        let text = r#"VERTCRS["NGF-IGN69 height",VDATUM["Nivellement General de la France - IGN69"],
            CS[vertical,1],AXIS["gravity-related height (H)",up,LENGTHUNIT["metre",1]],ID["EPSG",5720]]"#;
        let map = wkt::of_srs("EPSG:2154").to_wkt().unwrap();
        let compound = format!("COMPOUNDCRS[\"both\",{map},{text}]");
        let [found, known] = [wkt::from_text(&compound), wkt::of_codes(2154, 5720)];
        assert_eq!(found.heights(), known.heights());
    }
}
