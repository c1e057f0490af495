//! Operations: what can be done with grids and features, in one struct of options each, which every door is made from.
//!
//! The command line takes the options by name, Rust by setters of [`Job`], Python by keywords; all come to
//! [`Operation::run`].
//!
//! Setters are traits, as a crate cannot add methods to a type of another: [`Job`] is of this crate, the structs of
//! options are of the crates of their subjects. The list of all operations is in the package `terrane`, which alone
//! knows all subjects.

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
    CloudInput, FeatureInput, FileOutput, FileSize, GridInput, GridOutput, PointFilter, Replacing,
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

/// A struct of options that has a group of them.
pub trait HasGroup<G> {
    /// The group.
    fn part(&self) -> &G;

    /// The same to change it.
    fn part_mut(&mut self) -> &mut G;
}

/// Says that structs of options that have a group have the groups in it, too:
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

/// Whoever has a group of this crate has the group in it. Only the crate of [`HasGroup`] can say so of all structs; others name
/// them with [`has_within`](crate::has_within).
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

has_nested!(CloudInput => PointFilter, FileOutput => Replacing);

/// What an operation reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// A grid.
    Grid,
    /// A cloud of points.
    Cloud,
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
    /// A mesh: a file, or a folder of files.
    Mesh,
    /// Lines.
    Lines,
    /// A folder of tiles.
    Tiles,
    /// Points: a file, or a folder of files.
    Points,
    /// A picture: a PNG file.
    Picture,
    /// A page for browsers: an HTML file.
    Page,
}

/// A group of options that says how what an operation reads is read.
pub trait InputOptions: Options + Clone {
    /// What it is.
    const READS: Reads;

    /// The files that names stand for.
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

/// What a run reads and writes, and who watches it.
#[derive(Clone, Copy)]
pub struct RunRequest<'a> {
    /// Files of the grid, of the cloud, or of features.
    pub inputs: &'a Inputs,
    /// File to write.
    pub output: &'a Path,
    /// Files that were left out of the inputs, as they cannot be read.
    pub skipped: &'a [Skipped],
    /// Whether errors are measured for the report where that takes time.
    pub is_measured: bool,
    /// Who is told how far it is.
    pub progress: &'a dyn Progress,
    /// What may stop it.
    pub cancel: &'a Cancel,
}

/// Something that is made of a grid, a cloud or features: a struct of options.
pub trait Operation:
    Options + Clone + fmt::Debug + Send + Sync + 'static + HasGroup<Resources> + HasGroup<Self::Input>
{
    /// Its name, which is that of its verb, with dashes; behind `cloud-` where the verb makes the same of grids.
    const NAME: &'static str;
    /// How what it reads is read.
    type Input: InputOptions;
    /// What it writes.
    const WRITES: Writes;
    /// What is told of a run.
    type Report: Serialize + Send;

    /// True where the output is a folder.
    fn is_folder(&self) -> bool {
        Self::WRITES == Writes::Tiles
    }

    /// What can be known to be wrong before the grid is opened, beside ranges and rules of the options.
    ///
    /// # Errors
    /// An output or options that cannot be.
    fn check(&self, output: &Path) -> Result<()>;

    /// Makes it. Nothing appears under the output's name unless it succeeds.
    ///
    /// # Errors
    /// Those of [`check`](Self::check); what is wrong with the grid, the output or the machine.
    fn run(&self, request: RunRequest<'_>) -> Result<Self::Report>;
}

/// An operation that can be divided into tasks, for many nights or many machines.
pub trait Divisible: Operation {
    /// The kind of its plans.
    const KIND: PlanKind;
    /// What a task has so many of, for people.
    const TASK_SIZE: &'static str;
    /// What is told of its plan beside what is told of all.
    type Status: Serialize;
    /// What is told of work on its plan beside what is told of all.
    type Done: Serialize + DescribesRun;

    /// Writes down the work in a folder, which is the request's output; each task has so many of what
    /// [`TASK_SIZE`](Self::TASK_SIZE) says, or as many as make a fair piece of work.
    ///
    /// # Errors
    /// Those of [`run`](Operation::run) that are found before the work; options that cannot act in pieces; a folder that
    /// holds another plan or other files.
    fn plan(
        &self,
        request: RunRequest<'_>,
        task_size: Option<u32>,
    ) -> Result<StatusReport<Self::Status>>;

    /// How far the work on its plan in a folder has come; results are looked at, not read through.
    ///
    /// # Errors
    /// A folder without such a plan.
    fn status(folder: &Path) -> Result<StatusReport<Self::Status>>;

    /// Works on its plan. What is written is what [`run`](Operation::run) writes, byte for byte, whoever did which task how
    /// often.
    ///
    /// # Errors
    /// Those of [`run`](Operation::run), and of any [`RunJob`].
    fn run_plan(
        job: &RunJob,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<RunReport<Self::Done>>;
}

/// What a run is asked for.
pub struct OperationCall<'a> {
    /// What it reads and writes.
    pub request: RunRequest<'a>,
    /// How inputs are read, by the names of options, unless one of these says otherwise.
    pub reading: Map<String, Json>,
    /// Options by name.
    pub options: &'a Map<String, Json>,
}

impl OperationCall<'_> {
    /// All that is given, by name.
    fn given(&self) -> Map<String, Json> {
        let mut given = self.reading.clone();
        given.extend(self.options.clone());
        given
    }
}

