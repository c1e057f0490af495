//! Of what a tolerance is promised: of samples, or of the whole surface.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::registry::{RegistryEntry, named};

/// Where a mesh is no further than its tolerance from the grid, vertically.
///
/// ```
/// use terrane_base::bound::ErrorBound;
/// assert_eq!("surface".parse::<ErrorBound>()?, ErrorBound::Surface);
/// assert_eq!(ErrorBound::Samples.to_string(), "samples");
/// # Ok::<(), terrane_base::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ErrorBound {
    /// At every valid sample. Between samples a mesh may be further off.
    #[default]
    Samples,
    /// At every point of every line between two neighbouring samples of the surface, as well. There all
    /// readings of a grid agree (bilinear, or cut into triangles either way), so it is where a surface
    /// between samples is known. A mesh is furthest from such a line at a sample or where one of its
    /// edges crosses the line.
    Surface,
}

impl ErrorBound {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Samples, Self::Surface];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Samples => "samples",
            Self::Surface => "surface",
        }
    }
}

impl RegistryEntry for ErrorBound {
    const KIND: &'static str = "bound";

    fn name(&self) -> &'static str {
        (*self).name()
    }
}

impl fmt::Display for ErrorBound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for ErrorBound {
    type Err = crate::Error;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        named(&Self::ALL, name).copied()
    }
}
