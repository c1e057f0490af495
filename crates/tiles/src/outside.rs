//! The ground beyond a grid.

use serde::{Deserialize, Serialize};
use terrane_options::Choice;

/// Terrain between the edge of a grid and the sides of its tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TilesBeyond {
    /// Falls or rises from the edge to the ellipsoid, 1 m in 2 m.
    #[default]
    Taper,
    /// Continues at the height of the edge.
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
