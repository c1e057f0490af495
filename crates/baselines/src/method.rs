//! A method of the textbooks: an entry of the registry.

use crate::result::BaselineTin;
use crate::settings::BaselineTask;
use terrane_base::error::Result;
use terrane_base::registry::RegistryEntry;

/// What a method says of the error of its mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MethodPromise {
    /// No sample is further off than the tolerance; equal is allowed.
    Samples,
    /// Nothing by itself: the error is measured, and told. Where a largest error is given, as many vertices are
    /// taken as keep it.
    Measured,
}

impl MethodPromise {
    /// In words.
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
    /// Who described it.
    pub source: &'static str,
    /// Complexity, for m vertices of n samples.
    pub time: &'static str,
    /// What it holds in memory.
    pub memory: &'static str,
    /// What it promises when it is given a largest error.
    pub promise: MethodPromise,
    /// Whether it leaves open how vertices are connected.
    pub takes_triangulation: bool,
    /// Whether its triangles are Delaunay on the lattice of samples, unless another triangulation is asked for.
    pub is_delaunay: bool,
    /// Whether it can be given a number of vertices or triangles instead of a largest error.
    pub takes_budget: bool,
    /// Most bytes it takes for a sample, its height and the result included.
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
