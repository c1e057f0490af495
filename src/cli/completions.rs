//! `terrane completions`: a script that teaches a shell the command line.

use clap::Command;
use clap_complete::Shell;

use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, say};
use terrane_base::error::Result;

/// Print a completion script for a shell
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

impl Verb for Args {
    const NAME: &'static str = "completions";

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, (call.command)())
    }
}

fn run(args: &Args, mut command: Command) -> Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "terrane", &mut script);
    say::to_stdout(&script)?;
    Ok(Outcome::Kept)
}
