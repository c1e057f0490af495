//! Attributes of points by name, and returns of pulses.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::registry::RegistryEntry;

/// A standard attribute of LAS points.
#[derive(Debug)]
pub struct PointAttribute {
    /// Name; also the name of its column in text files.
    pub name: &'static str,
    /// Other names.
    pub aliases: &'static [&'static str],
    /// One line for the documentation, with the unit.
    pub about: &'static str,
    /// Values are whole multiples of this step, up to 2^30 steps. Any number is valid when `None`.
    pub step: Option<f64>,
}

/// Names of the attributes class, return number and number of returns.
pub const CLASS: &str = "classification";
#[allow(missing_docs)]
pub const RETURN: &str = "return_number";
#[allow(missing_docs)]
pub const RETURNS: &str = "number_of_returns";

/// All numeric standard attributes. Files may have further ones in extra bytes.
pub const ATTRIBUTES: &[PointAttribute] = &[
    whole("intensity", &[], "return intensity"),
    whole(RETURN, &["return"], "number of the return in its pulse, from 1"),
    whole(RETURNS, &["returns"], "number of returns of the pulse"),
    whole(CLASS, &["class"], "LAS class"),
    // A step is a degree in formats 0 to 5, and 0.006 degrees in formats 6 to 10.
    PointAttribute {
        step: Some(0.002),
        ..whole("scan_angle", &["angle", "scan_angle_rank"], "scan angle in degrees")
    },
    whole("user_data", &["user"], "user data"),
    whole("point_source_id", &["source", "point_source"], "file or flight line of origin"),
    whole("red", &[], "colour"),
    whole("green", &[], "colour"),
    whole("blue", &[], "colour"),
    whole("infrared", &["nir"], "near infrared"),
    PointAttribute { step: None, ..whole("gps_time", &["time"], "GPS time in seconds, as stored") },
];

const fn whole(
    name: &'static str,
    aliases: &'static [&'static str],
    about: &'static str,
) -> PointAttribute {
    PointAttribute { name, aliases, about, step: Some(1.0) }
}

impl RegistryEntry for PointAttribute {
    const KIND: &'static str = "attribute";

    fn name(&self) -> &'static str {
        self.name
    }

    fn aliases(&self) -> &'static [&'static str] {
        self.aliases
    }
}

/// The standard attribute with this name; letter case and underscores are ignored (`PointSourceId`).
pub fn known(name: &str) -> Option<&'static PointAttribute> {
    let name = plain(name);
    ATTRIBUTES.iter().find(|attribute| {
        let mut names = std::iter::once(&attribute.name).chain(attribute.aliases);
        names.any(|known| plain(known) == name)
    })
}

/// Further fields of points, with other names: flags and small numbers.
const FIELDS: [(&str, &str); 7] = [
    ("synthetic", ""),
    ("key_point", ""),
    ("withheld", ""),
    ("overlap", ""),
    ("scanner_channel", "scan_channel"),
    ("scan_direction", "scan_direction_flag"),
    ("edge_of_flight_line", ""),
];

/// The name of the column of an attribute or of another field of points, by any of its names; `None` for extra bytes.
pub fn field(name: &str) -> Option<&'static str> {
    let text = plain(name);
    let is_it = |(field, other): &&(&str, &str)| plain(field) == text || plain(other) == text;
    let field = || FIELDS.iter().filter(|_| !text.is_empty()).find(is_it).map(|(field, _)| *field);
    known(name).map(|attribute| attribute.name).or_else(field)
}

fn plain(name: &str) -> String {
    name.replace('_', "").to_ascii_lowercase()
}

/// A return of a pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Return {
    /// The first return.
    First,
    /// The last return; it may also be the first.
    Last,
    /// The only return of its pulse.
    Only,
    /// The return with this number, from 1.
    Number(u8),
}

impl Return {
    /// Whether it is return `number` of `returns`.
    pub fn is(self, number: u8, returns: u8) -> bool {
        match self {
            Self::First => number <= 1,
            Self::Last => number >= returns,
            Self::Only => number <= 1 && returns <= 1,
            Self::Number(own) => number == own,
        }
    }
}

impl fmt::Display for Return {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::First => f.write_str("first"),
            Self::Last => f.write_str("last"),
            Self::Only => f.write_str("only"),
            Self::Number(number) => number.fmt(f),
        }
    }
}

impl FromStr for Return {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.trim() {
            "first" => Ok(Self::First),
            "last" => Ok(Self::Last),
            "only" => Ok(Self::Only),
            number => match number.parse() {
                Ok(number @ 1..=15) => Ok(Self::Number(number)),
                _ => Err(Error::usage("expected first, last, only, or a number from 1 to 15")),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn returns_are_read_by_name_and_number() {
        assert_eq!("last".parse::<Return>().ok(), Some(Return::Last));
        assert_eq!(" 3 ".parse::<Return>().ok(), Some(Return::Number(3)));
        assert!(["0", "16", "second", ""].iter().all(|text| text.parse::<Return>().is_err()));
    }

    #[test]
    fn attributes_have_names_of_their_own() {
        let names = ATTRIBUTES.iter().flat_map(|a| a.aliases.iter().chain([&a.name]));
        let mut all: Vec<_> = names.collect();
        let count = all.len();
        all.sort();
        all.dedup();
        assert_eq!(all.len(), count);
        assert_eq!(known("CLASS").map(|attribute| attribute.name), Some(CLASS));
        assert_eq!(known("PointSourceId").map(|found| found.name), Some("point_source_id"));
        assert!(known("amplitude").is_none());
        for (name, expected) in [
            ("KeyPoint", Some("key_point")),
            ("ScanDirectionFlag", Some("scan_direction")),
            ("edgeofflightline", Some("edge_of_flight_line")),
            ("Intensity", Some("intensity")),
            ("", None),
            ("NormalX", None),
        ] {
            assert_eq!(field(name), expected, "{name}");
        }
    }
}
