//! The terrain models (DTM, DSM, CHM), and the sources of ground points.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_gridding::{Statistic, StatisticRequest, Subject};
use terrane_ground as ground;

/// A terrain model, which selects its own points, instead of a statistic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SurfaceModel {
    /// Ground: linear in the Delaunay triangulation of ground points.
    Dtm,
    /// Surface model: triangulated first returns with canopy pits removed
    /// ([`canopy`](super::super::GridJob::canopy)).
    Dsm,
    /// Canopy height: the surface minus the ground, at least 0.
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
    /// Points of the ground classes; if there are none, points found by the best method.
    #[default]
    Auto,
    /// Points of the ground classes.
    Class,
    /// Points found by a method among last returns without noise.
    Method(ground::Request),
}

impl GroundFrom {
    /// By the morphological filter.
    pub const PMF: Self = Self::Method(ground::Request::PMF);

    /// True if a method is named, so that classes are ignored.
    pub(crate) fn is_method(self) -> bool {
        matches!(self, Self::Method(_))
    }

    /// The method to use without ground classes.
    pub(crate) fn method(self) -> ground::Request {
        match self {
            Self::Method(request) => request,
            Self::Auto | Self::Class => ground::Request::DEFAULT,
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
            _ => ground::Request::parse(text).map(Self::Method),
        }
    }
}

impl fmt::Display for GroundFrom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Class => f.write_str("class"),
            Self::Method(request) => request.fmt(f),
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

/// Default class of ground points.
pub(crate) const GROUND: u8 = 2;
/// Classes of noise, below the ground and in the air.
pub(crate) const NOISE: [u8; 2] = [7, 18];
