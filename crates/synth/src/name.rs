//! A terrain's name, such as `rough,size=80000,seed=7`: parsed and printed.

use std::fmt;

use super::parameters::{GivenSynthParameter, NameGrammar};
use super::{CHARACTERS, PARAMETERS, Terrain, TerrainKind};
use terrane_base::error::Result;
use terrane_base::registry::{RegistryEntry, named};

impl Terrain {
    /// The terrain with this name: a character, then any of its parameters as `key=value`,
    /// separated by commas, in any order, each at most once; width and height override size. Fails
    /// with [`ErrorKind::Usage`](terrane_base::ErrorKind::Usage), which lists the parameters.
    pub fn parse(name: &str) -> Result<Self> {
        let mut words = name.split(',').map(str::trim);
        let character = words.next().unwrap_or_default();
        let mut terrain = Self::new(named(CHARACTERS, character)?);
        for given in terrain.words().read(words, name)? {
            terrain.set(&given)?;
        }
        Ok(terrain)
    }

    /// The terrain of this kind with all parameters at their defaults.
    pub fn new(character: &'static TerrainKind) -> Self {
        Self {
            character,
            width: default("width") as u32,
            height: default("height") as u32,
            seed: default("seed") as u64,
            cell: default("cell"),
            relief: default("relief"),
            own: character.own.map_or(0.0, |own| own.default),
        }
    }

    fn set(&mut self, given: &GivenSynthParameter<'_>) -> Result<()> {
        let value = given.value;
        match given.key {
            "size" => (self.width, self.height) = (value as u32, value as u32),
            "width" => self.width = value as u32,
            "height" => self.height = value as u32,
            "seed" => self.seed = given.whole()?,
            "cell" => self.cell = value,
            "relief" => self.relief = value,
            _ => self.own = value,
        }
        Ok(())
    }

    /// All parameters of this terrain.
    fn words(&self) -> NameGrammar {
        let known = PARAMETERS.iter().chain(self.character.own.as_ref()).collect();
        NameGrammar { what: "terrain", kind: self.character.name, known }
    }
}

fn default(key: &str) -> f64 {
    PARAMETERS.iter().find(|p| p.key == key).map_or(0.0, |p| p.default)
}

impl RegistryEntry for TerrainKind {
    const KIND: &'static str = "terrain";

    fn name(&self) -> &'static str {
        self.name
    }
}

/// The name, which [`Terrain::parse`] parses into the same terrain.
impl fmt::Display for Terrain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { character, width, height, seed, cell, relief, own } = self;
        write!(f, "{},width={width},height={height},seed={seed}", character.name)?;
        write!(f, ",cell={cell},relief={relief}")?;
        match character.own {
            Some(parameter) => write!(f, ",{}={own}", parameter.key),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::ErrorKind;

    #[test]
    fn names_round_trip() {
        let terrain =
            Terrain::parse("salt, size=80000,height=3,seed=18446744073709551615,voids=0.01");
        let terrain = terrain.unwrap();
        assert_eq!((terrain.width, terrain.height, terrain.seed), (80_000, 3, u64::MAX));
        let again = Terrain::parse(&terrain.to_string()).unwrap();
        assert_eq!(again.to_string(), terrain.to_string());
        assert_eq!(again.own, 0.01);
    }

    #[test]
    fn mistakes_name_what_is_known() {
        for (name, expected) in [
            ("", "rough, smooth"),
            ("ruogh", "rough, smooth"),
            ("rough,sise=3", "size, width"),
            ("rough,voids=0.1", "size, width"),
            ("salt,voids", "voids"),
            ("rough,size=0", "whole number from 1 to 1073741824"),
            ("rough,size=1073741825", "whole number"),
            ("rough,size=1.5", "whole number"),
            ("rough,size=many", "whole number"),
            ("rough,seed=-1", "whole number"),
            ("rough,seed=1e3", "whole number"),
            ("rough,cell=nan", "a number from 0.001"),
            ("rough,cell=inf", "a number from 0.001"),
            ("salt,voids=2", "from 0 to 1"),
        ] {
            let error = Terrain::parse(name).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Usage, "{name}");
            assert!(error.to_string().contains(expected), "{name}: {error}");
        }
    }
}
