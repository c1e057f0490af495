//! Operations on grids, point clouds and features: one struct of options each, from which all interfaces are derived.
//!
//! The command line takes options by name, Rust by setters of [`Job`], Python by keywords; all call [`Operation::run`].
//!
//! Setters are traits, as a crate cannot add methods to another crate's type: [`Job`] belongs to this crate, the
//! structs of options to the crates of their subjects. The package `terrane`, which depends on all of them, lists the
//! operations.

use std::fmt;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value as Json};
use terrane_options::{
    OptionCodec, OptionRole, OptionTable, Options, changed, check, check_given, check_planned,
    fill, to_map,
};

use crate::options::{
    CloudInput, FeatureInput, FileOutput, FileSize, GridInput, GridOutput, OperationFiles,
    PointFilter, Replacing, Reprojection,
};
use crate::outputs::not_among;
pub use crate::plan::AnyOperation;
use crate::plan::{DescribesRun, PlanKind, RunJob, RunReport, StatusReport};
use crate::skip_bad::Skipped;
use crate::{Cancel, Progress, Resources, Silent, json};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud as cloud;
use terrane_files::path_of;
use terrane_mesh::split;
use terrane_raster::{self as raster, Inputs};
use terrane_vector as vector;

/// Structs of options that contain a group.
pub trait HasGroup<G> {
    /// The group.
    fn part(&self) -> &G;

    /// The group, mutable.
    fn part_mut(&mut self) -> &mut G;
}

/// Implements `HasGroup` for the groups nested in a group: `has_within!(SlopeOptions AspectOptions: DerivativeOptions
/// => [GridInput GridOutput])`.
/// `has_within!(SlopeOptions AspectOptions: DerivativeOptions => [GridInput GridOutput])`.
#[macro_export]
macro_rules! has_within {
    ($($owner:ty)+: $group:ty => $inner:tt) => {$(
        $crate::has_within!(@ $owner, $group, $inner);
    )+};
    (@ $owner:ty, $group:ty, [$($inner:ty)+]) => {$(
        impl $crate::operation::HasGroup<$inner> for $owner {
            fn part(&self) -> &$inner {
                $crate::operation::HasGroup::<$inner>::part($crate::operation::HasGroup::<$group>::part(self))
            }

            fn part_mut(&mut self) -> &mut $inner {
                $crate::operation::HasGroup::<$inner>::part_mut($crate::operation::HasGroup::<$group>::part_mut(self))
            }
        }
    )+};
}

/// Implements [`HasGroup`] for groups of this crate nested in another group, for all structs of options. Only the crate of
/// [`HasGroup`] can do so; others list the structs with [`has_within`](crate::has_within).
macro_rules! has_nested {
    ($($group:ty => $inner:ty),+) => {$(
        impl<O: HasGroup<$group>> HasGroup<$inner> for O {
            fn part(&self) -> &$inner {
                HasGroup::<$inner>::part(HasGroup::<$group>::part(self))
            }

            fn part_mut(&mut self) -> &mut $inner {
                HasGroup::<$inner>::part_mut(HasGroup::<$group>::part_mut(self))
            }
        }
    )+};
}

has_nested!(CloudInput => PointFilter, FileOutput => Replacing, Reprojection => OperationFiles);

/// Input kind of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// A grid.
    Grid,
    /// A point cloud.
    Cloud,
    /// Features: lines, polygons and points.
    Features,
}

/// Output kind of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writes {
    /// A grid, in any supported format.
    Grid,
    /// Colours, in a format that supports them.
    Colours,
    /// A mesh: a file, or a folder of files.
    Mesh,
    /// Features.
    Features,
    /// A folder of tiles.
    Tiles,
    /// Points: a file, or a folder of files.
    Points,
    /// A picture: a PNG file.
    Picture,
    /// A page for browsers: an HTML file.
    Page,
    /// A report for people: an HTML file.
    Report,
}

/// A group of options for reading the input of an operation.
pub trait InputOptions: Options + Clone {
    /// Kind of input.
    const READS: Reads;

    /// The files that names and patterns expand to.
    ///
    /// # Errors
    /// Folders and patterns without files.
    fn files(names: &[String]) -> Result<Vec<String>>;
}

impl InputOptions for GridInput {
    const READS: Reads = Reads::Grid;

    fn files(names: &[String]) -> Result<Vec<String>> {
        match names {
            // A mesh may be a folder, too.
            [one] if split::is_split(&path_of(one)) => Ok(names.to_vec()),
            _ => raster::files(names),
        }
    }
}

