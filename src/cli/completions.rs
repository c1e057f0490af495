//! `terrane completions`: shell completion scripts.

use clap::Command;
use clap_complete::Shell;

use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, output};
use terrane_base::error::Result;

/// Print a completion script for a shell
#[derive(Clone, Debug, clap::Args)]
pub(super) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

impl Verb for CompletionsArgs {
    const NAME: &'static str = "completions";

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        run(self, (call.command)())
    }
}

fn run(args: &CompletionsArgs, mut command: Command) -> Result<VerbOutcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "terrane", &mut script);
    output::to_stdout(&script)?;
    Ok(VerbOutcome::Kept)
}
