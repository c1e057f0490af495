//! Methods with parameters, known by name, and how one is asked for.

use std::fmt;

use terrane_base::error::Result;
use terrane_base::parameters::{Parameter, ParameterValues};
use terrane_base::registry::{RegistryEntry, named};

/// What the methods of one registry have beside names and parameters.
pub trait FinderRegistry: Copy + fmt::Debug + 'static {
    /// What one of them is called; the last word takes an s for several.
    const KIND: &'static str;
    /// All of them.
    const METHODS: &'static [FinderMethod<Self>];
}

/// One method of a registry.
#[derive(Debug)]
pub struct FinderMethod<F: FinderRegistry> {
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
pub struct FinderRequest<F: FinderRegistry> {
    method: &'static FinderMethod<F>,
    values: ParameterValues,
}

impl<F: FinderRegistry> PartialEq for FinderRequest<F> {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name() && self.values == other.values
    }
}

impl<F: FinderRegistry> FinderRequest<F> {
    /// A method with its defaults.
    pub const fn plain(method: &'static FinderMethod<F>) -> Self {
        Self { method, values: ParameterValues::usual(method.parameters) }
    }

    /// Reads a method as it is asked for: `csf:rigidness=2,cloth=1`.
    ///
    /// # Errors
    /// Usage: a name or parameter that is not known (the known ones are told), one twice, or a value
    /// out of its range.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, parameters) = text.split_once(':').unwrap_or((text, ""));
        let method = named(F::METHODS, name.trim())?;
        Ok(Self {
            method,
            values: ParameterValues::parse(method.name, method.parameters, parameters)?,
        })
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

impl<F: FinderRegistry> fmt::Display for FinderRequest<F> {
    /// As [`parse`](FinderRequest::parse) reads it, with all parameters.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.values.write(self.name(), self.method.parameters, f)
    }
}

impl<F: FinderRegistry> RegistryEntry for FinderMethod<F> {
    const KIND: &'static str = F::KIND;

    fn name(&self) -> &'static str {
        self.name
    }
}