impl InputOptions for CloudInput {
    const READS: Reads = Reads::Cloud;

    fn files(names: &[String]) -> Result<Vec<String>> {
        cloud::files(names)
    }
}

impl InputOptions for FeatureInput {
    const READS: Reads = Reads::Features;

    fn files(names: &[String]) -> Result<Vec<String>> {
        vector::files(names)
    }
}

/// Input, output and watchers of a run.
#[derive(Clone, Copy)]
pub struct RunRequest<'a> {
    /// Files of the grid, point cloud or features.
    pub inputs: &'a Inputs,
    /// File to write.
    pub output: &'a Path,
    /// Unreadable files that are left out of the inputs.
    pub skipped: &'a [Skipped],
    /// Whether to measure errors for the report if that takes time.
    pub is_measured: bool,
    /// Progress watcher.
    pub progress: &'a dyn Progress,
    /// Cancellation.
    pub cancel: &'a Cancel,
}

/// An operation on a grid, point cloud or features: a struct of options.
pub trait Operation:
    Options + Clone + fmt::Debug + Send + Sync + 'static + HasGroup<Resources> + HasGroup<Self::Input>
{
    /// Name, equal to the verb, with dashes; with the prefix `cloud-` if the verb also exists for grids.
    const NAME: &'static str;
    /// Options for reading the input.
    type Input: InputOptions;
    /// Kind of output.
    const WRITES: Writes;
    /// Report type.
    type Report: Serialize + Send;

    /// True if the output is a folder.
    fn is_folder(&self) -> bool {
        Self::WRITES == Writes::Tiles
    }

    /// Checks the options before the grid is opened, beyond their ranges and rules.
    ///
    /// # Errors
    /// An invalid output or invalid options.
    fn check(&self, output: &Path) -> Result<()>;

    /// Runs the operation. Nothing appears under the output's name unless it succeeds.
    ///
    /// # Errors
    /// The errors of [`check`](Self::check); faults of the grid, the output or the machine.
    fn run(&self, request: RunRequest<'_>) -> Result<Self::Report>;
}

/// An operation that can be divided into tasks, for several runs or machines.
pub trait Divisible: Operation {
    /// The kind of its plans.
    const KIND: PlanKind;
    /// Unit of the task size.
    const TASK_SIZE: &'static str;
    /// Status report fields of its plans.
    type Status: Serialize;
    /// Run report fields of its plans.
    type Done: Serialize + DescribesRun;

    /// Writes a plan into a folder, the request's output. [`TASK_SIZE`](Self::TASK_SIZE) names the unit of the task
    /// size; the default is a task of moderate size.
    ///
    /// # Errors
    /// The errors of [`run`](Operation::run) that are found before the work; options that plans do not support; a
    /// folder with another plan or other files.
    fn plan(
        &self,
        request: RunRequest<'_>,
        task_size: Option<u32>,
    ) -> Result<StatusReport<Self::Status>>;

    /// Progress of its plan in a folder; checks results quickly, without reading them through.
    ///
    /// # Errors
    /// The folder has no such plan.
    fn status(folder: &Path) -> Result<StatusReport<Self::Status>>;

    /// Runs its plan. The output is byte for byte that of [`run`](Operation::run), however the tasks were distributed
    /// or repeated.
    ///
    /// # Errors
    /// The errors of [`run`](Operation::run) and of any [`RunJob`].
    fn run_plan(
        job: &RunJob,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<RunReport<Self::Done>>;
}

/// The call of an operation with options by name.
pub struct OperationCall<'a> {
    /// Input and output.
    pub request: RunRequest<'a>,
    /// Reading options by name; `options` takes precedence.
    pub reading: Map<String, Json>,
    /// Options by name.
    pub options: &'a Map<String, Json>,
}

impl OperationCall<'_> {
    /// All given options, by name.
    fn given(&self) -> Map<String, Json> {
        let mut given = self.reading.clone();
        given.extend(self.options.clone());
        given
    }
}

/// Fills in options by name and checks their combination; options of `given` that are not off count as given.
fn filled<O: Options>(all: &Map<String, Json>, given: &Map<String, Json>) -> Result<O> {
    let options: O = fill(all)?;
    check_given(&options, &given_names(O::TABLE, given))?;
    Ok(options)
}

