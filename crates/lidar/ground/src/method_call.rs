//! Registries of methods with parameters, and their parser.

use std::fmt;

use terrane_base::error::Result;
use terrane_base::parameters::{Parameter, ParameterValues};
use terrane_base::registry::{RegistryEntry, named};

/// A registry of methods.
pub trait FinderRegistry: Copy + fmt::Debug + 'static {
    /// Name of a method in errors, in the singular.
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
    /// Its parameters.
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

    /// Parses a method with parameters: `csf:rigidness=2,cloth=1`.
    ///
    /// # Errors
    /// Usage: an unknown name or parameter (the error lists the known ones), a duplicate, or a value out of
    /// range.
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

    /// The value of a parameter; NaN if there is none of that name.
    pub(crate) fn value(&self, key: &str) -> f64 {
        self.values.get(self.method.parameters, key)
    }

    /// Its implementation.
    pub(crate) fn finder(&self) -> &'static F {
        &self.method.finder
    }
}

impl<F: FinderRegistry> fmt::Display for FinderRequest<F> {
    /// The text for [`parse`](FinderRequest::parse), with all parameters.
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
