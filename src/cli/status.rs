//! `terrane status`: how far the work on a plan has come.

use std::path::PathBuf;

use crate::cli::{Outcome, say, text};
use crate::error::Result;
use crate::pipeline::tin::{StatusReport, status_of};

/// Tell which tasks of a plan are done and which are not
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Folder of the plan
    folder: PathBuf,
    /// Print the result as JSON, with every task that is not done and those it waits for
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<Outcome> {
    let report = status_of(&args.folder)?;
    if args.json {
        say::json(&report)?;
    } else {
        say::result(&summary(&report))?;
    }
    Ok(Outcome::Kept)
}

pub(super) fn summary(r: &StatusReport) -> String {
    let left = r.to_do.len() as u64;
    let mut rows = vec![
        ("plan", r.plan_id[..16].to_owned()),
        ("samples", text::count(r.samples)),
        ("max error", format!("{}, written as {}", text::number(r.max_error), r.format)),
        ("tasks", format!("{} done, {} to do", text::count(r.done), text::count(left))),
        ("memory", format!("at least {} for a task", text::bytes(r.least_memory))),
        ("disk", disk(r)),
    ];
    if !r.damaged.is_empty() {
        rows.push(("damaged", r.damaged.join(", ")));
    }
    rows.push(match &r.output {
        Some(output) => ("mesh", output.clone()),
        None => ("next", format!("terrane run {}", r.folder)),
    });
    format!("{} in {}\n{}", r.input, r.folder, text::table(&rows))
}

fn disk(r: &StatusReport) -> String {
    let [used, more, mesh] = [r.object_bytes, r.disk_needed, r.mesh_bytes].map(text::bytes);
    format!("{used} in use, about {more} more, and about {mesh} for the mesh")
}
