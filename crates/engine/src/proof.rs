//! Proofs of written files, and reports on any files.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;
use terrane_base::error::Result;
use terrane_options::{Options, check};
use terrane_raster::Inputs;

use crate::operation::{HasGroup, Job};
use crate::{Cancel, Progress, Resources};

/// A file or folder that was written, and what it was made from.
#[derive(Clone, Debug)]
pub struct WrittenOutput {
    /// The file or folder.
    pub file: PathBuf,
    /// What it was made from.
    pub original: Inputs,
}

/// The result of a proof.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ProofVerdict {
    /// True when no promise is known to be broken.
    pub passed: bool,
    /// True when all that is promised was judged.
    pub judged: bool,
    /// One sentence for each broken promise.
    pub failures: Vec<String>,
    /// What is promised and could not be judged.
    pub not_judged: Vec<String>,
}

impl ProofVerdict {
    /// A verdict with these broken promises, and with what could not be judged.
    pub fn of(failures: Vec<String>, not_judged: Vec<String>) -> Self {
        let (passed, judged) = (failures.is_empty(), not_judged.is_empty());
        Self { passed, judged, failures, not_judged }
    }

    /// Adds a broken promise.
    pub fn fail(&mut self, failure: String) {
        self.passed = false;
        self.failures.push(failure);
    }

    /// Adds what could not be judged.
    pub fn leave(&mut self, what: String) {
        self.judged = false;
        self.not_judged.push(what);
    }
}

/// A proof that a written file keeps its promises, by code that shares nothing with the code that wrote it: a struct of
/// options.
pub trait OutputProof:
    Options + Clone + fmt::Debug + Send + Sync + 'static + HasGroup<Resources>
{
    /// What is proved, for people, such as "meshes of grids".
    const OF: &'static str;
    /// What is told of it.
    type Report: Serialize + Send;

    /// The proof of what was written. A broken promise is no error but a report that says so.
    ///
    /// # Errors
    /// What keeps the proof from being done: files that cannot be read, too little memory; cancelled.
    fn prove(
        &self,
        written: &WrittenOutput,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Self::Report>;

    /// The verdict of a report.
    fn verdict(report: &Self::Report) -> &ProofVerdict;
}

impl<O: OutputProof> Job<'_, O, WrittenOutput> {
    /// Does the proof. A broken promise is no error, but a report: its `verdict` has not `passed`, and its `failures` say
    /// what and where; `judged` is true when all that is promised was looked at.
    ///
    /// # Errors
    /// Options that do not go together; files that cannot be read or compared; too little memory; cancelled.
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
    /// The kind of files, for people, such as "grids".
    const OF: &'static str;
    /// What is told.
    type Report: Serialize + Send;

    /// What files are, out of core.
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
    /// Looks at the files and tells what they are.
    ///
    /// # Errors
    /// Options that do not go together; files that cannot be read; too little memory; cancelled.
    pub fn run(self) -> Result<O::Report> {
        self.act(|inputs, options, progress, cancel| {
            check(options)?;
            options.inspect(&inputs, progress, cancel)
        })
    }
}
