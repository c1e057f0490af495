//! The goal of a mesh of a grid: a tolerance, or a number of vertices or triangles.

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};

/// The goal of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TinGoal {
    /// No valid sample further than this from the surface, vertically.
    MaxError(f64),
    /// The smallest tolerance whose mesh has at most this many vertices.
    MaxVertices(u64),
    /// The smallest tolerance whose mesh has at most this many triangles.
    MaxTriangles(u64),
}

impl TinGoal {
    /// Fails on a tolerance that is negative, infinite or NaN, and on a budget of 0.
    pub(super) fn check(self) -> Result<()> {
        match self {
            Self::MaxError(e) if !(e.is_finite() && e >= 0.0) => {
                Err(Error::usage(format!("{e} is not a valid maximum error"))
                    .remedy("pass a number of 0 or more, in the unit of the heights"))
            }
            Self::MaxVertices(0) | Self::MaxTriangles(0) => {
                Err(Error::usage("a mesh needs at least 3 vertices and 1 triangle")
                    .remedy("raise ‹max_vertices› or ‹max_triangles›"))
            }
            _ => Ok(()),
        }
    }
}
