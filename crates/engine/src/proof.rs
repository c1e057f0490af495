//! Verification of written files, and reports on any files.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;
use terrane_base::error::Result;
use terrane_options::{Options, check};
use terrane_raster::Inputs;

use crate::operation::{HasGroup, Job};
use crate::{Cancel, Progress, Resources};

/// A written file or folder and its source.
#[derive(Clone, Debug)]
pub struct WrittenOutput {
    /// The file or folder.
    pub file: PathBuf,
    /// The source.
    pub original: Inputs,
}

/// Result of a verification.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ProofVerdict {
    /// True if no promise is known to be broken.
    pub passed: bool,
    /// True if all promises were checked.
    pub judged: bool,
    /// One sentence for each broken promise.
    pub failures: Vec<String>,
    /// Promises that could not be checked.
    pub not_judged: Vec<String>,
}

impl ProofVerdict {
    /// A verdict with these broken promises and unchecked promises.
    pub fn of(failures: Vec<String>, not_judged: Vec<String>) -> Self {
        let (passed, judged) = (failures.is_empty(), not_judged.is_empty());
        Self { passed, judged, failures, not_judged }
    }

    /// Adds a broken promise.
    pub fn fail(&mut self, failure: String) {
        self.passed = false;
        self.failures.push(failure);
    }

    /// Adds an unchecked promise.
    pub fn leave(&mut self, what: String) {
        self.judged = false;
        self.not_judged.push(what);
    }
}

/// Verifies the promises of a written file, by code that is independent of the writer: a struct of options.
pub trait OutputProof:
    Options + Clone + fmt::Debug + Send + Sync + 'static + HasGroup<Resources>
{
    /// Kind of the verified files, such as "meshes of grids".
    const OF: &'static str;
    /// Report type.
    type Report: Serialize + Send;

    /// Verifies a written file. A broken promise is reported, and is not an error.
    ///
    /// # Errors
    /// Files that cannot be read; too little memory; cancelled.
    fn prove(
        &self,
        written: &WrittenOutput,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Self::Report>;

    /// The verdict in a report.
    fn verdict(report: &Self::Report) -> &ProofVerdict;
}

impl<O: OutputProof> Job<'_, O, WrittenOutput> {
    /// Runs the verification. A broken promise is reported, and is not an error: the `verdict` has not `passed`, and
    /// its `failures` name each broken promise and its place; `judged` is true if all promises were checked.
    ///
    /// # Errors
    /// Invalid combinations of options; files that cannot be read or compared; too little memory; cancelled.
    pub fn run(self) -> Result<O::Report> {
        self.act(|written, options, progress, cancel| {
            check(options)?;
            options.prove(&written, progress, cancel)
        })
    }
}

/// A report on files of one kind: a struct of options.
pub trait Inspection:
    Options + Clone + fmt::Debug + Send + Sync + 'static + HasGroup<Resources>
{
    /// Kind of the files, such as "grids".
    const OF: &'static str;
    /// Report type.
    type Report: Serialize + Send;

    /// Reports on files, out of core.
    ///
    /// # Errors
    /// Files that cannot be read, or are of another kind; too little memory; cancelled.
    fn inspect(
        &self,
        inputs: &Inputs,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Self::Report>;
}

impl<O: Inspection> Job<'_, O> {
    /// Reports on the files.
    ///
    /// # Errors
    /// Invalid combinations of options; files that cannot be read; too little memory; cancelled.
    pub fn run(self) -> Result<O::Report> {
        self.act(|inputs, options, progress, cancel| {
            check(options)?;
            options.inspect(&inputs, progress, cancel)
        })
    }
}
