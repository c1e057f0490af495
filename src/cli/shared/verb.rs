//! Verbs of the command line, and their type-erased list.

use std::ffi::OsStr;
use std::path::PathBuf;

use clap::{ArgMatches, Command};

use crate::cli::shared::batch::InputSelection;
use crate::cli::shared::{VerbOutcome, names};
use terrane_base::error::Result;
use terrane_base::frontend::Frontend;
use terrane_engine::Cancel;

/// Arguments that can be run.
pub(crate) trait Verb: clap::Args + 'static {
    const NAME: &'static str;

    /// Aliases.
    const ALIASES: &'static [&'static str] = &[];

    /// Usage after the name, if the last name is the output, which clap does not know.
    fn usage() -> Option<String> {
        None
    }

    /// Help of a verb whose arguments are shared by several verbs.
    fn about() -> Option<String> {
        None
    }

    /// Lists at the end of the help.
    fn lists() -> Vec<String> {
        Vec::new()
    }

    /// Names, and the destination of the last one: the output.
    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        None
    }

    /// Selection of input files.
    fn input_selection(&self) -> Option<&InputSelection> {
        None
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome>;
}

/// Context of a run.
pub(crate) struct VerbCall<'a> {
    pub(crate) cancel: &'a Cancel,
    /// The whole command line, for generated documentation.
    pub(crate) command: fn() -> Command,
}

/// A verb with its arguments, ready to run.
pub(crate) type Job = Box<dyn Fn(&VerbCall<'_>) -> Result<VerbOutcome>>;

/// A verb of any type.
pub(crate) struct VerbEntry {
    pub(crate) name: &'static str,
    /// Aliases.
    aliases: &'static [&'static str],
    /// The clap command.
    pub(crate) command: fn() -> Command,
    /// Takes the arguments from clap.
    pub(crate) parse: fn(&ArgMatches) -> std::result::Result<Job, clap::Error>,
}

impl VerbEntry {
    pub(crate) const fn of<V: Verb>() -> Self {
        Self { name: V::NAME, aliases: V::ALIASES, command: command::<V>, parse: parse::<V> }
    }

    /// True for a name or alias of the verb.
    pub(crate) fn is_called(&self, word: &OsStr) -> bool {
        word == self.name || self.aliases.iter().any(|alias| word == *alias)
    }

    /// A hidden verb.
    pub(crate) const fn hidden<V: Verb>() -> Self {
        Self { command: || command::<V>().hide(true), ..Self::of::<V>() }
    }
}

fn command<V: Verb>() -> Command {
    let command =
        V::augment_args(Command::new(V::NAME).visible_aliases(V::ALIASES.iter().copied()));
    let command = match V::about() {
        Some(about) => {
            let short = about.lines().next().unwrap_or_default().to_owned();
            command.about(short).long_about(about)
        }
        None => command,
    };
    let command = match V::usage() {
        Some(usage) => command.override_usage(format!("terrane {} {usage}", V::NAME)),
        None => command,
    };
    let lists = V::lists();
    if lists.is_empty() {
        command
    } else {
        command.after_help(Frontend::CommandLine.spell(&lists.join("\n\n")).into_owned())
    }
}

/// Adds advice of this verb to errors of its job.
fn parse<V: Verb>(found: &ArgMatches) -> std::result::Result<Job, clap::Error> {
    let mut verb = V::from_arg_matches(found)?;
    if let Some((names, output)) = verb.names() {
        names::take_output(names, output)?;
    }
    Ok(Box::new(move |call| {
        verb.run(call).map_err(|error| match verb.input_selection() {
            Some(many) => many.advise(error),
            None => error,
        })
    }))
}
