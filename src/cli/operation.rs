//! Verbs that write a file from a grid or a point cloud: `convert`, `grid`, `slope` and others. Each is an
//! options struct of its crate, and a line in the list of verbs.

use std::path::{Path, PathBuf};

use terrane_options::{
    OptionField, OptionRule, OptionTable, Options, check_given, set_texts, to_map,
};

use crate::cli::shared::batch::InputSelection;
use crate::cli::shared::report::Summarize;
use crate::cli::shared::tabled::OperationOptionArgs;
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, batch, check, lists, names, pipes, report};
use crate::cli::synth;
use terrane_base::error::{Error, Result};
use terrane_base::frontend::Frontend;
use terrane_cloud as cloud;
use terrane_engine::Resources;
use terrane_engine::memory::cache_beside;
use terrane_engine::operation::{
    HasGroup, InputOptions, Operation, RunRequest, Writes, read_beside,
};
use terrane_engine::options::{CloudInput, FeatureInput, GridInput, Replacing};
use terrane_engine::skip_bad::{ReadableFiles, Skipped};
use terrane_files::atomic;
use terrane_files::{is_made, path_of};
use terrane_raster as raster;
use terrane_raster::Inputs;
use terrane_terrain::convert::ConvertReport;
use terrane_vector as vector;

impl Summarize for ConvertReport {
    fn summary(&self) -> String {
        report::plain(self)
    }
}

/// Input of an operation on the command line.
pub(super) trait OperationInput: InputOptions {
    /// Help of the names: with the output last, and for inputs only.
    const NAMES: &'static str;
    const NAMES_PLANNED: &'static str;
    /// Content of stdin.
    const STDIN: pipes::PipeContent<'static>;

    /// How files are opened to test them.
    fn opening(&self, resources: &Resources) -> Result<InputOpening>;

