//! `terrane man`: manual pages, one for terrane and one for each verb.

use std::io::Write;
use std::path::PathBuf;

use clap::Command;

use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, output};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::atomic::{self, AtomicFile};

/// Write manual pages into a folder
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ManArgs {
    /// Output folder, created if missing
    dir: PathBuf,
    /// Overwrite existing pages
    #[arg(long)]
    overwrite: bool,
}

impl Verb for ManArgs {
    const NAME: &'static str = "man";

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        run(self, (call.command)())
    }
}

fn run(args: &ManArgs, command: Command) -> Result<VerbOutcome> {
    atomic::create_folders(&args.dir)?;
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let mut verbs = Vec::new();
    describe(&command, &mut verbs);
    for page in std::iter::once(command).chain(verbs) {
        let name = page.get_display_name().unwrap_or(page.get_name()).to_owned();
        let path = args.dir.join(format!("{name}.1"));
        let mut file = AtomicFile::create(&path, args.overwrite)?;
        file.write_all(&render(page)?).map_err(|e| Error::write(&path, e))?;
        file.commit()?;
        output::result(&format!("{}\n", path.display()))?;
    }
    Ok(VerbOutcome::Kept)
}

/// All documented verbs, including those of plans.
fn describe(command: &Command, verbs: &mut Vec<Command>) {
    for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set()) {
        verbs.push(verb.clone());
        describe(verb, verbs);
    }
}

fn render(page: Command) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    let rendered = clap_mangen::Man::new(page).render(&mut text);
    rendered.map_err(|e| Error::io(ErrorKind::Io, "lay out a manual page", e))?;
    Ok(text)
}
