//! The ground beyond a grid.

use serde::{Deserialize, Serialize};
use terrane_options::Choice;

/// Ground between the edge of a grid and the sides of the tiles that contain it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TilesBeyond {
    /// Descends (or ascends) from the edge to the ellipsoid, one metre per two metres.
    #[default]
    Taper,
    /// Continues at the heights of the edge.
    Level,
}

impl TilesBeyond {
    /// Descent in metres per metre.
    pub(super) fn slope(self) -> f64 {
        match self {
            Self::Taper => 0.5,
            Self::Level => 0.0,
        }
    }
}