/// Options by name that go together; those of `given` that ask for anything count as given.
fn filled<O: Options>(all: &Map<String, Json>, given: &Map<String, Json>) -> Result<O> {
    let options: O = fill(all)?;
    check_given(&options, &given_names(O::TABLE, given))?;
    Ok(options)
}

/// The names of the options by which something is asked for: null, `false` of a flag and the like ask for nothing.
pub fn given_names(table: &'static OptionTable, given: &Map<String, Json>) -> Vec<&'static str> {
    let fields = given.iter().filter_map(|(name, value)| Some((table.find(name)?, value)));
    let asked = fields.filter(|(field, value)| field.is_given(value));
    asked.map(|(field, _)| field.name).collect()
}

/// Fails for options by name that are none, or do not go together.
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

/// Fails for options that say something of a run alone.
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

/// Plans what options say, none of which is for runs alone.
///
/// # Errors
/// Those of [`Divisible::plan`], and of the options.
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

/// All that can be known to be wrong before the work.
fn check_all<O: Operation>(options: &O, request: RunRequest<'_>) -> Result<()> {
    check(options)?;
    options.check(request.output)?;
    not_read(options, request)
}

/// Fails when the output is a file that is read.
fn not_read<O: Operation>(
    options: &O,
    RunRequest { inputs, output, .. }: RunRequest<'_>,
) -> Result<()> {
    let names = inputs.names();
    // What cannot be found is told of when it is opened.
    let files = O::Input::files(names).unwrap_or_else(|_| names.to_vec());
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
            OptionRole::Reads => files.push(name.to_owned()),
            OptionRole::ReadsGrid => files.extend(raster::files(&[name.to_owned()])?),
            OptionRole::Result | OptionRole::Run => {}
        }
    }
    Ok(files)
}

/// An amount of memory: a number of bytes, or a text such as `"512M"` or `"4GiB"`. A text that is none
/// fails the job it was given to.
///
/// ```
/// use terrane_engine::operation::Memory;
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

/// An operation on some files, or on something in memory, to be told its options by setters and to be run by
/// [`write`](Self::write) or what else ends it.
pub struct Job<'a, O, S = Inputs> {
    source: S,
    options: O,
    memory: Option<Memory>,
    progress: Box<dyn Progress + Send>,
    cancel: Cancel,
    /// What is in memory has to stay there.
    held: PhantomData<&'a ()>,
}

impl<O, S> Job<'_, O, S> {
    /// The options, to change them.
    pub fn options_mut(&mut self) -> &mut O {
        &mut self.options
    }

    /// The same on another source.
    pub fn with_source(self, change: impl FnOnce(S) -> S) -> Self {
        Self { source: change(self.source), ..self }
    }
}

impl<O: Options + HasGroup<Resources>, S> Job<'_, O, S> {
    /// The operation on some files, or on something else.
    pub fn new(source: S, options: O) -> Self {
        let (progress, cancel) = (Box::new(Silent), Cancel::default());
        Self { source, options, memory: None, progress, cancel, held: PhantomData }
    }

    /// The options as they are by now.
    pub fn options(&self) -> &O {
        &self.options
    }

    /// All of the options, instead of those that were told before.
    pub fn with(self, options: O) -> Self {
        Self { options, ..self }
    }

    /// Options by name, beside those that were told before.
    ///
    /// # Errors
    /// Usage: a name of no option, a value that is none, options that do not go together.
    pub fn with_named(self, given: &Map<String, Json>) -> Result<Self> {
        let mut all = changed(&self.options);
        all.extend(given.clone().into_iter().filter(|(_, value)| !value.is_null()));
        let options = filled(&all, given)?;
        Ok(Self { options, ..self })
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

    /// Does something with what the job is about, its options, and those who watch it.
    ///
    /// # Errors
    /// Those of `act`; a text that is no amount of memory.
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
    /// Does the work and writes the file, within the memory allowed.
    ///
    /// # Errors
    /// Options out of their range, or that do not go together; damage in the input; too little memory; an output that
    /// exists or cannot be written; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<O::Report> {
        self.with_request(&path.into(), |options, request| {
            check_all(options, request)?;
            options.run(request)
        })
    }
}

impl<O: HasGroup<GridOutput>, S> Job<'_, O, S> {
    /// A creation option of the format, such as `COMPRESS`, `DEFLATE`; one more each time.
    #[must_use]
    pub fn creation(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.options.part_mut().co.push((key.into(), value.into()));
        self
    }
}
