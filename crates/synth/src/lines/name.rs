//! The name of synthetic lines, such as `koch,vertices=1000000`: parsed and printed.

use std::fmt;

use super::{LineFamily, SHAPES, SyntheticLines};
use crate::SynthParameter;
use crate::parameters::{GivenSynthParameter, NameGrammar};
use terrane_base::error::Result;
use terrane_base::registry::{RegistryEntry, find, named};

/// The parameters of synthetic lines.
pub const PARAMETERS: &[SynthParameter] = &[
    SynthParameter {
        key: "vertices",
        about: "vertices per feature",
        default: 10_000.0,
        range: (2.0, 1e8),
        whole: true,
    },
    SynthParameter {
        key: "features",
        about: "number of features, side by side",
        default: 1.0,
        range: (1.0, 1e9),
        whole: true,
    },
    SynthParameter {
        key: "size",
        about: "side of the bounding square of a feature",
        default: 1000.0,
        range: (1e-6, 1e9),
        whole: false,
    },
    SynthParameter {
        key: "seed",
        about: "random seed, an integer",
        default: 1.0,
        range: (0.0, u64::MAX as f64),
        whole: true,
    },
];

fn default(key: &str) -> f64 {
    PARAMETERS.iter().find(|p| p.key == key).map_or(0.0, |p| p.default)
}

impl SyntheticLines {
    /// True for the name of synthetic lines: its first word is one of [`SHAPES`].
    pub fn is_named(name: &str) -> bool {
        find(SHAPES, first_word(name)).is_some()
    }

    /// The lines with this name: a shape, then any of [`PARAMETERS`] as `key=value`, separated by
    /// commas, in any order, each at most once. Fails with
    /// [`ErrorKind::Usage`](terrane_base::ErrorKind::Usage), which lists the parameters.
    pub fn parse(name: &str) -> Result<Self> {
        let shape = named(SHAPES, first_word(name))?;
        let known = PARAMETERS.iter().collect();
        let words = NameGrammar { what: "line", kind: shape.name, known };
        let mut lines = Self {
            shape,
            vertices: default("vertices") as u32,
            features: default("features") as u32,
            size: default("size"),
            seed: default("seed") as u64,
        };
        for given in words.read(name.split(',').skip(1).map(str::trim), name)? {
            lines.set(&given)?;
        }
        Ok(lines)
    }

    fn set(&mut self, given: &GivenSynthParameter<'_>) -> Result<()> {
        match given.key {
            "vertices" => self.vertices = given.value as u32,
            "features" => self.features = given.value as u32,
            "size" => self.size = given.value,
            _ => self.seed = given.whole()?,
        }
        Ok(())
    }
}

fn first_word(name: &str) -> &str {
    name.split(',').next().unwrap_or_default().trim()
}

impl RegistryEntry for LineFamily {
    const KIND: &'static str = "line shape";

    fn name(&self) -> &'static str {
        self.name
    }
}

/// The name, which [`SyntheticLines::parse`] parses into the same lines.
impl fmt::Display for SyntheticLines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { shape, vertices, features, size, seed } = self;
        write!(f, "{},vertices={vertices},features={features},size={size},seed={seed}", shape.name)
    }
}
