//! LAS versions and packings, and the point formats that each supports.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::format::PointFormat;
use terrane_base::error::{Error, Result};

/// Storage of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PointPacking {
    /// Uncompressed (LAS).
    #[default]
    Plain,
    /// Compressed in chunks of [`CHUNK`](crate::write::CHUNK) points (LAZ).
    Chunks,
    /// Compressed in chunks of any size (COPC).
    Nodes,
    /// Text lines, without a [`PointLayout`](crate::write::PointLayout).
    Text,
}

impl PointPacking {
    /// Fails if this packing does not support the point format.
    pub(crate) fn check(self, format: PointFormat) -> Result<()> {
        if self != Self::Nodes || format.is_new() && !format.has_waves() {
            return Ok(());
        }
        Err(Error::unsupported(format!("COPC does not support point format {}", format.number()))
            .remedy("choose point format 6, 7 or 8, or write plain .laz"))
    }

    /// The first point format of this packing with all fields of another.
    pub(crate) fn holding(self, held: PointFormat) -> Result<PointFormat> {
        let format = match self {
            Self::Nodes => held.holding(PointFormat::default()),
            Self::Plain | Self::Chunks | Self::Text => held,
        };
        self.check(format).map(|()| format)
    }
}

/// A LAS version for writing: 1.2 to 1.5.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct LasVersion {
    minor: u8,
}

impl LasVersion {
    /// LAS 1.4: WKT and 64-bit counts, as COPC requires.
    pub const V1_4: Self = Self { minor: 4 };
    /// LAS 1.5: point formats 6 to 10, and time offsets.
    pub const V1_5: Self = Self { minor: 5 };
    /// All versions.
    pub const ALL: [Self; 4] = [Self { minor: 2 }, Self { minor: 3 }, Self::V1_4, Self::V1_5];

    /// The first version that supports a point format.
    pub fn of(format: PointFormat) -> Self {
        Self::ALL.into_iter().find(|version| version.has(format)).unwrap_or(Self::V1_4)
    }

    /// Minor version.
    pub fn minor(self) -> u8 {
        self.minor
    }

    fn has(self, format: PointFormat) -> bool {
        match self.minor {
            2 => format.number() <= 3,
            3 => format.number() <= 5,
            4 => true,
            _ => format.is_new(),
        }
    }

    /// The first point format of this version with all fields of another; LAS 1.5 dropped some formats.
    pub(crate) fn holding(self, format: PointFormat) -> PointFormat {
        match self {
            Self::V1_5 => format.holding(PointFormat::default()),
            _ => format,
        }
    }

    /// Fails if this version or packing does not support the point format.
    pub(crate) fn check(self, format: PointFormat, packing: PointPacking) -> Result<()> {
        match packing {
            PointPacking::Text => Err(Error::usage("‹las_version› has no effect on text")
                .remedy("leave ‹las_version› out, or write .las or .laz")),
            PointPacking::Nodes if self != Self::V1_4 => {
                Err(Error::unsupported(format!("COPC requires LAS 1.4, not {self}"))
                    .remedy("leave ‹las_version› out, or write plain .laz"))
            }
            _ if !self.has(format) => {
                let number = format.number();
                Err(Error::unsupported(format!(
                    "LAS {self} does not support point format {number}"
                ))
                .remedy("choose another ‹las_version› or ‹point_format›"))
            }
            _ => Ok(()),
        }
    }
}

impl FromStr for LasVersion {
    type Err = String;

    /// "1.4".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let found = Self::ALL.into_iter().find(|version| version.to_string() == text.trim());
        found.ok_or_else(|| "expected 1.2, 1.3, 1.4 or 1.5".to_owned())
    }
}

impl fmt::Display for LasVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "1.{}", self.minor)
    }
}

impl TryFrom<String> for LasVersion {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        text.parse()
    }
}

impl From<LasVersion> for String {
    fn from(version: LasVersion) -> Self {
        version.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_have_the_points_that_the_standard_gives_them() {
        let format = |number| PointFormat::new(number).unwrap();
        for (number, versions) in [
            (0, "1.2 1.3 1.4"),
            (3, "1.2 1.3 1.4"),
            (4, "1.3 1.4"),
            (5, "1.3 1.4"),
            (6, "1.4 1.5"),
            (10, "1.4 1.5"),
        ] {
            let fits =
                |version: &LasVersion| version.check(format(number), PointPacking::Plain).is_ok();
            let found: Vec<_> =
                LasVersion::ALL.iter().filter(|v| fits(v)).map(LasVersion::to_string).collect();
            assert_eq!(found.join(" "), versions, "{number}");
            assert_eq!(LasVersion::of(format(number)).to_string(), versions[..3], "{number}");
        }
        assert_eq!(LasVersion::V1_5.holding(format(3)), format(7));
        assert!(LasVersion::V1_5.check(format(6), PointPacking::Nodes).is_err());
        assert!(LasVersion::V1_4.check(format(6), PointPacking::Nodes).is_ok());
        assert!(LasVersion::V1_4.check(format(6), PointPacking::Text).is_err());
        for text in ["1.1", "1.6", "15", "", "1.50"] {
            assert!(text.parse::<LasVersion>().is_err(), "{text}");
        }
    }
}
