//! Command line: arguments, progress and reports. Uses only the public API of the other crates.
//!
//! A file or folder per verb defines its arguments and how they run; `VERBS` lists them. Verbs use `shared`,
//! which uses none of them. Results go to stdout, progress and messages to stderr.

mod completions;
mod contour;
mod demo;
mod difference;
mod grid;
mod heap;
mod info;
mod line;
mod man;
mod operation;
mod plan;
mod points;
mod qa;
#[cfg(test)]
mod reference;
mod sample;
mod shared;
mod signal;
mod synth;
mod tiles;
mod tin;
mod usage;
mod verify;
mod view;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Command, CommandFactory, Parser};

use crate::cli::shared::verb::{Job, VerbCall, VerbEntry};
use crate::cli::shared::{NOT_JUDGED, VerbOutcome, output};
use terrane_base::error::ErrorKind;
use terrane_engine::Cancel;
use terrane_lidar::grid::GridOptions;
use terrane_lidar::points::PointsOptions;
use terrane_terrain::colours::ColorReliefOptions;
use terrane_terrain::contour::ContourOptions;
use terrane_terrain::convert::ConvertOptions;
use terrane_terrain::difference::DifferenceOptions;
use terrane_terrain::fill::FillOptions;
use terrane_terrain::relief::{
    AspectOptions, CurvatureOptions, HillshadeOptions, RoughnessOptions, SlopeOptions, TpiOptions,
    TriOptions,
};
use terrane_terrain::sample::SampleOptions;
use terrane_terrain::zonal::ZonalOptions;
use terrane_viewer::qa::QaOptions;

/// All verbs, in the order of the help.
const VERBS: &[VerbEntry] = &[
    VerbEntry::of::<tin::TinVerbArgs>(),
    VerbEntry::of::<verify::VerifyArgs>(),
    VerbEntry::of::<info::InfoArgs>(),
    VerbEntry::of::<view::ViewArgs>(),
    VerbEntry::of::<operation::OperationArgs<QaOptions>>(),
    VerbEntry::of::<operation::OperationArgs<ConvertOptions>>(),
    VerbEntry::of::<operation::OperationArgs<FillOptions>>(),
    VerbEntry::of::<operation::OperationArgs<DifferenceOptions>>(),
    VerbEntry::of::<operation::OperationArgs<GridOptions>>(),
    VerbEntry::of::<operation::OperationArgs<PointsOptions>>(),
    VerbEntry::of::<operation::OperationArgs<ContourOptions>>(),
    VerbEntry::of::<operation::OperationArgs<SampleOptions>>(),
    VerbEntry::of::<operation::OperationArgs<ZonalOptions>>(),
    VerbEntry::of::<line::SimplifyArgs>(),
    VerbEntry::of::<tiles::TilesArgs>(),
    VerbEntry::of::<operation::OperationArgs<SlopeOptions>>(),
    VerbEntry::of::<operation::OperationArgs<AspectOptions>>(),
    VerbEntry::of::<operation::OperationArgs<HillshadeOptions>>(),
    VerbEntry::of::<operation::OperationArgs<ColorReliefOptions>>(),
    VerbEntry::of::<operation::OperationArgs<CurvatureOptions>>(),
    VerbEntry::of::<operation::OperationArgs<RoughnessOptions>>(),
    VerbEntry::of::<operation::OperationArgs<TpiOptions>>(),
    VerbEntry::of::<operation::OperationArgs<TriOptions>>(),
    VerbEntry::of::<synth::SynthArgs>(),
    VerbEntry::of::<plan::PlanArgs>(),
    // As they were called before they were parts of `plan`.
    VerbEntry::hidden::<plan::run::PlanRunArgs>(),
    VerbEntry::hidden::<plan::run::FinishArgs>(),
    VerbEntry::hidden::<plan::status::PlanStatusArgs>(),
    VerbEntry::of::<demo::DemoArgs>(),
    VerbEntry::of::<completions::CompletionsArgs>(),
    VerbEntry::of::<man::ManArgs>(),
];