    /// Fails for unsupported inputs, and for options that have no effect on a file.
    fn check(name: &str, many: &InputSelection, given: &[&'static str]) -> Result<()>;

    /// Help lists of the input.
    fn lists() -> Vec<String>;

    /// Damage loses only the damaged part.
    fn skip_bad(&mut self) {}
}

/// Files selected by inputs without stdin, for the given options.
pub(super) fn take<O: HasGroup<I> + HasGroup<Resources>, I: OperationInput>(
    options: &mut O,
    given: &[&'static str],
    input: Vec<String>,
    many: &InputSelection,
) -> Result<ReadableFiles> {
    let opening = HasGroup::<I>::part(options).opening(options.part())?;
    let opening = opening.of_colours(given.contains(&"bands"));
    let input = many.find(&input, opening.kind())?;
    input.iter().try_for_each(|name| I::check(name, many, given))?;
    let readable = many.check_files(input, opening.kind(), options.part())?;
    skip_bad::<I>(options, many);
    Ok(readable)
}

/// Tolerates damage if bad files are skipped.
fn skip_bad<I: OperationInput>(options: &mut impl HasGroup<I>, many: &InputSelection) {
    if many.skip_bad {
        options.part_mut().skip_bad();
    }
}

/// How files are opened.
pub(super) enum InputOpening {
    Grids(raster::GridOpenOptions),
    Clouds(Box<cloud::CloudOpenOptions>),
    Features(vector::VectorOpenOptions),
}

impl InputOpening {
    /// The same for grids whose bands may be colours.
    fn of_colours(self, colours: bool) -> Self {
        match self {
            Self::Grids(options) => Self::Grids(raster::GridOpenOptions { colours, ..options }),
            Self::Clouds(_) | Self::Features(_) => self,
        }
    }

    pub(super) fn kind(&self) -> batch::InputFileKind<'_> {
        match self {
            Self::Grids(options) => batch::InputFileKind::Grids(options),
            Self::Clouds(options) => batch::InputFileKind::Clouds(options),
            Self::Features(options) => batch::InputFileKind::Features(options),
        }
    }
}

impl OperationInput for GridInput {
    const NAMES: &'static str = "Grid file, or name of a synthetic terrain; several files, a folder, a list or a \
        quoted pattern are one mosaic. The last name is the output";
    const NAMES_PLANNED: &'static str = "Grid file, or name of a synthetic terrain; several files, a folder, a \
        list or a quoted pattern are one mosaic";
    const STDIN: pipes::PipeContent<'static> = pipes::PipeContent::Grid;

    fn opening(&self, resources: &Resources) -> Result<InputOpening> {
        let usual = raster::GridOpenOptions::default();
        let (nodata, threads) = (self.nodata, resources.threads);
        let band = self.band.unwrap_or(usual.band);
        let (cache_bytes, temp_dir) = (cache_beside(resources.memory), resources.temp_dir.clone());
        let options =
            raster::GridOpenOptions { band, nodata, cache_bytes, threads, temp_dir, ..usual };
        Ok(InputOpening::Grids(options))
    }

    /// Options of grids have no effect on a mesh; bands have none on a synthetic terrain.
    fn check(name: &str, many: &InputSelection, given: &[&'static str]) -> Result<()> {
        if many.is_cloud(name)? {
            return Err(Error::usage("is a point cloud, not a grid")
                .in_file(&path_of(name))
                .remedy(
                    "make a grid first with terrane grid --dtm, or by tasks with terrane plan grid",
                ));
        }
        // Bands and nodata apply to files only.
        let of_files = given.iter().find(|name| ["band", "nodata"].contains(name));
        let of_grids = given.iter().find(|name| Self::TABLE.find(name).is_some());
        match (of_files, of_grids) {
            (Some(option), _) => args::only_grid_files(&format!("‹{option}›"), name),
            (None, Some(option)) => args::only_grids(&format!("‹{option}›"), name),
            (None, None) => Ok(()),
        }
    }

    fn lists() -> Vec<String> {
        vec![lists::grids()]
    }
}

impl OperationInput for CloudInput {
    const NAMES: &'static str = "Point cloud: LAS, LAZ, COPC, or text as cloud:FILE. Several files, a folder, a \
        list or a quoted pattern are one point cloud. The last name is the output";
    const NAMES_PLANNED: &'static str = "Point cloud: LAS, LAZ, COPC, or text as cloud:FILE. Several files, a \
        folder, a list or a quoted pattern are one point cloud";
    const STDIN: pipes::PipeContent<'static> = pipes::PipeContent::Points;

    /// The georeference of points is not required.
    fn opening(&self, resources: &Resources) -> Result<InputOpening> {
        let mut anywhere = self.clone();
        (anywhere.bounds, anywhere.clip) = (None, None);
        Ok(InputOpening::Clouds(Box::new(anywhere.options(resources)?)))
    }

    fn check(_name: &str, _many: &InputSelection, _given: &[&'static str]) -> Result<()> {
        Ok(())
    }

    fn lists() -> Vec<String> {
        vec![lists::clouds()]
    }

    fn skip_bad(&mut self) {
        self.points.salvage = true;
    }
}

impl OperationInput for FeatureInput {
    const NAMES: &'static str = "Feature file. The last name is the output";
    const NAMES_PLANNED: &'static str = "Feature file";
    const STDIN: pipes::PipeContent<'static> = pipes::PipeContent::Features(None);

    fn opening(&self, _resources: &Resources) -> Result<InputOpening> {
        Ok(InputOpening::Features(vector::VectorOpenOptions {
            layer: self.layer.clone(),
            ..Default::default()
        }))
    }

    fn check(_name: &str, _many: &InputSelection, _given: &[&'static str]) -> Result<()> {
        Ok(())
    }

    fn lists() -> Vec<String> {
        vec![lists::features()]
    }
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct OperationArgs<O: Operation<Input: OperationInput> + HasGroup<Replacing>> {
    #[arg(help = O::Input::NAMES, required = true, value_names = value_names(O::TABLE), num_args = 1.., value_parser = names::any())]
    input: Vec<String>,
    #[arg(skip)]
    output: PathBuf,
    /// Output file, if it is not the last name
    #[arg(short = 'o', long = "output", value_name = "FILE", help_heading = "Output")]
    named: Option<PathBuf>,
    /// Write the report to a JSON file as well
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    report: Option<PathBuf>,
    #[command(flatten)]
    options: OperationOptionArgs<O>,
    #[command(flatten)]
    many: batch::InputSelection,
    #[command(flatten)]
    show: args::ReportDisplay,
}

/// Names on the command line: inputs, positional options, and the output.
fn value_names(table: &'static OptionTable) -> Vec<&'static str> {
    let positional = positional(table).filter_map(|field| field.value);
    ["INPUT"].into_iter().chain(positional).chain(["OUTPUT"]).collect()
}

fn positional(table: &'static OptionTable) -> impl Iterator<Item = &'static OptionField> {
    table.fields().into_iter().filter(|field| field.positional)
}

impl<O: Operation<Input: OperationInput, Report: Summarize> + HasGroup<Replacing>> Verb
    for OperationArgs<O>
{
    const NAME: &'static str = O::NAME;

    fn about() -> Option<String> {
        let names = positional(O::TABLE)
            .map(|field| format!("\n\n{}: {}", field.value.unwrap_or_default(), field.about));
        let about = O::TABLE.about.to_owned() + &names.collect::<String>();
        Some(Frontend::CommandLine.spell(&about).into_owned())
    }

    fn usage() -> Option<String> {
        let names: Vec<String> =
            value_names(O::TABLE).iter().map(|name| format!("<{name}>")).collect();
        let names = names.join(" ").replacen("<INPUT>", "<INPUT>...", 1);
        Some(format!("[OPTIONS] {}{names}", needed(O::TABLE)))
    }

    fn lists() -> Vec<String> {
        let written = match O::WRITES {
            Writes::Grid => vec![lists::grids_written(), lists::creation_options()],
            Writes::Colours => vec![lists::creation_options()],
            Writes::Features => vec![lists::features_written()],
            Writes::Mesh => vec![lists::meshes()],
            Writes::Tiles | Writes::Points | Writes::Picture | Writes::Page | Writes::Report => {
                Vec::new()
            }
        };
        let of_options = lists::of_options(O::TABLE).collect();
        [O::Input::lists(), of_options, written, vec![lists::EXIT_CODES.to_owned()]].concat()
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        let Self { input, output, named, .. } = self;
        let Some(named) = named.take() else { return Some((input, output)) };
        *output = named;
        None
    }

    fn input_selection(&self) -> Option<&InputSelection> {
        Some(&self.many)
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        let Self { output, report, many, show, .. } = self;
        let (mut options, mut input) = (self.options.0.clone(), self.input.clone());
        take_positional(&mut options, &mut input)?;
        let given = self.options.1.as_slice();
        let frame =
            RunArguments { input: &input, output, given, report: report.as_deref(), many, show };
        run(options, frame, call)
    }
}

/// Arguments of a run beside the options.
pub(super) struct RunArguments<'a> {
    pub(super) input: &'a [String],
    pub(super) output: &'a Path,
    /// Names of the given options.
    pub(super) given: &'a [&'static str],
    pub(super) report: Option<&'a Path>,
    pub(super) many: &'a InputSelection,
    pub(super) show: &'a args::ReportDisplay,
}

/// Runs an operation and prints its report.
pub(super) fn run<O>(
    mut options: O,
    frame: RunArguments<'_>,
    call: &VerbCall<'_>,
) -> Result<VerbOutcome>
where
    O: Operation<Input: OperationInput, Report: Summarize> + HasGroup<Replacing>,
{
    let made = make(&mut options, &frame, call)?;
    let report = report::WithSkipped { report: &made.report, skipped: &made.skipped };
    if let Some(path) = frame.report {
        report::write(path, is_replacing(&options), &report)?;
    }
    frame.show.with_pipe(made.is_poured).print(&report, || made.report.summary())?;
    Ok(VerbOutcome::Kept)
}

/// Result of a run.
pub(super) struct FinishedRun<R> {
    pub(super) report: R,
    pub(super) inputs: Inputs,
    pub(super) skipped: Vec<Skipped>,
    /// True if stdout has the result.
    is_poured: bool,
    /// Temporary files of the inputs, if they came from stdin.
    _stdin: pipes::StdinFile<'static>,
}

/// Runs an operation; afterwards `options` has the settings used.
pub(super) fn make<O>(
    options: &mut O,
    frame: &RunArguments<'_>,
    call: &VerbCall<'_>,
) -> Result<FinishedRun<O::Report>>
where
    O: Operation<Input: OperationInput> + HasGroup<Replacing>,
{
    let RunArguments { input: named_input, output, given, report, many, show } = *frame;
    let (mut input, mut output) = (named_input.to_vec(), output.to_path_buf());
    check_given(options, given)?;
    let reading = O::Input::clone(options.part());
    let resources = Resources::clone(options.part());
    let opening = reading.opening(&resources)?.of_colours(given.contains(&"bands"));
    let mut stdin = pipes::StdinFile::expect(&mut input, O::Input::STDIN, &resources)?;
    if named(options, "workdir").is_some() {
        stdin.refuse("‹workdir›")?;
    }
    let stdout = match O::WRITES {
        Writes::Features => {
            let format = named(options, "format");
            pipes::StdoutFile::take(&mut output, format.as_deref(), &resources)?
        }
        _ => atomic::refuse_stdout(&output).map(|()| None)?,
    };
    options.check(&output)?;
    input = many.find(&input, opening.kind())?;
    check_inputs(options, &input, many, given)?;
    // List files are inputs, too.
    let lists = named_input.iter().filter_map(|name| name.strip_prefix('@')).map(str::to_owned);
    let read = [O::Input::files(&input)?, read_beside(options)?, lists.collect()].concat();
    check_files(options, &read, &output, report)?;
    stdin.gather(&mut input, call.cancel)?;
    let ReadableFiles { names, skipped } = many.check_files(input, opening.kind(), &resources)?;
    skip_bad::<O::Input>(options, many);
    let are_made = O::WRITES != Writes::Mesh && names.iter().all(|name| is_made(name));
    let inputs = stdin.inputs(names);
    let (progress, cancel) = (show.progress(), call.cancel);
    let (progress, is_measured) = (progress.as_ref(), show.json || report.is_some());
    let request = RunRequest {
        inputs: &inputs,
        output: &output,
        skipped: &skipped,
        is_measured,
        progress,
        cancel,
    };
    let made =
        options.run(request).map_err(|error| if are_made { synth::size(error) } else { error })?;
    stdout.as_ref().map_or(Ok(()), pipes::StdoutFile::pour)?;
    Ok(FinishedRun { report: made, inputs, skipped, is_poured: stdout.is_some(), _stdin: stdin })
}

/// Fails for unsupported inputs, and for given options that have no effect on them.
fn check_inputs<O>(
    options: &O,
    input: &[String],
    many: &InputSelection,
    given: &[&'static str],
) -> Result<()>
where
    O: Operation<Input: OperationInput>,
{
    let shows = matches!(O::WRITES, Writes::Picture | Writes::Page);
    // Bounds may also select a part of a mesh; other grid options apply to the grid of --against.
    let given: Vec<_> = given.iter().copied().filter(|name| !shows || *name != "bounds").collect();
    match named(options, "against") {
        Some(grid) => O::Input::check(&grid, many, &given),
        None => input.iter().try_for_each(|name| O::Input::check(name, many, &given)),
    }
}

/// Whether existing outputs are replaced.
pub(super) fn is_replacing(options: &impl HasGroup<Replacing>) -> bool {
    options.part().overwrite
}

/// Text of an option, if it exists and is given.
fn named(options: &impl Options, name: &str) -> Option<String> {
    to_map(options).get(name).and_then(|value| value.as_str()).map(str::to_owned)
}

/// Takes positional options from the end of the inputs.
fn take_positional<O: Operation>(options: &mut O, input: &mut Vec<String>) -> Result<()> {
    let fields: Vec<_> = positional(O::TABLE).collect();
    if input.len() <= fields.len() {
        let names = value_names(O::TABLE).join(", ");
        return Err(Error::usage(format!("missing names: {names}"))
            .remedy(format!("see `terrane {} --help`", O::NAME)));
    }
    let taken = input.split_off(input.len() - fields.len());
    fields.into_iter().zip(taken).try_for_each(|(field, name)| set_texts(options, field, &[name]))
}

/// Required alternatives of options, for the usage line.
pub(super) fn needed(table: &'static OptionTable) -> String {
    let rules = table.rules().into_iter();
    rules.fold(String::new(), |text, rule| match rule {
        OptionRule::OneOf(names, _) => {
            let arguments = names.iter().map(|name| {
                let value = table.find(name).and_then(|field| field.value).unwrap_or("VALUE");
                format!("--{} <{value}>", name.replace('_', "-"))
            });
            format!("{text}<{}> ", arguments.collect::<Vec<_>>().join("|"))
        }
        OptionRule::NotWith(..) | OptionRule::Needs(..) => text,
    })
}

/// Fails for a missing auxiliary file, or an output that exists or is among the input `files`.
fn check_files<O: Operation + HasGroup<Replacing>>(
    options: &O,
    files: &[String],
    output: &Path,
    report: Option<&Path>,
) -> Result<()> {
    let overwrite = is_replacing(options);
    check::check_sidecars(&read_beside(options)?)?;
    let workdir = named(options, "workdir").map(|name| path_of(&name).into_owned());
    // An existing output may belong to an earlier run in the folder.
    let resumes = workdir.as_ref().is_some_and(|folder| folder.exists());
    let outputs: Vec<&Path> = std::iter::once(output).chain(workdir.as_deref()).collect();
    check::not_among(files, &outputs)?;
    match options.is_folder() {
        true => check::folder(output)?,
        false => check::new_file(output, overwrite || resumes)?,
    }
    let index = named(options, "index").map(|name| path_of(&name).into_owned());
    let outputs: Vec<&Path> = outputs.into_iter().chain(index.as_deref()).collect();
    check::report(report, files, &outputs, overwrite)
}
