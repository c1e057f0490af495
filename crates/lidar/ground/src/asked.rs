//! Methods with parameters, known by name, and how one is asked for.

use std::fmt;

use terrane_base::error::Result;
use terrane_base::parameters::{Parameter, Values};
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

/// A method with its parameters.
#[derive(Clone, Copy, Debug)]
pub struct Asked<F: Finder> {
    method: &'static Method<F>,
    values: Values,
}

impl<F: Finder> PartialEq for Asked<F> {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name() && self.values == other.values
    }
}

impl<F: Finder> Asked<F> {
    /// A method with its defaults.
    pub const fn plain(method: &'static Method<F>) -> Self {
        Self { method, values: Values::usual(method.parameters) }
    }

    /// Reads a method as it is asked for: `csf:rigidness=2,cloth=1`.
    ///
    /// # Errors
    /// Usage: a name or parameter that is not known (the known ones are told), one twice, or a value
    /// out of its range.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, parameters) = text.split_once(':').unwrap_or((text, ""));
        let method = named(F::METHODS, name.trim())?;
        Ok(Self { method, values: Values::parse(method.name, method.parameters, parameters)? })
    }

    /// The name of the method.
    pub fn name(&self) -> &'static str {
        self.method.name
    }

    /// The value of a parameter; NaN where there is no such.
    pub(crate) fn value(&self, key: &str) -> f64 {
        self.values.get(self.method.parameters, key)
    }

    /// What finds with it.
    pub(crate) fn finder(&self) -> &'static F {
        &self.method.finder
    }
}

impl<F: Finder> fmt::Display for Asked<F> {
    /// As [`parse`](Asked::parse) reads it, with all parameters.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.values.write(self.name(), self.method.parameters, f)
    }
}

impl<F: Finder> Named for Method<F> {
    const KIND: &'static str = F::KIND;

    fn name(&self) -> &'static str {
        self.name
    }
}
