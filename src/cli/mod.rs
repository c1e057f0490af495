//! Arguments to jobs, progress, reports. Uses the public API of the other rooms only.
//!
//! One file per verb; each has its arguments and a `run` that returns whether all promises were
//! kept. Results go to stdout, progress and messages to stderr.

mod completions;
mod contour;
mod convert;
mod demo;
mod grid;
mod heap;
mod help;
mod info;
mod line;
mod man;
mod plan;
mod shared;
mod signal;
mod synth;
mod tin;
mod usage;
mod verify;
mod view;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{FromArgMatches, Parser, Subcommand};

use crate::cli::shared::{NOT_JUDGED, Outcome, names, say};
use crate::error::{Error, ErrorKind};
use crate::jobs::Cancel;

/// Huge elevation grids in, small meshes with a proven vertical error bound out.
///
/// Results go to stdout, progress and messages to stderr. Nothing is overwritten unless
/// --overwrite is given, and files appear whole or not at all.
#[derive(Debug, Parser)]
#[command(name = "terrane", version, arg_required_else_help = true, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

impl Cli {
    /// With the outputs told from the inputs.
    fn settled(mut self) -> Result<Self, clap::Error> {
        match &mut self.verb {
            Verb::Tin(args) => names::take_output(&mut args.input, &mut args.output)?,
            Verb::Convert(args) => names::take_output(&mut args.input, &mut args.output)?,
            Verb::Grid(args) => names::take_output(&mut args.input, &mut args.output)?,
            Verb::Line(args) => names::take_output(&mut args.input, &mut args.output)?,
            _ => {}
        }
        Ok(self)
    }
}

#[derive(Debug, Subcommand)]
enum Verb {
    Tin(Box<tin::Args>),
    Verify(verify::Args),
    Info(info::Args),
    View(view::Args),
    Convert(convert::Args),
    Grid(Box<grid::Args>),
    Contour(contour::Args),
    Line(Box<line::Args>),
    Synth(synth::Args),
    Plan(plan::Args),
    Run(plan::run::Args),
    Finish(plan::run::FinishArgs),
    Status(plan::status::Args),
    Demo(demo::Args),
    Completions(completions::Args),
    Man(man::Args),
}

impl Verb {
    /// An error with the advice that only this verb can give.
    fn advised(&self, error: Error) -> Error {
        let many = match self {
            Self::Tin(args) => &args.many,
            Self::Verify(args) => &args.many,
            Self::Info(args) => &args.many,
            Self::View(args) => &args.many,
            Self::Convert(args) => &args.many,
            Self::Grid(args) => &args.many,
            Self::Contour(args) => &args.many,
            Self::Line(args) => &args.many,
            Self::Plan(args) => args.many(),
            _ => return error,
        };
        many.advise(error)
    }
}

/// Runs the command line and returns the process exit code.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    heap::give_back();
    let args: Vec<OsString> = args.into_iter().collect();
    let matches = help::command().try_get_matches_from(&args);
    let parsed = matches.and_then(|found| Cli::from_arg_matches(&found)).and_then(Cli::settled);
    let cli = match parsed {
        Ok(cli) => cli,
        Err(error) => return usage::report(&error, &args),
    };
    let cancel = Cancel::default();
    signal::stop(cancel.clone());
    match run(&cli.verb, &cancel) {
        Ok(Outcome::Kept) => ExitCode::SUCCESS,
        Ok(Outcome::Broken) => ErrorKind::CheckFailed.exit_code().into(),
        Ok(Outcome::NotJudged) => NOT_JUDGED.into(),
        Err(error) => {
            let error = cli.verb.advised(error);
            say::error(&error);
            error.kind().exit_code().into()
        }
    }
}

fn run(verb: &Verb, cancel: &Cancel) -> crate::error::Result<Outcome> {
    match verb {
        Verb::Tin(args) => tin::run(args, cancel),
        Verb::Verify(args) => verify::run(args, cancel),
        Verb::Info(args) => info::run(args, cancel),
        Verb::View(args) => view::run(args, cancel),
        Verb::Convert(args) => convert::run(args, cancel),
        Verb::Grid(args) => grid::run(args, cancel),
        Verb::Contour(args) => contour::run(args, cancel),
        Verb::Line(args) => line::run(args, cancel),
        Verb::Synth(args) => synth::run(args, cancel),
        Verb::Plan(args) => plan::run(args, cancel),
        Verb::Run(args) => plan::run::run(args, cancel),
        Verb::Finish(args) => plan::run::finish(args, cancel),
        Verb::Status(args) => plan::status::run(args),
        Verb::Demo(args) => demo::run(args, cancel),
        Verb::Completions(args) => completions::run(args),
        Verb::Man(args) => man::run(args),
    }
}
