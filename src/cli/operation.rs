//! Verbs that make a file of a grid: `convert`, `contour`, `slope` and others. Each is a struct of options of
//! `terrane_jobs`, and a line in the list of verbs.

use std::path::{Path, PathBuf};

use terrane_options::{Field, Rule, Table, changed, check as check_options, set_texts};

use crate::atomic;
use crate::cli::shared::many::Many;
use crate::cli::shared::tabled::Tabled;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, check, lists, many, names, pipes, report};
use crate::cli::synth;
use crate::door::Door;
use crate::error::{Error, Result};
use crate::files::is_made;
use crate::jobs::Resources;
use crate::jobs::contour::ContourReport;
use crate::jobs::convert::ConvertReport;
use crate::jobs::memory::cache_beside;
use crate::jobs::operation::{Has, Operation, Request, Writes, read_beside};
use crate::jobs::options::{FileOutput, GridInput};
use crate::jobs::sift::Sifted;
use crate::raster::{self, OpenOptions};

/// A report for people.
pub(super) trait Summary: serde::Serialize {
    fn summary(&self) -> String;
}

impl Summary for ConvertReport {
    fn summary(&self) -> String {
        report::plain(self)
    }
}

impl Summary for ContourReport {
    fn summary(&self) -> String {
        super::contour::summary(self)
    }
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args<O: Operation + Has<GridInput> + Has<FileOutput>> {
    /// Grid file, or a synthetic terrain by name; several files, a folder, a list or a pattern in
    /// quotes are one mosaic. The last name is that of the file to write
    #[arg(required = true, value_names = value_names(O::TABLE), num_args = 1.., value_parser = names::any())]
    input: Vec<String>,
    #[arg(skip)]
    output: PathBuf,
    /// File to write, where it is not the last name
    #[arg(short = 'o', long = "output", value_name = "FILE", help_heading = "Output")]
    named: Option<PathBuf>,
    /// Write the report to a file as JSON, too
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    report: Option<PathBuf>,
    #[command(flatten)]
    options: Tabled<O>,
    #[command(flatten)]
    many: many::Many,
    #[command(flatten)]
    show: args::Show,
}

/// What names stand for: inputs, options without a dash, and the output.
fn value_names(table: &'static Table) -> Vec<&'static str> {
    let positional = positional(table).filter_map(|field| field.value);
    ["INPUT"].into_iter().chain(positional).chain(["OUTPUT"]).collect()
}

fn positional(table: &'static Table) -> impl Iterator<Item = &'static Field> {
    table.fields().into_iter().filter(|field| field.positional)
}

impl<O: Operation<Report: Summary> + Has<GridInput> + Has<FileOutput>> Verb for Args<O> {
    const NAME: &'static str = O::NAME;

    fn about() -> Option<String> {
        let names = positional(O::TABLE)
            .map(|field| format!("\n\n{}: {}", field.value.unwrap_or_default(), field.about));
        let about = O::TABLE.about.to_owned() + &names.collect::<String>();
        Some(Door::CommandLine.spell(&about).into_owned())
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
            Writes::Lines => vec![lists::features_written()],
            Writes::Tiles => Vec::new(),
        };
        [vec![lists::grids()], written, vec![lists::EXIT_CODES.to_owned()]].concat()
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        let Self { input, output, named, .. } = self;
        let Some(named) = named.take() else { return Some((input, output)) };
        *output = named;
        None
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        let mut options = self.options.0.clone();
        let mut input = self.input.clone();
        take_positional(&mut options, &mut input)?;
        check_options(&options)?;
        let (resources, grid) =
            (Resources::clone(options.part()), GridInput::clone(options.part()));
        let file = FileOutput::clone(options.part());
        let open = open_options(&grid, &resources);
        let grids = many::Kind::Grids(&open);
        let mut stdin = pipes::Stdin::expect(&mut input, pipes::Holds::Grid, &resources)?;
        let mut output = self.output.clone();
        let stdout = match O::WRITES {
            Writes::Lines => pipes::Stdout::take(&mut output, file.format.as_deref(), &resources)?,
            Writes::Grid | Writes::Colours | Writes::Tiles => {
                atomic::refuse_stdout(&output).map(|()| None)?
            }
        };
        input = self.many.find(&input, grids)?;
        input.iter().try_for_each(|name| check_input(&grid, name))?;
        options.check(&output)?;
        self.check_files(&options, &input, &output, file.overwrite)?;
        stdin.gather(&mut input, call.cancel)?;
        let Sifted { names, skipped } = self.many.sift(input, grids, &resources)?;
        let are_made = names.iter().all(|name| is_made(name));
        let inputs = stdin.inputs(names);
        let (progress, cancel) = (self.show.progress(), call.cancel);
        let request =
            Request { inputs: &inputs, output: &output, progress: progress.as_ref(), cancel };
        let made = options
            .run(request)
            .map_err(|error| if are_made { synth::size(error) } else { error })?;
        stdout.as_ref().map_or(Ok(()), pipes::Stdout::pour)?;
        let told = report::WithSkipped { report: &made, skipped: &skipped };
        if let Some(path) = &self.report {
            report::write(path, file.overwrite, &told)?;
        }
        self.show.beside(stdout.is_some()).tell(&told, || made.summary())?;
        Ok(Outcome::Kept)
    }
}

/// Takes options that are names off the end of the inputs.
fn take_positional<O: Operation>(options: &mut O, input: &mut Vec<String>) -> Result<()> {
    let fields: Vec<_> = positional(O::TABLE).collect();
    if input.len() <= fields.len() {
        let names = value_names(O::TABLE).join(", ");
        return Err(Error::usage(format!("names are missing: {names} are needed"))
            .remedy(format!("see `terrane {} --help`", O::NAME)));
    }
    let taken = input.split_off(input.len() - fields.len());
    fields.into_iter().zip(taken).try_for_each(|(field, name)| set_texts(options, field, &[name]))
}

/// The options of which one has to be given, as usage has them.
pub(super) fn needed(table: &'static Table) -> String {
    let argument = |name: &&str| {
        let field = table.find(name);
        let value = field.and_then(|field| field.value).unwrap_or("VALUE");
        format!("--{} <{value}>", name.replace('_', "-"))
    };
    let rules = table.rules().into_iter();
    rules.fold(String::new(), |text, rule| match rule {
        Rule::OneOf(names, _) => {
            let names: Vec<String> = names.iter().map(argument).collect();
            format!("{text}<{}> ", names.join("|"))
        }
        Rule::NotWith(..) | Rule::Needs(..) => text,
    })
}

/// How each file of a grid is opened.
fn open_options(grid: &GridInput, resources: &Resources) -> OpenOptions {
    let (band, nodata, threads) = (grid.band, grid.nodata, resources.threads);
    let (cache_bytes, temp_dir) = (cache_beside(resources.memory), resources.temp_dir.clone());
    OpenOptions { band, nodata, cache_bytes, threads, temp_dir, ..OpenOptions::default() }
}

/// Fails when an option was given that cannot act on `input`: it is a mesh or made by rule.
fn check_input(grid: &GridInput, input: &str) -> Result<()> {
    let given = changed(grid);
    // A synthetic terrain has samples, too.
    let of_files = ["band", "nodata"].into_iter().find(|name| given.contains_key(*name));
    match (of_files, given.keys().next()) {
        (Some(name), _) => args::only_grid_files(&format!("‹{name}›"), input),
        (None, Some(name)) => args::only_grids(&format!("‹{name}›"), input),
        (None, None) => Ok(()),
    }
}

impl<O: Operation + Has<GridInput> + Has<FileOutput>> Args<O> {
    /// Fails when a file to read is not there, or one to write is taken.
    fn check_files(
        &self,
        options: &O,
        input: &[String],
        output: &Path,
        overwrite: bool,
    ) -> Result<()> {
        let beside = read_beside(options)?;
        check::beside(&beside)?;
        let files = [raster::files(input)?, beside].concat();
        check::not_among(&files, &[output])?;
        check::new_file(output, overwrite)?;
        check::report(self.report.as_deref(), &files, &[output], overwrite)
    }
}