/// Out-of-core terrain engine: meshes with a proven vertical error bound, grids, tiles, contours and pages.
///
/// Results go to stdout, progress and messages to stderr. Nothing is overwritten unless
/// --overwrite is given, and files are written completely or not at all.
#[derive(Debug, Parser)]
#[command(
    name = "terrane",
    version,
    subcommand_required = true,
    arg_required_else_help = true,
    max_term_width = 100
)]
struct Cli;

/// The whole command line, for help, completions and man pages.
fn command() -> Command {
    command_of(VERBS)
}

fn command_of(verbs: &[VerbEntry]) -> Command {
    verbs.iter().fold(Cli::command(), |command, verb| command.subcommand((verb.command)()))
}

/// The command line with only the given verb: options of all verbs take a millisecond and a megabyte.
/// With all verbs if the command line does not start with one, and with none to print the version.
fn command_for(args: &[OsString]) -> Command {
    let Some(word) = args.get(1) else { return command() };
    if word == "--version" || word == "-V" {
        return Cli::command();
    }
    let first = VERBS.iter().position(|verb| verb.is_called(word));
    command_of(first.map_or(VERBS, |place| &VERBS[place..=place]))
}

/// The requested verb with its arguments.
fn parse(args: &[OsString], command: Command) -> Result<Job, clap::Error> {
    let matches = command.try_get_matches_from(args)?;
    let verb = matches.subcommand().and_then(|(name, found)| {
        VERBS.iter().find(|verb| verb.name == name).map(|verb| (verb.parse)(found))
    });
    // Clap rejects unknown verbs before.
    verb.unwrap_or_else(|| Err(clap::Error::new(clap::error::ErrorKind::MissingSubcommand)))
}

/// Runs the command line and returns the process exit code.
pub(crate) fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    heap::give_back();
    #[cfg(feature = "tracing")]
    shared::trace::start();
    let args: Vec<OsString> = args.into_iter().collect();
    let job = match parse(&args, command_for(&args)) {
        Ok(job) => job,
        Err(error) => return usage::report(&error, &args, &command_for(&args)),
    };
    let cancel = &Cancel::default();
    signal::stop(cancel.clone());
    match job(&VerbCall { cancel, command }) {
        Ok(VerbOutcome::Kept) => ExitCode::SUCCESS,
        Ok(VerbOutcome::Broken) => ErrorKind::CheckFailed.exit_code().into(),
        Ok(VerbOutcome::NotJudged) => NOT_JUDGED.into(),
        Err(error) => {
            output::error(&error);
            error.kind().exit_code().into()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_baselines as methods;
    use terrane_gridding as gridding;
    use terrane_mesh as mesh;
    use terrane_raster as raster;
    use terrane_synth as synth;
    use terrane_vector as vector;

    #[test]
    fn the_command_is_sound() {
        command().debug_assert();
    }

    #[test]
    fn help_names_every_registered_thing() {
        let help = |verb: &str| {
            let mut command = command();
            let help = command.find_subcommand_mut(verb).unwrap().render_help().to_string();
            // However lines are broken.
            help.split_whitespace().collect::<Vec<_>>().join(" ")
        };
        for format in raster::FORMATS {
            assert!(help("tin").contains(format.name), "{}", format.name);
        }
        for format in mesh::FORMATS {
            assert!(help("tin").contains(format.name), "{}", format.name);
        }
        for format in raster::write::FORMATS {
            assert!(help("convert").contains(format.name), "{}", format.name);
            for option in format.options {
                assert!(help("convert").contains(option.key), "{}", option.key);
            }
        }
        for format in vector::FORMATS.iter().filter(|format| format.create.is_some()) {
            assert!(help("contour").contains(format.name), "{}", format.name);
        }
        for method in methods::METHODS {
            assert!(help("tin").contains(method.about), "{}", method.name);
        }
        for method in gridding::METHODS {
            assert!(help("grid").contains(method.about), "{}", method.name);
        }
        for character in synth::CHARACTERS {
            assert!(help("synth").contains(character.name), "{}", character.name);
        }
    }
}
