//! A method of the textbooks: an entry of the registry.

use crate::result::BaselineTin;
use crate::settings::BaselineTask;
use terrane_base::error::Result;
use terrane_base::registry::RegistryEntry;

/// Error promise of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MethodPromise {
    /// The vertical error at every sample is at most the tolerance.
    Samples,
    /// None: the error is measured and reported. For a given maximum error, the number of vertices is increased until it
    /// is met.
    Measured,
}

impl MethodPromise {
    /// As text.
    pub fn text(self) -> &'static str {
        match self {
            Self::Samples => "at samples",
            Self::Measured => "measured",
        }
    }
}

/// A method that makes a mesh of a grid.
#[derive(Clone, Copy, Debug)]
pub struct BaselineMethod {
    /// Name on the command line.
    pub name: &'static str,
    /// One line for help texts.
    pub about: &'static str,
    /// Source in the literature.
    pub source: &'static str,
    /// Complexity, for m vertices of n samples.
    pub time: &'static str,
    /// Data held in memory.
    pub memory: &'static str,
    /// Promise for a given maximum error.
    pub promise: MethodPromise,
    /// True if the connectivity of vertices is free.
    pub takes_triangulation: bool,
    /// True if its triangles are Delaunay on the sample lattice by default.
    pub is_delaunay: bool,
    /// True if a number of vertices or triangles can be given instead of a maximum error.
    pub takes_budget: bool,
    /// Maximum bytes per sample, including its height and the result.
    pub sample_bytes: u64,
    /// Makes a mesh.
    pub run: fn(&BaselineTask<'_>) -> Result<BaselineTin>,
}

impl RegistryEntry for BaselineMethod {
    const KIND: &'static str = "method";

    fn name(&self) -> &'static str {
        self.name
    }
}
