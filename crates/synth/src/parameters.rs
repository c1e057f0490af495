//! The `key=value` words of a name, checked against the known parameters.

use super::SynthParameter;
use terrane_base::error::{Error, Result};

/// The parameters of a name.
pub(super) struct NameGrammar {
    /// Noun for messages: "terrain", "cloud".
    pub(super) what: &'static str,
    /// Kind, such as "rough".
    pub(super) kind: &'static str,
    pub(super) known: Vec<&'static SynthParameter>,
}

/// A given parameter: its value and text.
pub(super) struct GivenSynthParameter<'a> {
    pub(super) key: &'static str,
    pub(super) value: f64,
    text: &'a str,
    parameter: &'static SynthParameter,
    what: &'static str,
}

impl GivenSynthParameter<'_> {
    /// The value as a 64-bit integer, which `f64` may not represent.
    pub(super) fn whole(&self) -> Result<u64> {
        self.text.parse().map_err(|_| wrong(self.what, self.parameter, self.text))
    }
}

impl NameGrammar {
    /// Reads `key=value` words, each key at most once; "size" comes first in the result.
    pub(super) fn read<'a>(
        &self,
        words: impl Iterator<Item = &'a str>,
        name: &str,
    ) -> Result<Vec<GivenSynthParameter<'a>>> {
        let mut all: Vec<GivenSynthParameter<'a>> = Vec::new();
        for word in words {
            let given = self.given(word)?;
            if all.iter().any(|other| other.key == given.key) {
                return Err(Error::usage(format!("{} is given twice in {name:?}", given.key))
                    .remedy("give each parameter once"));
            }
            all.push(given);
        }
        all.sort_by_key(|given| given.key != "size");
        Ok(all)
    }

    fn given<'a>(&self, word: &'a str) -> Result<GivenSynthParameter<'a>> {
        if word.is_empty() {
            let message = format!("empty parameter in the {} name", self.what);
            return Err(Error::usage(message).remedy("remove the extra comma"));
        }
        let (key, text) = word.split_once('=').ok_or_else(|| self.unknown(word))?;
        let (key, text) = (key.trim(), text.trim());
        let parameter = self.known.iter().find(|p| p.key == key);
        let parameter = *parameter.ok_or_else(|| self.unknown(key))?;
        let value = check(self.what, parameter, text)?;
        Ok(GivenSynthParameter { key: parameter.key, value, text, parameter, what: self.what })
    }

    fn unknown(&self, key: &str) -> Error {
        let known: Vec<&str> = self.known.iter().map(|p| p.key).collect();
        Error::usage(format!("unknown {} parameter {key:?} for {:?}", self.what, self.kind))
            .remedy(format!("choose from {} (as key=value)", known.join(", ")))
    }
}

fn check(what: &str, parameter: &SynthParameter, text: &str) -> Result<f64> {
    let value: f64 = text.parse().map_err(|_| wrong(what, parameter, text))?;
    let (min, max) = parameter.range;
    let sound = (min..=max).contains(&value) && !(parameter.whole && value.fract() != 0.0);
    if sound { Ok(value) } else { Err(wrong(what, parameter, text)) }
}

fn wrong(what: &str, parameter: &SynthParameter, text: &str) -> Error {
    let (min, max) = parameter.range;
    let kind = if parameter.whole { "a whole number" } else { "a number" };
    Error::usage(format!("invalid {what} parameter {}={text}", parameter.key))
        .remedy(format!("give {kind} from {min} to {max} ({})", parameter.about))
}
