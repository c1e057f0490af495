//! Where the tolerance of a mesh holds: at samples, or along the grid lines between them as well.

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
    /// At every valid sample. Between samples the error may be larger.
    #[default]
    Samples,
    /// At every valid sample and on the grid lines between neighbouring samples. On these lines all interpolations of
    /// a grid agree (bilinear, or either diagonal of a cell). The error on a line is largest at a sample or where a
    /// mesh edge crosses the line.
    Surface,
}

impl ErrorBound {
    /// All values.
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
