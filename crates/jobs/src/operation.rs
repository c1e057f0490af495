//! Operations: what can be done with grids and features, in one struct of options each, which every door is made from.
//!
//! The command line takes the options by name, Rust by setters of [`Job`], Python by keywords; all come to
//! [`Operation::run`]. A new operation is a file with its options and its work, and a line in [`OPERATIONS`].

use std::fmt;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value as Json};
use terrane_options::{Options, Role, Table, check, fill, to_map};

use crate::colours::ColorReliefOptions;
use crate::contour::ContourOptions;
use crate::convert::ConvertOptions;
use crate::line::LineOptions;
use crate::options::GridOutput;
use crate::outputs::not_among;
use crate::relief::{
    AspectOptions, CurvatureOptions, HillshadeOptions, RoughnessOptions, SlopeOptions, TpiOptions,
    TriOptions,
};
use crate::tiles::TilesOptions;
use crate::{Cancel, Progress, Resources, Silent, memory};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_raster::{self as raster, Inputs};
use terrane_vector as vector;

/// All operations that write a file, in the order of the help.
pub const OPERATIONS: &[AnyOperation] = &[
    AnyOperation::of::<ConvertOptions>(),
    AnyOperation::of::<ContourOptions>(),
    AnyOperation::of::<LineOptions>(),
    AnyOperation::of::<TilesOptions>(),
    AnyOperation::of::<SlopeOptions>(),
    AnyOperation::of::<AspectOptions>(),
    AnyOperation::of::<HillshadeOptions>(),
    AnyOperation::of::<ColorReliefOptions>(),
    AnyOperation::of::<CurvatureOptions>(),
    AnyOperation::of::<RoughnessOptions>(),
    AnyOperation::of::<TpiOptions>(),
    AnyOperation::of::<TriOptions>(),
];

/// A struct of options that has a group of them.
pub trait Has<G> {
    /// The group.
    fn part(&self) -> &G;

    /// The same to change it.
    fn part_mut(&mut self) -> &mut G;
}

/// What an operation reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// A grid.
    Grid,
    /// Features: lines, polygons and points.
    Features,
}

/// What an operation writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writes {
    /// A grid, in any format that is written.
    Grid,
    /// Colours, in a format that holds them.
    Colours,
    /// Lines.
    Lines,
    /// A folder of tiles.
    Tiles,
}

/// What a run reads and writes, and who watches it.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    /// Files of the grid, or of features.
    pub inputs: &'a Inputs,
    /// File to write.
    pub output: &'a Path,
    /// Who is told how far it is.
    pub progress: &'a dyn Progress,
    /// What may stop it.
    pub cancel: &'a Cancel,
}

/// Something that is made of a grid or of features: a struct of options.
pub trait Operation: Options + Clone + fmt::Debug + Send + Sync + 'static + Has<Resources> {
    /// Its name, which is that of its verb, with dashes.
    const NAME: &'static str;
    /// What it reads.
    const READS: Reads = Reads::Grid;
    /// What it writes.
    const WRITES: Writes;
    /// What is told of a run.
    type Report: Serialize + Send;

    /// What can be known to be wrong before the grid is opened, beside ranges and rules of the options.
    ///
    /// # Errors
    /// An output or options that cannot be.
    fn check(&self, output: &Path) -> Result<()>;

    /// Makes it. Nothing appears under the output's name unless it succeeds.
    ///
    /// # Errors
    /// Those of [`check`](Self::check); what is wrong with the grid, the output or the machine.
    fn run(&self, request: Request<'_>) -> Result<Self::Report>;
}

/// An operation whose type does not matter any more.
pub struct AnyOperation {
    /// Its name, with dashes.
    pub name: &'static str,
    /// Its options.
    pub table: &'static Table,
    /// What it reads.
    pub reads: Reads,
    /// What it writes.
    pub writes: Writes,
    /// The defaults of its options.
    pub defaults: fn() -> Map<String, Json>,
    /// What can be known of options by name before anything is opened.
    pub check: fn(&Map<String, Json>, &Path) -> Result<()>,
    /// Runs it with options by name, where how the grid is read is said already.
    pub run: fn(&Call<'_>) -> Result<Json>,
}

/// What a run is asked for.
pub struct Call<'a> {
    /// What it reads and writes.
    pub request: Request<'a>,
    /// How inputs are read, by the names of options, unless one of these says otherwise.
    pub reading: Map<String, Json>,
    /// Options by name.
    pub options: &'a Map<String, Json>,
}

impl AnyOperation {
    const fn of<O: Operation>() -> Self {
        let defaults = || to_map(&O::default());
        let (reads, writes) = (O::READS, O::WRITES);
        let (name, table) = (O::NAME, O::TABLE);
        Self { name, table, reads, writes, defaults, check: check_options::<O>, run: run::<O> }
    }
}

fn run<O: Operation>(call: &Call<'_>) -> Result<Json> {
    let mut given = call.reading.clone();
    given.extend(call.options.clone());
    let options: O = fill(&given)?;
    check_all(&options, call.request)?;
    let report = options.run(call.request)?;
    serde_json::to_value(report)
        .map_err(|e| Error::new(ErrorKind::Internal, format!("the report is no JSON: {e}")))
}

fn check_options<O: Operation>(given: &Map<String, Json>, output: &Path) -> Result<()> {
    let options: O = fill(given)?;
    check(&options)?;
    options.check(output)
}

