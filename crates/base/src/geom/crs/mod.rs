//! Coordinate reference systems, carried from input to output: the definition of the file, and its meaning.
//!
//! **The definition of the file is written** where the format can store it: GeoKeys in TIFF, WKT in `.prj` files,
//! FlatGeobuf and GeoJSON. Otherwise WKT 1 is made from the meaning, because every reader supports it. A code counts
//! only if nothing overrides it; WKT or keys with another unit than their code have none. One table lists the
//! projection methods with their names and parameters in all notations. Methods and parameters outside this table are
//! never guessed: such a CRS is compared by its text and carried unchanged, or a note says that it is lost. Vertical
//! CRSs by code are in a table of the EPSG dataset, because WKT needs their units.

mod codes;
mod conversion;
mod definition;
mod geokeys;
mod method;
mod node;
mod read;
mod system;
#[cfg(test)]
mod tests_of_keys;
#[cfg(test)]
mod tests_of_text;
mod unit;
mod vertical;
pub mod wkt;
mod write;

use crate::error::{Error, Result};
use definition::{CrsDefinition, Horizontal, VerticalCrs};
use read::AxisUnit;
use unit::LengthUnit;

pub use conversion::{Conversion, Datum, VerticalReference};
pub use geokeys::GeoKeys;
pub use system::Crs;

/// Whether the CRS of an EPSG code is geographic; `None` if the code is unknown.
pub fn is_geographic(code: u32) -> Option<bool> {
    // The WKT may be a bound CRS, whose target follows the source.
    Some(wkt::from_text(codes::text(code)?).geographic == Some(true))
}

/// Metres in the length unit called `name`; `None` if unknown.
pub fn metres_in(name: &str) -> Option<f64> {
    LengthUnit::named(name).map(|unit| unit.size)
}

impl Crs {
    /// One line for messages and mesh comments: "EPSG:32611 (WGS 84
    /// UTM zone 11N)".
    pub fn label(&self) -> String {
        let vertical = self.vertical_epsg.map(|code| format!("+{code}")).unwrap_or_default();
        match (self.epsg, &self.citation) {
            (Some(code), Some(name)) => format!("EPSG:{code}{vertical} ({name})"),
            (Some(code), None) => format!("EPSG:{code}{vertical}"),
            (None, Some(name)) if is_nameless(name) => self.own_name(),
            (None, Some(name)) => name.clone(),
            (None, None) => "unknown".to_owned(),
        }
    }

    /// Label of a CRS without a name.
    fn own_name(&self) -> String {
        let (horizontal, _) = self.parts();
        match horizontal {
            Some(Horizontal::Projected(own)) => {
                format!("a system of its own ({})", own.method.name.replace('_', " "))
            }
            Some(_) => "a system of its own".to_owned(),
            None => "unknown".to_owned(),
        }
    }

