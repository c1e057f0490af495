//! What a verb is to the command line, and how one of any type becomes a line of the list of them.

use std::ffi::OsStr;
use std::path::PathBuf;

use clap::{ArgMatches, Command};

use crate::cli::shared::many::InputSelection;
use crate::cli::shared::{VerbOutcome, names};
use terrane_base::door::Frontend;
use terrane_base::error::Result;
use terrane_engine::Cancel;

/// Arguments that can be run.
pub(crate) trait Verb: clap::Args + 'static {
    const NAME: &'static str;

    /// What else it may be called.
    const ALIASES: &'static [&'static str] = &[];

    /// Its usage after its name, where the last of its names is that of the output: clap does not know
    /// that one.
    fn usage() -> Option<String> {
        None
    }

    /// What it does, where that is not said of its arguments: those of several verbs.
    fn about() -> Option<String> {
        None
    }

    /// The lists that its help ends in.
    fn lists() -> Vec<String> {
        Vec::new()
    }

    /// Its names, and where the last of them belongs: that of the output.
    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        None
    }

    /// Which of many files are taken.
    fn many(&self) -> Option<&InputSelection> {
        None
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome>;
}

/// What surrounds a run.
pub(crate) struct VerbCall<'a> {
    pub(crate) cancel: &'a Cancel,
    /// The whole command line, for those who write about it.
    pub(crate) command: fn() -> Command,
}

/// A verb with its arguments, ready to run.
pub(crate) type Job = Box<dyn Fn(&VerbCall<'_>) -> Result<VerbOutcome>>;

/// A verb of any type.
pub(crate) struct VerbEntry {
    pub(crate) name: &'static str,
    /// What else it may be called.
    aliases: &'static [&'static str],
    /// The verb as clap sees it.
    pub(crate) command: fn() -> Command,
    /// Takes its arguments from what clap found.
    pub(crate) parse: fn(&ArgMatches) -> std::result::Result<Job, clap::Error>,
}

impl VerbEntry {
    pub(crate) const fn of<V: Verb>() -> Self {
        Self { name: V::NAME, aliases: V::ALIASES, command: command::<V>, parse: parse::<V> }
    }

    /// True for the word that stands for it.
    pub(crate) fn is_called(&self, word: &OsStr) -> bool {
        word == self.name || self.aliases.iter().any(|alias| word == *alias)
    }

    /// One that no help tells of.
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

/// Errors of its job come with the advice that only this verb can give.
fn parse<V: Verb>(found: &ArgMatches) -> std::result::Result<Job, clap::Error> {
    let mut verb = V::from_arg_matches(found)?;
    if let Some((names, output)) = verb.names() {
        names::take_output(names, output)?;
    }
    Ok(Box::new(move |call| {
        verb.run(call).map_err(|error| match verb.many() {
            Some(many) => many.advise(error),
            None => error,
        })
    }))
}