/// All that can be known to be wrong before the work.
fn check_all<O: Operation>(options: &O, request: Request<'_>) -> Result<()> {
    let Request { inputs, output, .. } = request;
    check(options)?;
    options.check(output)?;
    let names = inputs.names();
    let files = match O::READS {
        Reads::Grid => raster::files(names),
        Reads::Features => vector::files(names),
    };
    // What cannot be found is told of when it is opened.
    let files = files.unwrap_or_else(|_| names.to_vec());
    not_among(&[files, read_beside(options)?].concat(), &[output])
}

/// The files that options name, and that are read.
///
/// # Errors
/// Those of finding the files of a grid.
pub fn read_beside<O: Options>(options: &O) -> Result<Vec<String>> {
    let values = to_map(options);
    let mut files = Vec::new();
    for field in O::TABLE.fields() {
        let Some(name) = values.get(field.name).and_then(Json::as_str) else { continue };
        match field.role {
            Role::Reads => files.push(name.to_owned()),
            Role::ReadsGrid => files.extend(raster::files(&[name.to_owned()])?),
            Role::Result | Role::Run => {}
        }
    }
    Ok(files)
}

/// An amount of memory: a number of bytes, or a text such as `"512M"` or `"4GiB"`. A text that is none
/// fails the job it was given to.
///
/// ```
/// use terrane_jobs::operation::Memory;
/// assert_eq!(Memory::from("2G").bytes().unwrap(), 2 << 30);
/// assert!(Memory::from("much").bytes().is_err());
/// ```
#[derive(Clone, Debug)]
pub struct Memory(std::result::Result<u64, String>);

impl Memory {
    /// So many bytes.
    ///
    /// # Errors
    /// Usage: a text that is no amount.
    pub fn bytes(&self) -> Result<u64> {
        self.0.clone().map_err(|text| {
            Error::usage(format!("{text:?} is no amount of memory"))
                .remedy("give a size such as \"512M\" or \"4GiB\"")
        })
    }
}

impl From<u64> for Memory {
    fn from(bytes: u64) -> Self {
        Self(Ok(bytes))
    }
}

impl From<&str> for Memory {
    fn from(text: &str) -> Self {
        Self(memory::parse(text).ok_or_else(|| text.to_owned()))
    }
}

impl From<String> for Memory {
    fn from(text: String) -> Self {
        Self::from(text.as_str())
    }
}

/// An operation on some files, to be told its options by setters and to be run by [`write`](Self::write).
pub struct Job<'a, O> {
    inputs: Inputs,
    pub(crate) options: O,
    memory: Option<Memory>,
    progress: Box<dyn Progress + Send>,
    cancel: Cancel,
    /// What is in memory has to stay there.
    held: PhantomData<&'a ()>,
}

impl<'a, O: Operation> Job<'a, O> {
    /// The operation on some files.
    pub fn new(inputs: Inputs, options: O) -> Self {
        let (progress, cancel) = (Box::new(Silent), Cancel::default());
        Self { inputs, options, memory: None, progress, cancel, held: PhantomData }
    }

    /// The options as they are by now.
    pub fn options(&self) -> &O {
        &self.options
    }

    /// All of the options, instead of those that were told before.
    pub fn with(self, options: O) -> Self {
        Self { options, ..self }
    }

    /// Most memory for everything the job holds: bytes, or a text such as `"512M"`. Half of the machine's, at most
    /// 4 GiB, unless told otherwise. No result depends on it.
    pub fn memory(self, most: impl Into<Memory>) -> Self {
        Self { memory: Some(most.into()), ..self }
    }

    /// Who is told how far the job is.
    pub fn progress(self, told: impl Progress + Send + 'static) -> Self {
        Self { progress: Box::new(told), ..self }
    }

    /// What may stop the job: once cancelled, it fails with [`ErrorKind::Interrupted`] and leaves nothing behind.
    pub fn cancel(self, by: &Cancel) -> Self {
        Self { cancel: by.clone(), ..self }
    }

    /// Does the work and writes the file, within the memory allowed.
    ///
    /// # Errors
    /// Options out of their range, or that do not go together; damage in the grid; too little memory; an output that
    /// exists or cannot be written; cancelled.
    pub fn write(mut self, path: impl Into<PathBuf>) -> Result<O::Report> {
        let path = path.into();
        if let Some(memory) = &self.memory {
            Has::<Resources>::part_mut(&mut self.options).memory = memory.bytes()?;
        }
        let Self { inputs, progress, cancel, .. } = &self;
        let request = Request { inputs, output: &path, progress: &**progress, cancel };
        check_all(&self.options, request)?;
        self.options.run(request)
    }
}

impl<O: Has<GridOutput>> Job<'_, O> {
    /// A creation option of the format, such as `COMPRESS`, `DEFLATE`; one more each time.
    #[must_use]
    pub fn creation(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.options.part_mut().co.push((key.into(), value.into()));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::OPERATIONS;

    #[test]
    fn names_of_operations_and_of_their_options_are_unique() {
        let is_unique = |mut names: Vec<&str>| {
            names.sort_unstable();
            names.windows(2).all(|pair| pair[0] != pair[1])
        };
        assert!(is_unique(OPERATIONS.iter().map(|operation| operation.name).collect()));
        for operation in OPERATIONS {
            let fields = operation.table.fields();
            let names = fields.iter().flat_map(|own| own.aliases.iter().copied().chain([own.name]));
            assert!(is_unique(names.collect()), "{}", operation.name);
            let letters = fields.iter().filter_map(|own| own.short).map(String::from);
            let letters: Vec<String> = letters.collect();
            assert!(is_unique(letters.iter().map(String::as_str).collect()), "{}", operation.name);
        }
    }
}
