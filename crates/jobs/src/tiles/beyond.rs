//! The ground beyond a grid.

use serde::{Deserialize, Serialize};

/// The ground between the edge of a grid and the sides of the tiles that hold it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Beyond {
    /// Falls (or rises) from the edge to the ellipsoid, one metre for two.
    #[default]
    Taper,
    /// Goes on at the heights of the edge.
    Level,
}

impl Beyond {
    /// All of them with their names and what they are.
    pub const ALL: [(Self, &'static str, &'static str); 2] = [
        (Self::Taper, "taper", "falls from the edge to the ellipsoid, one metre for two"),
        (Self::Level, "level", "goes on at the heights of the edge"),
    ];

    /// That of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, own, _)| *own == name).map(|(beyond, ..)| *beyond)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(own, ..)| *own == self).map_or("", |(_, name, _)| name)
    }

    /// Metres that it falls for each metre.
    pub(super) fn slope(self) -> f64 {
        match self {
            Self::Taper => 0.5,
            Self::Level => 0.0,
        }
    }
}
