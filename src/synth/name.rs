//! A terrain's name, such as `rough,size=80000,seed=7`: parsed and printed.

use std::fmt;

use super::{CHARACTERS, Character, PARAMETERS, Parameter, Terrain};
use crate::error::{Error, Result};

impl Terrain {
    /// The terrain with this name: a character, then any of its parameters as `key=value`,
    /// separated by commas, in any order, each at most once; width and height go before size. Fails
    /// with [`ErrorKind::Usage`](crate::ErrorKind::Usage) and the words known.
    pub fn parse(name: &str) -> Result<Self> {
        let mut words = name.split(',').map(str::trim);
        let character = words.next().unwrap_or_default();
        let mut terrain = Self::new(find(character)?);
        let mut given: Vec<[&str; 2]> = Vec::new();
        for word in words {
            let pair = terrain.split(word)?;
            if given.iter().any(|[key, _]| *key == pair[0]) {
                return Err(Error::usage(format!("{} is given twice in {name:?}", pair[0]))
                    .remedy("give each parameter once"));
            }
            given.push(pair);
        }
        given.sort_by_key(|[key, _]| *key != "size");
        given.into_iter().try_for_each(|[key, text]| terrain.set(key, text))?;
        Ok(terrain)
    }

    /// The terrain of this kind with all parameters at their defaults.
    pub fn new(character: &'static Character) -> Self {
        let default = |key| PARAMETERS.iter().find(|p| p.key == key).map_or(0.0, |p| p.default);
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

    /// Key and value of a parameter.
    fn split<'a>(&self, word: &'a str) -> Result<[&'a str; 2]> {
        if word.is_empty() {
            return Err(Error::usage("the terrain's name has an empty parameter")
                .remedy("remove the comma too many"));
        }
        let (key, text) = word.split_once('=').ok_or_else(|| self.unknown(word))?;
        Ok([key.trim(), text.trim()])
    }

    fn set(&mut self, key: &str, text: &str) -> Result<()> {
        let parameter = self.parameters().find(|p| p.key == key);
        let parameter = parameter.ok_or_else(|| self.unknown(key))?;
        let value = check(parameter, text)?;
        match key {
            "size" => (self.width, self.height) = (value as u32, value as u32),
            "width" => self.width = value as u32,
            "height" => self.height = value as u32,
            "seed" => self.seed = text.parse().map_err(|_| wrong(parameter, text))?,
            "cell" => self.cell = value,
            "relief" => self.relief = value,
            _ => self.own = value,
        }
        Ok(())
    }

    /// Every parameter this terrain has.
    fn parameters(&self) -> impl Iterator<Item = &'static Parameter> + use<> {
        PARAMETERS.iter().chain(self.character.own.as_ref())
    }

    fn unknown(&self, key: &str) -> Error {
        let known: Vec<&str> = self.parameters().map(|p| p.key).collect();
        let name = self.character.name;
        Error::usage(format!("the terrain {name:?} has no parameter {key:?}"))
            .remedy(format!("it has {} (as key=value)", known.join(", ")))
    }
}

fn find(name: &str) -> Result<&'static Character> {
    CHARACTERS.iter().find(|c| c.name == name).ok_or_else(|| {
        let known: Vec<&str> = CHARACTERS.iter().map(|c| c.name).collect();
        Error::usage(format!("there is no terrain named {name:?}"))
            .remedy(format!("there are {}", known.join(", ")))
    })
}

fn check(parameter: &Parameter, text: &str) -> Result<f64> {
    let value: f64 = text.parse().map_err(|_| wrong(parameter, text))?;
    let (least, most) = parameter.range;
    let sound = (least..=most).contains(&value) && !(parameter.whole && value.fract() != 0.0);
    if sound { Ok(value) } else { Err(wrong(parameter, text)) }
}

fn wrong(parameter: &Parameter, text: &str) -> Error {
    let (least, most) = parameter.range;
    let kind = if parameter.whole { "a whole number" } else { "a number" };
    Error::usage(format!("{}={text} of the terrain makes no sense", parameter.key))
        .remedy(format!("give {kind} from {least} to {most} ({})", parameter.about))
}

/// The name that [`Terrain::parse`] turns back into the same terrain.
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
    use crate::error::ErrorKind;

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
