//! `terrane status`: how far the work on a plan has come.

use std::path::PathBuf;

use crate::cli::{Outcome, say, text};
use crate::error::Result;
use crate::pipeline::grid::plan::{GridStatus, grid_status};
use crate::pipeline::plan::{Kind, kind};
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
    match kind(&args.folder)? {
        Kind::Tin => tell(args, &status_of(&args.folder)?, summary),
        Kind::Grid => tell(args, &grid_status(&args.folder)?, grid_summary),
    }
}

fn tell<R: serde::Serialize>(
    args: &Args,
    report: &R,
    summary: impl Fn(&R) -> String,
) -> Result<Outcome> {
    match args.json {
        true => say::json(report)?,
        false => say::result(&summary(report))?,
    }
    Ok(Outcome::Kept)
}

/// The plan of a grid for people.
pub(super) fn grid_summary(r: &GridStatus) -> String {
    let (width, height) = (text::count(r.width.into()), text::count(r.height.into()));
    let left = r.to_do.len() as u64;
    let tile = text::count(r.tile_cells.into());
    let mut rows = vec![
        ("plan", r.plan_id[..16].to_owned()),
        ("points", text::count(r.points)),
        ("grid", format!("{width} x {height} cells in tiles of {tile}, written as {}", r.format)),
        ("tasks", format!("{} done, {} to do", text::count(r.done), text::count(left))),
        ("disk", format!("{} in use", text::bytes(r.object_bytes))),
    ];
    if !r.damaged.is_empty() {
        rows.push(("damaged", r.damaged.join(", ")));
    }
    rows.push(match &r.output {
        Some(output) => ("grid", output.clone()),
        None => ("next", format!("terrane run {}", r.folder)),
    });
    format!("{} in {}\n{}", r.input, r.folder, text::table(&rows))
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
