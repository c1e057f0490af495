//! `terrane completions`: a script that teaches a shell the command line.

use clap_complete::Shell;

use crate::cli::help;
use crate::cli::shared::{Outcome, say};
use crate::error::Result;

/// Print a completion script for a shell
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

pub(super) fn run(args: &Args) -> Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut help::command(), "terrane", &mut script);
    say::to_stdout(&script)?;
    Ok(Outcome::Kept)
}