/// The names of options that are set: null, `false` of a flag and the like are not.
pub fn given_names(table: &'static OptionTable, given: &Map<String, Json>) -> Vec<&'static str> {
    let fields = given.iter().filter_map(|(name, value)| Some((table.find(name)?, value)));
    let set = fields.filter(|(field, value)| field.is_given(value));
    set.map(|(field, _)| field.name).collect()
}

/// Fails for unknown options or invalid combinations.
///
/// # Errors
/// Usage: the first of these.
pub fn check_named<O: Options>(given: &Map<String, Json>) -> Result<()> {
    filled::<O>(given, given).map(drop)
}

pub(crate) fn divide<O: Divisible>(call: &OperationCall<'_>, task_size: Option<u32>) -> Result<()> {
    let options: O = fill(&call.given())?;
    refuse_of_runs(&options)?;
    check_planned(&options, &given_names(O::TABLE, call.options))?;
    plan_of(&options, call.request, task_size).map(drop)
}

/// Fails for options that apply to runs only.
fn refuse_of_runs<O: Options>(options: &O) -> Result<()> {
    let given = changed(options);
    let of_runs = O::TABLE.fields().into_iter().filter(|field| field.role == OptionRole::Run);
    let mut of_runs = of_runs.filter(|field| Resources::TABLE.find(field.name).is_none());
    of_runs.find(|field| given.contains_key(field.name)).map_or(Ok(()), |field| {
        let name = field.name;
        Err(Error::usage(format!("‹{name}› applies to runs, not to plans"))
            .remedy(format!("leave ‹{name}› out")))
    })
}

/// Plans with options that do not apply to runs only.
///
/// # Errors
/// The errors of [`Divisible::plan`] and of the options.
pub fn plan_of<O: Divisible>(
    options: &O,
    request: RunRequest<'_>,
    task_size: Option<u32>,
) -> Result<StatusReport<O::Status>> {
    refuse_of_runs(options)?;
    check_planned(options, &[])?;
    not_read(options, request)?;
    options.plan(request, task_size)
}

pub(crate) fn run<O: Operation>(call: &OperationCall<'_>) -> Result<Json> {
    let options: O = filled(&call.given(), call.options)?;
    check_all(&options, call.request)?;
    let report = options.run(call.request)?;
    json::to_value(&report)
        .map_err(|e| Error::new(ErrorKind::Internal, format!("the report is not valid JSON: {e}")))
}

pub(crate) fn check_options<O: Operation>(given: &Map<String, Json>, output: &Path) -> Result<()> {
    filled::<O>(given, given)?.check(output)
}

/// Checks everything that can be checked before the work.
fn check_all<O: Operation>(options: &O, request: RunRequest<'_>) -> Result<()> {
    check(options)?;
    options.check(request.output)?;
    not_read(options, request)
}

/// Fails if the output is an input file.
fn not_read<O: Operation>(
    options: &O,
    RunRequest { inputs, output, .. }: RunRequest<'_>,
) -> Result<()> {
    let names = inputs.names();
    // What cannot be found is told of when it is opened.
    let files = O::Input::files(names).unwrap_or_else(|_| names.to_vec());
    not_among(&[files, read_beside(options)?].concat(), &[output])
}

/// The input files named by options.
///
/// # Errors
/// The errors of finding the files of a grid.
pub fn read_beside<O: Options>(options: &O) -> Result<Vec<String>> {
    let values = to_map(options);
    let mut files = Vec::new();
    for field in O::TABLE.fields() {
        let Some(name) = values.get(field.name).and_then(Json::as_str) else { continue };
        match field.role {
            OptionRole::Reads => files.push(name.to_owned()),
            OptionRole::ReadsGrid => files.extend(raster::files(&[name.to_owned()])?),
            OptionRole::Result | OptionRole::Run => {}
        }
    }
    Ok(files)
}

/// An amount of memory: a number of bytes, or a text such as `"512M"` or `"4GiB"`. An invalid text makes the job fail.
///
/// ```
/// use terrane_engine::operation::Memory;
/// assert_eq!(Memory::from("2G").bytes().unwrap(), 2 << 30);
/// assert!(Memory::from("much").bytes().is_err());
/// ```
#[derive(Clone, Debug)]
pub struct Memory(std::result::Result<u64, String>);

impl Memory {
    /// The number of bytes.
    ///
    /// # Errors
    /// Usage: an invalid text.
    pub fn bytes(&self) -> Result<u64> {
        self.0.clone().map_err(|text| {
            Error::usage(format!("{text:?} is not an amount of memory"))
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
        Self(FileSize::parse(text).map_err(|_| text.to_owned()))
    }
}

impl From<String> for Memory {
    fn from(text: String) -> Self {
        Self::from(text.as_str())
    }
}

/// An operation on files or on data in memory. Setters set its options; [`write`](Self::write) or another final method
/// runs it.
pub struct Job<'a, O, S = Inputs> {
    source: S,
    options: O,
    memory: Option<Memory>,
    progress: Box<dyn Progress + Send>,
    cancel: Cancel,
    /// Borrows data in memory.
    borrowed: PhantomData<&'a ()>,
}

impl<O, S> Job<'_, O, S> {
    /// The options, mutable.
    pub fn options_mut(&mut self) -> &mut O {
        &mut self.options
    }

    /// The same on another source.
    pub fn with_source(self, change: impl FnOnce(S) -> S) -> Self {
        Self { source: change(self.source), ..self }
    }
}

impl<O: Options + HasGroup<Resources>, S> Job<'_, O, S> {
    /// An operation on a source: files, or data in memory.
    pub fn new(source: S, options: O) -> Self {
        let (progress, cancel) = (Box::new(Silent), Cancel::default());
        Self { source, options, memory: None, progress, cancel, borrowed: PhantomData }
    }

    /// The current options.
    pub fn options(&self) -> &O {
        &self.options
    }

    /// Replaces all options.
    pub fn with(self, options: O) -> Self {
        Self { options, ..self }
    }

    /// Sets options by name, in addition to the current ones.
    ///
    /// # Errors
    /// Usage: an unknown name, an invalid value, an invalid combination of options.
    pub fn with_named(self, given: &Map<String, Json>) -> Result<Self> {
        let mut all = changed(&self.options);
        all.extend(given.clone().into_iter().filter(|(_, value)| !value.is_null()));
        let options = filled(&all, given)?;
        Ok(Self { options, ..self })
    }

    /// Memory limit of the whole job: bytes, or a text such as `"512M"`. The default is half of the machine's memory,
    /// at most 4 GiB. The result does not depend on it.
    pub fn memory(self, max: impl Into<Memory>) -> Self {
        Self { memory: Some(max.into()), ..self }
    }

    /// Sets the progress watcher.
    pub fn progress(self, progress: impl Progress + Send + 'static) -> Self {
        Self { progress: Box::new(progress), ..self }
    }

    /// Sets the cancellation: once cancelled, the job fails with [`ErrorKind::Interrupted`] and leaves nothing behind.
    pub fn cancel(self, by: &Cancel) -> Self {
        Self { cancel: by.clone(), ..self }
    }

    /// Calls `act` with the source, the options and the watchers of the job.
    ///
    /// # Errors
    /// The errors of `act`; an invalid amount of memory.
    pub fn act<T>(
        mut self,
        act: impl FnOnce(S, &O, &dyn Progress, &Cancel) -> Result<T>,
    ) -> Result<T> {
        if let Some(memory) = &self.memory {
            HasGroup::<Resources>::part_mut(&mut self.options).memory = memory.bytes()?;
        }
        act(self.source, &self.options, &*self.progress, &self.cancel)
    }
}

impl<O: Options + HasGroup<Resources>> Job<'_, O> {
    /// The same with a request for an output.
    pub fn with_request<T>(
        self,
        output: &Path,
        act: impl FnOnce(&O, RunRequest<'_>) -> Result<T>,
    ) -> Result<T> {
        self.act(|inputs, options, progress, cancel| {
            let (inputs, skipped, is_measured) = (&inputs, &[][..], true);
            act(options, RunRequest { inputs, output, skipped, is_measured, progress, cancel })
        })
    }
}

impl<O: Operation> Job<'_, O> {
    /// Runs the job and writes the file, within the memory limit.
    ///
    /// # Errors
    /// Options out of range or in an invalid combination; damage in the input; too little memory; an output that exists
    /// or cannot be written; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<O::Report> {
        self.with_request(&path.into(), |options, request| {
            check_all(options, request)?;
            options.run(request)
        })
    }
}

impl<O: HasGroup<GridOutput>, S> Job<'_, O, S> {
    /// Adds a creation option of the format, such as `COMPRESS`, `DEFLATE`.
    #[must_use]
    pub fn creation(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.options.part_mut().co.push((key.into(), value.into()));
        self
    }
}
