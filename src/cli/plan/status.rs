//! `terrane status`: how far the work on a plan has come.

use std::path::PathBuf;

use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, say, text};
use crate::error::Result;
use crate::jobs::grid::plan::{GridStatus, grid_status};
use crate::jobs::plan::{Forecast, Kind, TaskReport, Told, kind};
use crate::jobs::sift::Skipped;
use crate::jobs::tin::{StatusReport, status_of};

/// Tell which tasks of a plan are done and which are not
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder of the plan
    folder: PathBuf,
    /// Print the result as JSON, with every task that is not done and those it waits for
    #[arg(long)]
    json: bool,
}

impl Verb for Args {
    const NAME: &'static str = "status";

    fn run(&self, _: &Call<'_>) -> Result<Outcome> {
        run(self)
    }
}

fn run(args: &Args) -> Result<Outcome> {
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
pub(crate) fn grid_summary(r: &GridStatus) -> String {
    let (width, height) = (text::count(r.width.into()), text::count(r.height.into()));
    let tile = text::count(r.tile_cells.into());
    let plan = Summary {
        kind: "grid",
        folder: &r.folder,
        plan_id: &r.plan_id,
        of: vec![
            ("points", text::count(r.points)),
            (
                "grid",
                format!("{width} x {height} cells in tiles of {tile}, written as {}", r.format),
            ),
        ],
        done: r.done,
        to_do: &r.to_do,
        damaged: &r.damaged,
        object_bytes: r.object_bytes,
        forecast: &r.forecast,
        told: &r.grid,
        skipped: &r.skipped,
    };
    format!("{} in {}\n{}", r.input, r.folder, plan.table())
}

/// The plan of a mesh for people.
pub(crate) fn summary(r: &StatusReport) -> String {
    let plan = Summary {
        kind: "mesh",
        folder: &r.folder,
        plan_id: &r.plan_id,
        of: vec![
            ("samples", text::count(r.samples)),
            ("max error", format!("{}, written as {}", text::number(r.max_error), r.format)),
        ],
        done: r.done,
        to_do: &r.to_do,
        damaged: &r.damaged,
        object_bytes: r.object_bytes,
        forecast: &r.forecast,
        told: &r.mesh,
        skipped: &r.skipped,
    };
    format!("{} in {}\n{}", r.input, r.folder, plan.table())
}

/// Files that were left out of the input of a plan, as rows of a table.
pub(crate) fn skipped(skipped: &[Skipped]) -> impl Iterator<Item = (&'static str, String)> {
    skipped.iter().map(|Skipped { file, reason }| ("skipped", format!("{file}: {reason}")))
}

/// What is told of any plan.
struct Summary<'a> {
    kind: &'static str,
    folder: &'a str,
    plan_id: &'a str,
    /// Of what it is.
    of: Vec<(&'static str, String)>,
    done: u64,
    to_do: &'a [TaskReport],
    damaged: &'a [String],
    object_bytes: u64,
    forecast: &'a Forecast,
    told: &'a Told,
    skipped: &'a [Skipped],
}

impl Summary<'_> {
    fn table(self) -> String {
        let (done, left) = (text::count(self.done), text::count(self.to_do.len() as u64));
        let mut rows = vec![("plan", self.plan_id[..16].to_owned())];
        rows.extend(self.of.iter().cloned());
        rows.push(("tasks", format!("{done} done, {left} to do")));
        if !self.to_do.is_empty() {
            rows.push(("time", self.time()));
        }
        rows.push((
            "memory",
            format!("at least {} for a task", text::bytes(self.forecast.least_memory)),
        ));
        rows.push(("disk", self.disk()));
        if !self.damaged.is_empty() {
            rows.push(("damaged", self.damaged.join(", ")));
        }
        rows.extend(skipped(self.skipped));
        if let Some(fault) = &self.told.output_fault {
            rows.push(("note", fault.clone()));
        }
        rows.push(match &self.told.output {
            Some(output) => (self.kind, output.clone()),
            None => ("next", format!("terrane run {}", self.folder)),
        });
        text::table(&rows)
    }

    fn time(&self) -> String {
        let Forecast { seconds, threads, .. } = *self.forecast;
        let threads =
            if threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
        format!("about {} on {threads}", text::seconds(seconds))
    }

    fn disk(&self) -> String {
        let Forecast { disk_needed, output_bytes, .. } = *self.forecast;
        let [used, more, output] = [self.object_bytes, disk_needed, output_bytes].map(text::bytes);
        format!("{used} in use, about {more} more, and about {output} for the {}", self.kind)
    }
}
