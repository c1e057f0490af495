//! A coordinate reference system, carried from input to output: the definition as it was given, and
//! what it means.

mod codes;
mod definition;
mod geokeys;
mod method;
mod node;
mod unit;
pub mod wkt;
mod write;

use serde::{Deserialize, Serialize};

use definition::{Definition, Horizontal, Vertical};
use unit::Unit;

pub use geokeys::GeoKeys;

/// GeoKey of what raster positions mean: maps account for it.
const RASTER_TYPE: u16 = 1025;

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
    /// One line for people and for mesh comments: "EPSG:32611 (WGS 84 / UTM zone 11N)".
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

    /// What a system is called that has no name of its own.
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
        if self.geographic == Some(true) {
            return "degree";
        }
        let by_text = self.wkt.as_deref().and_then(wkt::horizontal_unit);
        by_text.or_else(|| self.unit_of_keys_or_code()).unwrap_or("unit")
    }

    fn unit_of_keys_or_code(&self) -> Option<&'static str> {
        let by_keys = GeoKeys::of(self).linear_unit();
        let by_code = || self.epsg.and_then(codes::text).and_then(wkt::horizontal_unit);
        by_keys.and_then(|unit| unit.common_name()).or_else(by_code)
    }

    /// What it means: x and y, and z.
    fn parts(&self) -> (Option<Horizontal>, Option<Vertical>) {
        let (by_text, up_by_text) = self.wkt.as_deref().map(wkt::parts).unwrap_or_default();
        let keys = GeoKeys::of(self);
        let horizontal = by_text.or_else(|| match (self.epsg, &self.wkt) {
            (Some(code), _) => codes::horizontal(code),
            (None, None) => keys.horizontal(),
            (None, Some(_)) => None,
        });
        let vertical = up_by_text.or_else(|| keys.vertical());
        let vertical = vertical.or_else(|| self.vertical_epsg.and_then(codes::vertical));
        (horizontal, vertical.map(|own| self.in_unit_of_heights(own)))
    }

    /// Heights may be in another unit than their system says, which its code does not stand for.
    fn in_unit_of_heights(&self, vertical: Vertical) -> Vertical {
        let unit = self.vertical_unit.as_deref().and_then(Unit::named);
        match unit.filter(|unit| !unit.is(&vertical.unit)) {
            Some(unit) => Vertical { code: None, unit, ..vertical },
            None => vertical,
        }
    }

    /// The system as well-known text: as it was given, or else as its keys or its code say, in the
    /// first kind where that can say it. `None` where nothing is known that could be written.
    pub fn to_wkt(&self) -> Option<String> {
        let (horizontal, vertical) = self.parts();
        let given = self.wkt.as_deref().map(str::trim).filter(|text| !text.is_empty());
        let known = given.or_else(|| codes::text(self.epsg?));
        let is_whole = |text: &str| vertical.is_none() || wkt::parts(text).1 == vertical;
        match (known.filter(|text| wkt::is_first_kind(text)), horizontal, &vertical) {
            (Some(text), ..) if is_whole(text) => Some(text.to_owned()),
            (Some(text), _, Some(up)) if wkt::parts(text).1.is_none() => {
                Some(write::compound(text.split('"').nth(1).unwrap_or_default(), text, up))
            }
            (_, Some(horizontal), _) => Some(Definition { horizontal, vertical }.wkt()),
            (_, None, _) => known.map(str::to_owned),
        }
    }

    /// What well-known text cannot say of it, in a sentence for people.
    pub fn lost_in_wkt(&self) -> Option<String> {
        let label = self.label();
        match self.to_wkt() {
            None if self.is_named() => {
                Some(format!("the CRS ({label}) is of a kind that cannot be written as text"))
            }
            Some(text) if self.has_vertical() && wkt::parts(&text).1.is_none() => {
                let code = self.vertical_epsg.map(|code| format!(" EPSG:{code}"));
                let code = code.unwrap_or_default();
                Some(format!("the vertical system{code} is not known and cannot be written"))
            }
            _ => None,
        }
    }

    /// True where [`to_wkt`](Self::to_wkt) says what z is in.
    pub fn wkt_has_heights(&self) -> bool {
        self.to_wkt().is_some_and(|text| wkt::from_text(&text).vertical_unit.is_some())
    }

    fn has_vertical(&self) -> bool {
        self.vertical_epsg.is_some() || GeoKeys::of(self).vertical().is_some()
    }

    /// True where the text of a `.prj` file says what is known of this system, and no more.
    pub fn is_said_by(&self, text: &str) -> bool {
        let found = wkt::from_text(text.trim());
        let is_as_high = found.parts().1.is_some() == self.parts().1.is_some();
        self.to_wkt().is_some_and(|own| own.trim() == text.trim())
            || (found.agrees(self)
                && is_as_high
                && found.horizontal_unit() == self.horizontal_unit())
    }

    /// Whether two systems are one, as far as the files tell.
    pub fn agrees(&self, other: &Self) -> bool {
        if self == other {
            return true;
        }
        if !self.is_named() || !other.is_named() {
            return self.is_named() == other.is_named();
        }
        let (mine, theirs) = (self.parts(), other.parts());
        let is_alike = match (self.epsg, other.epsg, &mine.0, &theirs.0) {
            (Some(a), Some(b), ..) => a == b,
            (_, _, Some(a), Some(b)) => a.same(b),
            (None, None, ..) => self.says_the_same(other),
            _ => false,
        };
        is_alike
            && match (self.vertical_epsg, other.vertical_epsg, &mine.1, &theirs.1) {
                (Some(a), Some(b), ..) => a == b,
                (_, _, Some(a), Some(b)) => a.same(b),
                _ => true,
            }
    }

    /// The same in what the files say, where it is not known what that means.
    fn says_the_same(&self, other: &Self) -> bool {
        if !self.geo_keys.is_empty() && !other.geo_keys.is_empty() {
            return self.keys().eq(other.keys())
                && self.geo_doubles == other.geo_doubles
                && self.geo_ascii == other.geo_ascii;
        }
        let plain = |text: &Option<String>| text.as_deref().map(unit::plain);
        plain(&self.wkt) == plain(&other.wkt)
            && (&self.citation, self.geographic) == (&other.citation, other.geographic)
    }

    /// The GeoKeys that hold their value, but for what raster positions mean.
    fn keys(&self) -> impl Iterator<Item = &[u16]> {
        let entries = self.geo_keys.get(4..).unwrap_or_default().chunks_exact(4);
        entries.filter(|entry| entry[0] != RASTER_TYPE && entry[1] == 0)
    }

    /// The names of two systems that do not agree, with what tells them apart where the names do not.
    pub fn told_apart(&self, other: &Self) -> [String; 2] {
        let labels = [self.label(), other.label()];
        if labels[0] != labels[1] {
            return labels;
        }
        let facts = [self, other].map(Self::facts);
        let only = |mine: usize, theirs: usize| {
            let new = facts[mine].iter().filter(|fact| !facts[theirs].contains(fact));
            let new: Vec<_> = new.map(|(name, value)| format!("{name} {value}")).collect();
            match new.is_empty() {
                true => labels[mine].clone(),
                false => format!("{} with {}", labels[mine], new.join(", ")),
            }
        };
        [only(0, 1), only(1, 0)]
    }

    fn facts(&self) -> Vec<(&'static str, String)> {
        let (horizontal, vertical) = self.parts();
        let mut facts = horizontal.map_or_else(Vec::new, |own| own.facts());
        facts.extend(vertical.map(|own| ("heights", format!("{} in {}", own.name, own.unit.name))));
        facts
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

/// True for names that programs give to systems without one.
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
}
