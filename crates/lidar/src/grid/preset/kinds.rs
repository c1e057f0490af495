//! The terrain models (DTM, DSM, CHM), and the sources of ground points.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_gridding::{Statistic, StatisticRequest, Subject};
use terrane_ground as ground;

/// A model of the terrain that is made of the points it takes, instead of a statistic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SurfaceModel {
    /// The ground: its points, linear in their Delaunay triangulation.
    Dtm,
    /// What is seen from above, linear in triangulations, without the pits of crowns ([`canopy`](super::super::GridJob::canopy)).
    Dsm,
    /// The height of the second above the first, nowhere below 0.
    Chm,
}

impl SurfaceModel {
    /// The band that holds it.
    pub fn band(self) -> StatisticRequest {
        let label = match self {
            Self::Dtm => "dtm",
            Self::Dsm => "dsm",
            Self::Chm => "chm",
        };
        let statistic = Statistic::linear(None);
        StatisticRequest { statistic, label: label.to_owned(), subject: Subject::default() }
    }
}

/// Which points are ground.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum GroundFrom {
    /// Those of the classes, or found by the best method where there is none of them.
    #[default]
    Auto,
    /// Those of the classes.
    Class,
    /// Those that a method finds among last returns that are no noise.
    Method(ground::Asked),
}

impl GroundFrom {
    /// By the morphological filter.
    pub const FILTER: Self = Self::Method(ground::Asked::FILTER);

    /// True when a method is named, so that classes are not asked for.
    pub(crate) fn is_method(self) -> bool {
        matches!(self, Self::Method(_))
    }

    /// The method that finds it where classes do not tell.
    pub(crate) fn method(self) -> ground::Asked {
        match self {
            Self::Method(asked) => asked,
            Self::Auto | Self::Class => ground::Asked::BEST,
        }
    }
}

impl FromStr for GroundFrom {
    type Err = Error;

    /// "auto", "class", or a method with its parameters.
    fn from_str(text: &str) -> Result<Self> {
        match text.to_ascii_lowercase().as_str() {
            "auto" => Ok(Self::Auto),
            "class" => Ok(Self::Class),
            _ => ground::Asked::parse(text).map(Self::Method),
        }
    }
}

impl fmt::Display for GroundFrom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Class => f.write_str("class"),
            Self::Method(asked) => asked.fmt(f),
        }
    }
}

impl From<GroundFrom> for String {
    fn from(from: GroundFrom) -> Self {
        from.to_string()
    }
}

impl TryFrom<String> for GroundFrom {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

/// The class of ground points, unless others are named.
pub(crate) const GROUND: u8 = 2;
/// Classes of noise, below the ground and in the air.
pub(crate) const NOISE: [u8; 2] = [7, 18];