    /// Unit of x and y: "degree", "metre", "foot", "US survey foot", or "unit" when unknown.
    pub fn horizontal_unit(&self) -> &'static str {
        match self.across() {
            Some(AxisUnit::Degrees) => "degree",
            Some(AxisUnit::Length(unit)) => unit.common_name().unwrap_or("unit"),
            None => "unit",
        }
    }

    /// Like [`horizontal_unit`](Self::horizontal_unit), but "units" when unknown.
    pub fn horizontal_units(&self) -> &'static str {
        match self.horizontal_unit() {
            "unit" => "units",
            unit => unit,
        }
    }

    /// Metres per unit of x and y; `None` for degrees and unknown units.
    pub fn horizontal_metres(&self) -> Option<f64> {
        match self.across()? {
            AxisUnit::Degrees => None,
            AxisUnit::Length(unit) => Some(unit.size),
        }
    }

    /// Metres per unit of z; `None` if unknown.
    pub fn vertical_metres(&self) -> Option<f64> {
        let name = self.heights_unit();
        if let Some(known) = name.and_then(LengthUnit::named) {
            return Some(known.size);
        }
        let own = self.parts().1?.unit;
        name.is_none_or(|name| name == own.name).then_some(own.size)
    }

    /// Unit of x and y, from the WKT, else the keys, else the code.
    fn across(&self) -> Option<AxisUnit> {
        if self.geographic == Some(true) {
            return Some(AxisUnit::Degrees);
        }
        let by_text = self.wkt.as_deref().and_then(read::across);
        by_text
            .or_else(|| GeoKeys::of(self).linear_unit().map(AxisUnit::Length))
            .or_else(|| self.epsg.and_then(codes::text).and_then(read::across))
    }

    /// Horizontal and vertical CRS.
    fn parts(&self) -> (Option<Horizontal>, Option<VerticalCrs>) {
        let (by_text, up_by_text) = self.wkt.as_deref().map(read::parts).unwrap_or_default();
        let keys = GeoKeys::of(self);
        let horizontal = by_text.or_else(|| match (self.epsg, &self.wkt) {
            (Some(code), _) => codes::horizontal(code),
            (None, None) => keys.horizontal(),
            (None, Some(_)) => None,
        });
        let vertical = up_by_text.or_else(|| keys.vertical());
        let vertical = vertical.or_else(|| self.vertical_epsg.and_then(vertical::by_code));
        (horizontal, vertical.map(|own| self.in_unit_of_heights(own)))
    }

    /// Replaces the unit of the vertical CRS if heights are in another one; its code then no longer applies.
    fn in_unit_of_heights(&self, vertical: VerticalCrs) -> VerticalCrs {
        let unit = self.vertical_unit.as_deref().and_then(LengthUnit::named);
        match unit.filter(|unit| !unit.is(&vertical.unit)) {
            Some(unit) => VerticalCrs { code: None, unit, ..vertical },
            None => vertical,
        }
    }

    /// WKT of the CRS: as given, else from its keys or code, as WKT 1 where possible. `None` if nothing can be
    /// written.
    pub fn to_wkt(&self) -> Option<String> {
        let (horizontal, vertical) = self.parts();
        let given = self.wkt.as_deref().map(str::trim).filter(|text| !text.is_empty());
        let known = given.or_else(|| codes::text(self.epsg?));
        match (known.filter(|text| read::is_first_kind(text)), horizontal, &vertical) {
            (Some(text), ..) if vertical.is_none() || read::parts(text).1 == vertical => {
                Some(text.to_owned())
            }
            (Some(text), _, Some(up)) if read::parts(text).1.is_none() => {
                Some(write::compound(text.split('"').nth(1).unwrap_or_default(), text, up))
            }
            (_, Some(horizontal), _) => Some(CrsDefinition { horizontal, vertical }.wkt()),
            (_, None, _) => known.map(str::to_owned),
        }
    }

    /// A message on what WKT cannot express, if anything.
    pub fn lost_in_wkt(&self) -> Option<String> {
        let label = self.label();
        match self.to_wkt() {
            None if self.is_named() => Some(format!("the CRS ({label}) cannot be written as WKT")),
            Some(text) if self.has_vertical() && read::parts(&text).1.is_none() => {
                let code = self.vertical_epsg.map(|code| format!(" EPSG:{code}"));
                let code = code.unwrap_or_default();
                Some(format!("the vertical CRS{code} is unknown and cannot be written as WKT"))
            }
            _ => None,
        }
    }

    /// True if [`to_wkt`](Self::to_wkt) states the unit of z.
    pub fn wkt_has_heights(&self) -> bool {
        self.to_wkt().is_some_and(|text| wkt::from_text(&text).vertical_unit.is_some())
    }

    fn has_vertical(&self) -> bool {
        self.vertical_epsg.is_some() || GeoKeys::of(self).vertical().is_some()
    }

    /// True if the text of a `.prj` file describes this CRS completely.
    pub fn is_said_by(&self, text: &str) -> bool {
        let found = wkt::from_text(text.trim());
        let is_as_high = found.parts().1.is_some() == self.parts().1.is_some();
        self.to_wkt().is_some_and(|own| own.trim() == text.trim())
            || (found.agrees(self)
                && is_as_high
                && found.horizontal_unit() == self.horizontal_unit())
    }

    /// Whether two CRSs are the same, as far as the files state.
    pub fn agrees(&self, other: &Self) -> bool {
        if self == other {
            return true;
        }
        if !self.is_named() || !other.is_named() {
            return self.is_named() == other.is_named();
        }
        let [(horizontal, vertical), (other_horizontal, other_vertical)] =
            [self, other].map(Self::parts);
        let is_alike = match (self.epsg, other.epsg, &horizontal, &other_horizontal) {
            (Some(a), Some(b), ..) => a == b,
            (_, _, Some(a), Some(b)) => a.same(b),
            (None, None, ..) => self.says_the_same(other),
            _ => false,
        };
        is_alike
            && match (self.vertical_epsg, other.vertical_epsg, &vertical, &other_vertical) {
                (Some(a), Some(b), ..) => a == b,
                (_, _, Some(a), Some(b)) => a.same(b),
                _ => true,
            }
    }

    /// Whether two CRSs certainly differ, by their codes or parameters. Different names prove nothing.
    pub fn is_surely_another(&self, other: &Self) -> bool {
        let [(horizontal, _), (other_horizontal, _)] = [self, other].map(Self::parts);
        let is_another = match (self.epsg, other.epsg, &horizontal, &other_horizontal) {
            (Some(a), Some(b), ..) => a != b,
            (_, _, Some(a), Some(b)) => {
                std::mem::discriminant(a) != std::mem::discriminant(b) || a.contradicts(b)
            }
            _ => false,
        };
        let heights = (self.vertical_epsg, other.vertical_epsg);
        is_another || matches!(heights, (Some(a), Some(b)) if a != b)
    }

    /// Fails unless a file of `what` has the CRS of this grid, as far as both state one.
    pub fn check_same(&self, other: &Self, what: &str) -> Result<()> {
        self.check_same_of("grid", other, what)
    }

    /// Like [`check_same`](Self::check_same), for a `whole` other than a grid.
    pub fn check_same_of(&self, whole: &str, other: &Self, what: &str) -> Result<()> {
        if self.agrees(other) {
            return Ok(());
        }
        let [own, others] = self.distinct_names(other);
        let remedy = match (self.is_named(), other.is_named()) {
            (true, true) => "reproject one of them".to_owned(),
            (true, false) => {
                format!(
                    "if its CRS is that of the {whole}, set it in the file or in a .prj file beside it"
                )
            }
            _ => format!(
                "set the CRS of the {whole}, or write the {what} as WKT geometry without a CRS"
            ),
        };
        let message = format!("its CRS is {others}, the CRS of the {whole} is {own}");
        Err(Error::bad_input(message).remedy(remedy))
    }

    /// Labels of two different CRSs, with the differing properties if the labels are equal.
    pub fn distinct_names(&self, other: &Self) -> [String; 2] {
        let labels = [self.label(), other.label()];
        if labels[0] != labels[1] {
            return labels;
        }
        let facts = [self, other].map(Self::facts);
        [(0, 1), (1, 0)].map(|(own, other)| {
            let only = facts[own].iter().filter(|fact| !facts[other].contains(fact));
            let only: Vec<_> = only.map(|(name, value)| format!("{name} {value}")).collect();
            match only.is_empty() {
                true => labels[own].clone(),
                false => format!("{} with {}", labels[own], only.join(", ")),
            }
        })
    }

    fn facts(&self) -> Vec<(&'static str, String)> {
        let (horizontal, vertical) = self.parts();
        let mut facts = horizontal.map_or_else(Vec::new, |own| own.facts());
        facts.extend(vertical.map(|own| ("heights", format!("{} in {}", own.name, own.unit.name))));
        facts
    }
}

