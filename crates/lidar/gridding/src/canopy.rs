//! Canopy surface methods, which remove pits from surface models: by name.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_base::parameters::{Parameter, ParameterValues};
use terrane_base::registry::{RegistryEntry, named};

/// All methods. The first is the default.
pub const METHODS: &[CanopyMethod] = &[PIT_FREE, SPIKE_FREE];

const PIT_FREE: CanopyMethod = CanopyMethod {
    name: "pit-free",
    source: "Khosravipour and others 2014",
    about: "maximum of triangulations of first returns above several height thresholds",
    parameters: &[],
    kind: CanopyMethodKind::PitFree,
};

const SPIKE_FREE: CanopyMethod = CanopyMethod {
    name: "spike-free",
    source: "Khosravipour and others 2016",
    about: "all returns from top to bottom; small triangles freeze and take no lower returns",
    parameters: &[
        Parameter::new(
            "freeze",
            f64::NAN,
            [0.0, 1000.0],
            "maximum edge of triangles that freeze, metres; auto is three times the pulse spacing",
        ),
        Parameter::new(
            "buffer",
            0.5,
            [0.0, 1000.0],
            "triangles freeze once the next returns are lower by this, metres",
        ),
    ],
    kind: CanopyMethodKind::SpikeFree,
};

/// One method of the registry.
#[derive(Debug)]
pub struct CanopyMethod {
    /// Name for `--canopy`, unique.
    pub name: &'static str,
    /// Where it was published.
    pub source: &'static str,
    /// One line for the documentation.
    pub about: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    kind: CanopyMethodKind,
}

#[derive(Clone, Copy, Debug)]
enum CanopyMethodKind {
    PitFree,
    SpikeFree,
}

/// The algorithm of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CanopyAlgorithm {
    /// As in [`PitFree`](super::pitfree::PitFree).
    PitFree,
    /// Freezes small triangles, from the highest point down.
    SpikeFree {
        /// Longest edge of triangles that freeze, in metres; `None` for three times the spacing of pulses.
        freeze: Option<f64>,
        /// Distance of the next points below the lowest corner at which a triangle freezes, in metres.
        buffer: f64,
    },
}

/// A method with its parameters.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Canopy {
    method: &'static CanopyMethod,
    values: ParameterValues,
}

impl Canopy {
    /// The name of the method.
    pub fn name(&self) -> &'static str {
        self.method.name
    }

    fn value(&self, key: &str) -> f64 {
        self.values.get(self.method.parameters, key)
    }

    /// The algorithm and its parameters.
    pub fn algorithm(&self) -> CanopyAlgorithm {
        match self.method.kind {
            CanopyMethodKind::PitFree => CanopyAlgorithm::PitFree,
            CanopyMethodKind::SpikeFree => CanopyAlgorithm::SpikeFree {
                freeze: Some(self.value("freeze")).filter(|freeze| !freeze.is_nan()),
                buffer: self.value("buffer"),
            },
        }
    }

    /// True for the default method.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl Default for Canopy {
    fn default() -> Self {
        Self { method: &METHODS[0], values: ParameterValues::usual(METHODS[0].parameters) }
    }
}

impl PartialEq for Canopy {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name() && self.values == other.values
    }
}

impl FromStr for Canopy {
    type Err = Error;

    /// Parses a method with parameters: `spike-free:freeze=1.5`.
    fn from_str(text: &str) -> Result<Self> {
        let (name, parameters) = text.split_once(':').unwrap_or((text, ""));
        let method = named(METHODS, name.trim())?;
        Ok(Self {
            method,
            values: ParameterValues::parse(method.name, method.parameters, parameters)?,
        })
    }
}

impl fmt::Display for Canopy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.values.write(self.name(), self.method.parameters, f)
    }
}

impl From<Canopy> for String {
    fn from(canopy: Canopy) -> Self {
        canopy.to_string()
    }
}

impl TryFrom<String> for Canopy {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl RegistryEntry for CanopyMethod {
    const KIND: &'static str = "canopy method";

    fn name(&self) -> &'static str {
        self.name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_read_as_they_are_written() {
        let read = |text: &str| text.parse::<Canopy>().unwrap();
        assert!(
            read("Pit-Free").is_default()
                && read("pit-free").algorithm() == CanopyAlgorithm::PitFree
        );
        let usual = CanopyAlgorithm::SpikeFree { freeze: None, buffer: 0.5 };
        assert_eq!(read("spike-free").algorithm(), usual);
        assert_eq!(read("spike-free:freeze=auto").algorithm(), usual);
        let given = read("spike-free:buffer=0.25,freeze=2");
        assert_eq!(
            given.algorithm(),
            CanopyAlgorithm::SpikeFree { freeze: Some(2.0), buffer: 0.25 }
        );
        assert_eq!(
            read("spike-free:freeze=0").algorithm(),
            CanopyAlgorithm::SpikeFree { freeze: Some(0.0), buffer: 0.5 }
        );
        for method in METHODS {
            let plain = read(method.name);
            assert_eq!(read(&plain.to_string()), plain, "{plain}");
            assert!(method.parameters.iter().all(|p| p.allows(p.default)), "{plain}");
        }
        assert_eq!(read(&given.to_string()), given);
        assert!(given != read("spike-free") && !given.is_default());
    }

    #[test]
    fn what_is_no_method_is_told_with_those_there_are() {
        let told = |text: &str| text.parse::<Canopy>().unwrap_err().to_string();
        assert!(METHODS.iter().all(|m| told("moss").contains(m.name)), "{}", told("moss"));
        assert!(told("spike-free:freeze=-1").contains("freeze=auto (from 0 to 1000)"));
        assert!(told("spike-free:buffer=auto").contains("buffer=0.5"));
        assert!(told("pit-free:freeze=1").contains("takes none"));
    }
}
