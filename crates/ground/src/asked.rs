//! Methods with parameters, known by name, and how one is asked for.

use std::fmt;

use terrane_base::error::{Error, Result};
use terrane_base::registry::{Named, named};

/// What the methods of one registry have beside names and parameters.
pub trait Finder: Copy + fmt::Debug + 'static {
    /// What one of them is called; the last word takes an s for several.
    const KIND: &'static str;
    /// All of them.
    const METHODS: &'static [Method<Self>];
}

/// One method of a registry.
#[derive(Debug)]
pub struct Method<F: Finder> {
    /// Its name, unique.
    pub name: &'static str,
    /// Where it was published.
    pub source: &'static str,
    /// One line for the documentation.
    pub about: &'static str,
    /// What may follow its name.
    pub parameters: &'static [Parameter],
    pub(crate) finder: F,
}

/// A parameter of a method, a number.
#[derive(Debug)]
pub struct Parameter {
    /// Its name.
    pub key: &'static str,
    /// One line for the documentation, with the unit.
    pub about: &'static str,
    /// Its default.
    pub default: f64,
    /// Its least and its largest value.
    pub range: [f64; 2],
    /// True for whole numbers.
    pub whole: bool,
    /// True where it is either the least or the largest value.
    pub ends: bool,
}

impl Parameter {
    pub(crate) const fn new(
        key: &'static str,
        default: f64,
        range: [f64; 2],
        about: &'static str,
    ) -> Self {
        Self { key, about, default, range, whole: false, ends: false }
    }

    pub(crate) const fn whole(self) -> Self {
        Self { whole: true, ..self }
    }

    pub(crate) const fn ends(self) -> Self {
        Self { ends: true, ..self }
    }

    pub(crate) fn allows(&self, value: f64) -> bool {
        let [least, most] = self.range;
        match self.ends {
            true => self.range.contains(&value),
            false => (least..=most).contains(&value) && (!self.whole || value.fract() == 0.0),
        }
    }

    fn text(&self) -> String {
        let [least, most] = self.range;
        if self.ends {
            return format!("{}={} ({least} or {most})", self.key, self.default);
        }
        let kind = if self.whole { "a whole number " } else { "" };
        format!("{}={} ({kind}from {least} to {most})", self.key, self.default)
    }
}

/// Most parameters of a method.
pub(crate) const MOST: usize = 6;

/// A method with its parameters.
#[derive(Clone, Copy, Debug)]
pub struct Asked<F: Finder> {
    method: &'static Method<F>,
    values: [f64; MOST],
}

impl<F: Finder> PartialEq for Asked<F> {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name() && self.values == other.values
    }
}

impl<F: Finder> Asked<F> {
    /// A method with its defaults.
    pub const fn plain(method: &'static Method<F>) -> Self {
        let (mut values, mut i) = ([0.0; MOST], 0);
        while i < method.parameters.len() {
            values[i] = method.parameters[i].default;
            i += 1;
        }
        Self { method, values }
    }

    /// Reads a method as it is asked for: `csf:rigidness=2,cloth=1`.
    ///
    /// # Errors
    /// Usage: a name or parameter that is not known (the known ones are told), one twice, or a value
    /// out of its range.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, parameters) = text.split_once(':').unwrap_or((text, ""));
        let mut asked = Self::plain(named(F::METHODS, name.trim())?);
        let mut given = [false; MOST];
        for pair in parameters.split(',').map(str::trim).filter(|pair| !pair.is_empty()) {
            let (at, value) = asked.pair(pair)?;
            if std::mem::replace(&mut given[at], true) {
                return Err(Error::usage(format!("\"{pair}\" is given twice")));
            }
            asked.values[at] = value;
        }
        Ok(asked)
    }

    /// The place and the value of a parameter "key=value".
    fn pair(&self, pair: &str) -> Result<(usize, f64)> {
        let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
        let parameters = self.method.parameters;
        let at = parameters.iter().position(|p| p.key.eq_ignore_ascii_case(key.trim()));
        let value = value.trim().parse::<f64>().ok();
        match at.zip(value).filter(|(at, value)| parameters[*at].allows(*value)) {
            Some(found) => Ok(found),
            None => Err(self.refusal(pair)),
        }
    }

    fn refusal(&self, pair: &str) -> Error {
        let error = Error::usage(format!("\"{pair}\" is no parameter of {}", self.name()));
        match self.method.parameters {
            [] => error.remedy(format!("{} takes none", self.name())),
            some => {
                let known: Vec<String> = some.iter().map(Parameter::text).collect();
                error.remedy(format!("it takes {}", known.join(", ")))
            }
        }
    }

    /// The name of the method.
    pub fn name(&self) -> &'static str {
        self.method.name
    }

    /// The value of a parameter; NaN where there is no such.
    pub(crate) fn value(&self, key: &str) -> f64 {
        let at = self.method.parameters.iter().position(|p| p.key == key);
        at.map_or(f64::NAN, |at| self.values[at])
    }

    /// What finds with it.
    pub(crate) fn finder(&self) -> &'static F {
        &self.method.finder
    }
}

impl<F: Finder> fmt::Display for Asked<F> {
    /// As [`parse`](Asked::parse) reads it, with all parameters.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        let pairs = self.method.parameters.iter().zip(self.values).enumerate();
        pairs.into_iter().try_for_each(|(i, (parameter, value))| {
            write!(f, "{}{}={value}", if i == 0 { ':' } else { ',' }, parameter.key)
        })
    }
}

impl<F: Finder> Named for Method<F> {
    const KIND: &'static str = F::KIND;

    fn name(&self) -> &'static str {
        self.name
    }
}