/// True for placeholder names that programs write.
fn is_nameless(name: &str) -> bool {
    ["unknown", "unnamed", "undefined"].contains(&name.to_lowercase().as_str())
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

    #[test]
    fn units_for_reports_come_from_keys_codes_or_stay_unknown() {
        let geo_keys = vec![1, 1, 0, 1, 3076, 0, 1, 9003];
        let crs = |geo_keys| Crs { geo_keys, ..Crs::default() };
        assert_eq!(crs(geo_keys).horizontal_units(), "US survey foot");
        assert_eq!(Crs { epsg: Some(32611), ..Crs::default() }.horizontal_units(), "metre");
        assert_eq!(Crs { geographic: Some(true), ..Crs::default() }.horizontal_units(), "degree");
        assert_eq!(crs(vec![1, 1]).horizontal_units(), "units");
        assert_eq!(Crs::default().heights_unit(), None);
        let named = |unit: &str| Crs { vertical_unit: Some(unit.to_owned()), ..Crs::default() };
        assert_eq!(named(" foot ").heights_unit(), Some("foot"));
        assert_eq!(named(" ").heights_unit(), None);
    }

    #[test]
    fn units_have_one_size_however_they_are_told() {
        let survey = 1200.0 / 3937.0;
        let text = |name: &str, size: &str| {
            let base = r#"GEOGCS["y",UNIT["Degree",0.017]]"#;
            wkt::from_text(&format!(r#"PROJCS["x",{base},UNIT["{name}",{size}]]"#))
        };
        let keys = |raw: &[u16], doubles: &[f64]| {
            let raw = [&[1, 1, 0, raw.len() as u16 / 4][..], raw].concat();
            Crs { geo_keys: raw, geo_doubles: doubles.to_vec(), ..Crs::default() }
        };
        let code = |code: &str| wkt::of_srs(&format!("EPSG:{code}"));
        for (crs, across, up) in [
            (Crs::default(), None, None),
            (code("4326"), None, None),
            (code("4326+5773"), None, Some(1.0)),
            (code("32611"), Some(1.0), None),
            (code("2263"), Some(survey), None),
            (code("2222"), Some(0.3048), None),
            (code("6339+6360"), Some(1.0), Some(survey)),
            (code("2263+6360"), Some(survey), Some(survey)),
            (code("7415"), Some(1.0), Some(1.0)),
            (text("US survey foot", "0.304800609601219"), Some(survey), None),
            (text("Foot_US", "0.3048006096012192"), Some(survey), None),
            (text("foot", "0.3048"), Some(0.3048), None),
            (text("a rod of my own", "5.0292"), Some(5.0292), None),
            (keys(&[3076, 0, 1, 9003], &[]), Some(survey), None),
            (keys(&[3076, 0, 1, 9002], &[]), Some(0.3048), None),
            (keys(&[3076, 0, 1, 32767, 3077, 34736, 1, 0], &[5.0292]), Some(5.0292), None),
        ] {
            assert_eq!((crs.horizontal_metres(), crs.vertical_metres()), (across, up), "{crs:?}");
        }
        let own = r#"VERT_CS["c",VERT_DATUM["d",2005],UNIT["a rod of my own",5.0292]]"#;
        let both =
            r#"COMPD_CS["both",LOCAL_CS["a",UNIT["foot",0.3048]],VERT]"#.replace("VERT", own);
        let both = wkt::from_text(&both);
        assert_eq!(
            (both.horizontal_metres(), both.vertical_metres()),
            (Some(0.3048), Some(5.0292))
        );
        for (name, metres) in [
            ("m", Some(1.0)),
            ("Metres", Some(1.0)),
            ("feet", Some(0.3048)),
            ("US survey feet", Some(survey)),
            ("fathom", Some(1.8288)),
            ("sazhen", None),
        ] {
            let heights = Crs { vertical_unit: Some(name.to_owned()), ..code("32611+5703") };
            assert_eq!((heights.vertical_metres(), metres_in(name)), (metres, metres), "{name}");
        }
    }

    /// One CRS in the notations of GDAL, Esri and WKT 2, and with heights in feet.
    const DIALECTS: [&str; 3] = [
        r#"PROJCS["a",GEOGCS["NAD83",DATUM["North_American_Datum_1983",SPHEROID["GRS 1980",6378137,298.257222101004]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic_2SP"],PARAMETER["latitude_of_origin",39.5],PARAMETER["central_meridian",-100],PARAMETER["standard_parallel_1",40],PARAMETER["standard_parallel_2",43],PARAMETER["false_easting",1640416.66666667],PARAMETER["false_northing",0],UNIT["US survey foot",0.304800609601219],AXIS["X",EAST],AXIS["Y",NORTH]]"#,
        r#"PROJCS["b",GEOGCS["GCS_North_American_1983",DATUM["D_North_American_1983",SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic"],PARAMETER["False_Easting",1640416.666666667],PARAMETER["False_Northing",0.0],PARAMETER["Scale_Factor",1.0],PARAMETER["Central_Meridian",-100.0],PARAMETER["Standard_Parallel_1",40.0],PARAMETER["Standard_Parallel_2",43.0],PARAMETER["Latitude_Of_Origin",39.5],UNIT["Foot_US",0.3048006096012192]]"#,
        r#"PROJCRS["c",BASEGEOGCRS["NAD83",DATUM["North American Datum 1983",ELLIPSOID["GRS 1980",6378137,298.257222101,LENGTHUNIT["metre",1]]],PRIMEM["Greenwich",0,ANGLEUNIT["degree",0.0174532925199433]]],CONVERSION["d",METHOD["Lambert Conic Conformal (2SP)"],PARAMETER["Latitude of false origin",39.5,ANGLEUNIT["degree",0.0174532925199433]],PARAMETER["Longitude of false origin",-100,ANGLEUNIT["degree",0.0174532925199433]],PARAMETER["Latitude of 1st standard parallel",40,ANGLEUNIT["degree",0.0174532925199433]],PARAMETER["Latitude of 2nd standard parallel",43,ANGLEUNIT["degree",0.0174532925199433]],PARAMETER["Easting at false origin",500000,LENGTHUNIT["metre",1]],PARAMETER["Northing at false origin",0,LENGTHUNIT["metre",1]]],CS[Cartesian,2],AXIS["e",east,LENGTHUNIT["US survey foot",0.304800609601219]],AXIS["n",north,LENGTHUNIT["US survey foot",0.304800609601219]]]"#,
    ];

    #[test]
    fn dialects_agree_and_any_other_number_does_not() {
        let all = DIALECTS.map(wkt::from_text);
        for (a, text) in all.iter().zip(DIALECTS) {
            assert!(all.iter().all(|b| a.agrees(b) && b.is_said_by(text)), "{text}");
            assert_eq!(a.horizontal_unit(), "US survey foot");
            let first = a.to_wkt().unwrap();
            assert!(first.starts_with("PROJCS[") && wkt::from_text(&first).agrees(a), "{first}");
        }
        for (from, to) in [
            ("39.5", "39.6"),
            ("-100", "-101"),
            ("43", "44"),
            ("1640416", "1640417"),
            ("0.304800609601219]", "0.3048]"),
            ("6378137", "6378138"),
            ("\"Greenwich\",0", "\"Greenwich\",1"),
            ("North_American_Datum_1983", "Elsewhere"),
            ("_Conic_2SP", "_Conic_3SP"),
        ] {
            let text =
                DIALECTS[0].replace(from, to).replace("US survey foot\",0.3048]", "foot\",0.3048]");
            let text = text.replace(
                "\"NAD83\"",
                if to == "Elsewhere" { "\"Elsewhere\"" } else { "\"NAD83\"" },
            );
            let other = wkt::from_text(&text);
            assert!(!other.agrees(&all[0]) && !all[0].agrees(&other), "{from} {to}");
            assert!(!all[0].is_said_by(&text), "{from} {to}");
        }
    }

    #[test]
    fn damaged_text_is_no_system_or_another_but_never_a_panic() {
        for text in DIALECTS {
            for at in 0..text.len() {
                let _ = wkt::from_text(&text[..at]).to_wkt();
                for new in ["[", "]", "\"", ",", "9", "é"] {
                    let other = [&text[..at], new, &text[at + 1..]].concat();
                    let crs = wkt::from_text(&other);
                    assert!(crs.agrees(&crs.clone()) && crs.to_wkt().is_none_or(|t| !t.is_empty()));
                }
            }
        }
    }

    #[test]
    fn every_method_comes_back_from_the_text_it_is_written_as() {
        let wgs84 = codes::geographic(4326).unwrap();
        for method in method::METHODS {
            let given = |role| {
                let at = method::ProjectionParameter::ALL.iter().position(|own| *own == role)?;
                method.roles.contains(&role).then_some(10.0 + 0.5 * at as f64)
            };
            let own = definition::Projected::new(
                definition::EpsgName { name: "x \"y\"".to_owned(), code: None },
                wgs84.clone(),
                method,
                given,
                LengthUnit::of_code(9002).unwrap(),
            );
            let horizontal = Horizontal::Projected(own.unwrap());
            let text = CrsDefinition { horizontal: horizontal.clone(), vertical: None }.wkt();
            let (found, _) = read::parts(&text);
            assert!(found.is_some_and(|found| found.same(&horizontal)), "{text}");
        }
    }

    #[test]
    fn a_code_counts_only_where_nothing_overrides_it() {
        let text = codes::text(32104).unwrap();
        assert_eq!(wkt::from_text(text).epsg, Some(32104));
        let feet =
            text.replace("UNIT[\"metre\",1,AUTHORITY[\"EPSG\",\"9001\"]]", "UNIT[\"foot\",0.3048]");
        assert_ne!(feet, text);
        assert_eq!(wkt::from_text(&feet).epsg, None);
        let up =
            r#"VERT_CS["n",VERT_DATUM["d",2005],UNIT["foot",0.3048],AUTHORITY["EPSG","5703"]]"#;
        let both = format!("COMPD_CS[\"b\",{text},{up}]");
        let crs = wkt::from_text(&both);
        assert_eq!((crs.epsg, crs.vertical_epsg), (Some(32104), None));
        assert_eq!(crs.vertical_unit.as_deref(), Some("foot"));
    }

    #[test]
    fn what_text_cannot_say_is_told() {
        let keys = |extra: &[u16]| {
            let raw = [&[1, 1, 0, 3, 1024, 0, 1, 1, 1026, 34737, 5, 0][..], extra].concat();
            GeoKeys::new(raw, vec![], "mine|".to_owned()).into_crs()
        };
        let odd = keys(&[3075, 0, 1, 5]);
        assert_eq!(odd.to_wkt(), None);
        assert!(odd.lost_in_wkt().unwrap().contains("mine"));
        let high = Crs { epsg: Some(32611), vertical_epsg: Some(5030), ..Crs::default() };
        assert!(high.lost_in_wkt().unwrap().contains("EPSG:5030"));
        assert_eq!(wkt::of_srs("EPSG:32611+5703").lost_in_wkt(), None);
        assert_eq!(Crs::default().lost_in_wkt(), None);
    }

    #[test]
    fn heights_in_another_unit_than_their_system_are_no_code() {
        let crs = Crs { vertical_unit: Some("metre".to_owned()), ..wkt::of_srs("EPSG:6339+6360") };
        let text = crs.to_wkt().unwrap();
        assert!(text.contains("VERT_CS") && !text.contains("\"6360\""), "{text}");
        assert_eq!(wkt::from_text(&text).vertical_unit.as_deref(), Some("metre"));
        let compound = wkt::of_srs("EPSG:7415");
        assert_eq!((compound.epsg, compound.vertical_epsg), (Some(28992), Some(5709)));
    }
}
