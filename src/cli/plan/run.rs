//! `terrane run` and `terrane finish`: the work of a plan is done, all of it or one task.

use std::path::PathBuf;

use crate::cli::plan::status;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, text};
use crate::cli::{grid, tin};
use crate::error::{Error, Result};
use crate::jobs::Cancel;
use crate::jobs::grid::plan::{GridRun, RunGridJob, run_grid};
use crate::jobs::plan::{Kind, kind};
use crate::jobs::sift::Skipped;
use crate::jobs::tin::{RunJob, RunReport, run_plan};

/// Do what a plan says: what is done already is checked and kept, what is missing or damaged is made,
/// then the mesh or grid is written. Killed, it goes on where it was when it is run again
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder of the plan
    folder: PathBuf,
    /// Only this task, such as strip-0, seam-0, tile-0 or finish; many may be done at the same time, on any
    /// machine that sees the folder and the input
    #[arg(long, value_name = "ID")]
    task: Option<String>,
    /// File to write [default: in the folder]
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    output: Option<PathBuf>,
    #[command(flatten)]
    how: How,
}

/// Write the mesh or grid of a plan whose other tasks are all done
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct FinishArgs {
    /// Folder of the plan
    folder: PathBuf,
    /// File to write [default: in the folder]
    output: Option<PathBuf>,
    #[command(flatten)]
    how: How,
}

#[derive(Clone, Debug, clap::Args)]
struct How {
    /// Replace a file that exists
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
    #[command(flatten)]
    split: tin::Split,
    #[command(flatten)]
    disk: args::Disk,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

impl Verb for FinishArgs {
    const NAME: &'static str = "finish";

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        finish(self, call.cancel)
    }
}

impl Verb for Args {
    const NAME: &'static str = "run";

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    work(&args.folder, args.task.clone(), args.output.clone(), &args.how, cancel)
}

pub(crate) fn finish(args: &FinishArgs, cancel: &Cancel) -> Result<Outcome> {
    let task = Some("finish".to_owned());
    work(&args.folder, task, args.output.clone(), &args.how, cancel)
}

fn work(
    folder: &std::path::Path,
    task: Option<String>,
    output: Option<PathBuf>,
    how: &How,
    cancel: &Cancel,
) -> Result<Outcome> {
    let is_part = task.as_deref().is_some_and(|task| task != "finish");
    if is_part && (output.is_some() || how.overwrite || how.split.tiles.is_some()) {
        return Err(Error::usage("only the last task writes a result").remedy(
            "leave out --output, --overwrite and --split, or pass them to terrane finish",
        ));
    }
    if kind(folder)? == Kind::Grid {
        return work_on_grid(folder, task, output, how, cancel);
    }
    if let Some(output) = &output {
        // Whether it exists is asked later: it may be the mesh of this very plan.
        how.split.check_output(output, true)?;
    }
    let job = RunJob {
        folder: folder.to_path_buf(),
        task,
        output,
        overwrite: how.overwrite,
        split: how.split.tiles,
        solid_base: None,
        disk: how.disk.check(),
        resources: how.machine.resources(),
    };
    let report = run_plan(&job, how.show.progress().as_ref(), cancel)?;
    how.show.tell(&report, || summary(&report))?;
    Ok(Outcome::Kept)
}

fn work_on_grid(
    folder: &std::path::Path,
    task: Option<String>,
    output: Option<PathBuf>,
    how: &How,
    cancel: &Cancel,
) -> Result<Outcome> {
    if how.split.tiles.is_some() {
        return Err(Error::usage("--split is for meshes, and this is the plan of a grid")
            .remedy("leave --split out"));
    }
    let job = RunGridJob {
        folder: folder.to_path_buf(),
        task,
        output,
        overwrite: how.overwrite,
        disk: how.disk.check(),
        resources: how.machine.resources(),
    };
    let report = run_grid(&job, how.show.progress().as_ref(), cancel)?;
    how.show.tell(&report, || grid_summary(&report))?;
    Ok(Outcome::Kept)
}

/// What was there before a run, and what never was.
fn found(
    [found, tasks, bytes]: [u64; 3],
    damaged: &[String],
    skipped: &[Skipped],
) -> Vec<(&'static str, String)> {
    let (of, tasks, bytes) = (text::count(found), text::count(tasks), text::bytes(bytes));
    let all =
        if found == 0 { "none".to_owned() } else { format!("{of} of {tasks}, {bytes} checked") };
    let mut rows = vec![("found done", all)];
    if !damaged.is_empty() {
        rows.push(("damaged", format!("{}; made anew", damaged.join(", "))));
    }
    rows.extend(status::skipped(skipped));
    rows
}

fn grid_summary(r: &GridRun) -> String {
    let mut rows = found([r.found, r.tasks, r.found_bytes], &r.damaged, &r.skipped);
    if !r.made.is_empty() {
        let made = text::count(r.made.len() as u64);
        let (points, bytes) = (text::count(r.points), text::bytes(r.made_bytes));
        rows.push(("made", format!("{made} tasks, {points} points read, {bytes}")));
    }
    rows.push(("time", text::seconds(r.wall_seconds)));
    if let Some(peak) = r.peak_memory {
        rows.push(("memory", format!("{} at the peak", text::bytes(peak))));
    }
    if let (Some(path), None) = (&r.written, &r.grid) {
        rows.push(("grid", format!("{path}, written before")));
    }
    let tasks = format!("{}\n{}", r.folder, text::table(&rows));
    r.grid.as_ref().map_or(tasks.clone(), |made| format!("{tasks}\n{}", grid::summary(made)))
}

fn summary(r: &RunReport) -> String {
    let mut rows = found([r.found, r.tasks, r.found_bytes], &r.damaged, &r.skipped);
    if !r.made.is_empty() {
        let made = text::count(r.made.len() as u64);
        let (samples, bytes) = (text::count(r.made_samples), text::bytes(r.made_bytes));
        rows.push(("made", format!("{made} tasks, {samples} samples, {bytes}")));
        rows.push(("in threads", tin::stages(&r.stages)));
    }
    rows.push(("time", text::seconds(r.wall_seconds)));
    if let Some(peak) = r.peak_memory {
        rows.push(("memory", format!("{} at the peak", text::bytes(peak))));
    }
    let tasks = format!("{}\n{}", r.folder, text::table(&rows));
    match &r.mesh {
        Some(mesh) => format!("{tasks}\n{}", tin::summary(mesh)),
        None => tasks,
    }
}
