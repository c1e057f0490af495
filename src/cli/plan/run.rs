//! `terrane plan run` and `terrane plan finish`: runs all tasks of a plan, or one.

use std::path::{Path, PathBuf};

use crate::cli::plan::status;
use crate::cli::shared::report::Summarize;
use crate::cli::shared::tabled::OperationOptionArgs;
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, check, output, text};
use crate::cli::{points, tin};
use terrane_base::error::{Error, Result};
use terrane_engine::Cancel;
use terrane_engine::operation::Divisible;
use terrane_engine::plan::{DescribesRun, PlanKind, RunJob, RunOptions, RunReport, kind};
use terrane_lidar::cloud_tin::CloudTinOptions;
use terrane_lidar::cloud_tin::plan::PointRun;
use terrane_lidar::grid::GridOptions;
use terrane_lidar::grid::plan::CellRun;
use terrane_lidar::points::PointsOptions;
use terrane_lidar::points::plan::PointTileRun;
use terrane_terrain::tin::{MeshRun, TinOptions};
use terrane_tiles::{TilesOptions, TilesRun};

/// Run the tasks of a plan and write its mesh, grid, tiles or points
///
/// Completed tasks are checked and kept; missing or damaged ones are run. An interrupted run resumes where it stopped.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct PlanRunArgs {
    /// Folder of the plan
    folder: PathBuf,
    #[command(flatten)]
    how: PlanRunSettings,
}

/// Write the mesh, grid, tiles or points of a plan whose other tasks are complete
#[derive(Clone, Debug, clap::Args)]
#[command(mut_arg("task", |task| task.hide(true)))]
pub(crate) struct FinishArgs {
    /// Folder of the plan
    folder: PathBuf,
    /// Output file, or output folder for tiles or points [default: in the plan folder]
    file: Option<PathBuf>,
    #[command(flatten)]
    how: PlanRunSettings,
}

#[derive(Clone, Debug, clap::Args)]
struct PlanRunSettings {
    #[command(flatten)]
    options: OperationOptionArgs<RunOptions>,
    #[command(flatten)]
    show: args::ReportDisplay,
}

impl Verb for FinishArgs {
    const NAME: &'static str = "finish";

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        finish(self, call.cancel)
    }
}

impl Verb for PlanRunArgs {
    const NAME: &'static str = "run";

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        run(self, call.cancel)
    }
}

pub(crate) fn run(args: &PlanRunArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    work(&args.folder, &args.how.options.0, &args.how, cancel)
}

pub(crate) fn finish(args: &FinishArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    let mut options = args.how.options.0.clone();
    if options.task.is_some() {
        return Err(Error::usage("‹task› is not supported by `terrane plan finish`")
            .remedy("leave ‹task› out, or pass it to terrane plan run"));
    }
    if args.file.is_some() && options.output.is_some() {
        return Err(Error::usage("the output is given twice").remedy("leave ‹output› out"));
    }
    options.task = Some("finish".to_owned());
    options.output = args.file.clone().or(options.output);
    work(&args.folder, &options, &args.how, cancel)
}

fn work(
    folder: &Path,
    options: &RunOptions,
    how: &PlanRunSettings,
    cancel: &Cancel,
) -> Result<VerbOutcome> {
    let job = options.job(folder.to_path_buf())?;
    let kind = kind(folder)?;
    if let (PlanKind::Tin, Some(output)) = (kind, &job.output) {
        // Existence is checked later: it may be the mesh of this plan.
        match job.form.split {
            Some(_) => check::folder(output)?,
            None => check::new_file(output, true)?,
        }
    }
    match kind {
        PlanKind::Tin => how.work::<TinOptions>(&job, summary, cancel),
        PlanKind::Cloud => how.work::<CloudTinOptions>(&job, cloud_summary, cancel),
        PlanKind::Grid => how.work::<GridOptions>(&job, grid_summary, cancel),
        PlanKind::Tiles => how.work::<TilesOptions>(&job, tiles_summary, cancel),
        PlanKind::Points => how.work::<PointsOptions>(&job, points_summary, cancel),
    }
}

impl PlanRunSettings {
    fn work<O: Divisible>(
        &self,
        job: &RunJob,
        summary: fn(&RunReport<O::Done>) -> String,
        cancel: &Cancel,
    ) -> Result<VerbOutcome> {
        let report = O::run_plan(job, self.show.progress().as_ref(), cancel)?;
        self.show.print(&report, || summary(&report))?;
        let shortfall = report.of.shortfall();
        shortfall.iter().for_each(|shortfall| output::failure(shortfall));
        Ok(VerbOutcome::of(shortfall.is_none(), true))
    }
}

fn tiles_summary(r: &RunReport<TilesRun>) -> String {
    let made = format!("{} tiles", text::count(r.of.made_tiles));
    run_summary(r, &rows(r, made, None), r.of.tiles.as_ref().map(Summarize::summary))
}

fn points_summary(r: &RunReport<PointTileRun>) -> String {
    let made = format!("{} points written", text::count(r.of.points));
    run_summary(r, &rows(r, made, None), r.of.written.clone().map(points::by_plan))
}

fn cloud_summary(r: &RunReport<PointRun>) -> String {
    let made = format!("{} vertices chosen", text::count(r.of.vertices));
    run_summary(r, &rows(r, made, None), r.of.mesh.as_ref().map(Summarize::summary))
}

fn grid_summary(r: &RunReport<CellRun>) -> String {
    let made = format!("{} points read by tiles", text::count(r.of.points));
    let mut rows = rows(r, made, None);
    if let (Some(path), None) = (&r.of.written, &r.of.grid) {
        rows.push(("grid", format!("{path}, written before")));
    }
    run_summary(r, &rows, r.of.grid.as_ref().map(Summarize::summary))
}

fn summary(r: &RunReport<MeshRun>) -> String {
    let made = format!("{} samples", text::count(r.of.made_samples));
    let rows = rows(r, made, Some(tin::stages(&r.of.stages)));
    run_summary(r, &rows, r.of.mesh.as_ref().map(Summarize::summary))
}

/// Summary of a run of any plan: `made` is the result, `stages` the thread time of its stages.
fn rows<R: DescribesRun>(
    r: &RunReport<R>,
    made: String,
    stages: Option<String>,
) -> Vec<(&'static str, String)> {
    // The final task counts as well, as in the open tasks.
    let is_there = r.of.written().is_some() && !r.finished;
    let done = r.found + u64::from(is_there);
    let (found, tasks) = (text::count(done), text::count(r.tasks));
    let all = match done {
        0 => "none".to_owned(),
        _ => format!("{found} of {tasks}, {} checked", text::bytes(r.found_bytes)),
    };
    let mut rows = vec![("reused", all)];
    if !r.damaged.is_empty() {
        rows.push(("damaged", format!("{}; made anew", r.damaged.join(", "))));
    }
    rows.extend(status::skipped(&r.skipped));
    let count = r.made.len() as u64 + u64::from(r.finished);
    if count > 0 {
        let (tasks, bytes) = (text::count(count), text::bytes(r.made_bytes));
        rows.push(("made", format!("{tasks} tasks, {made}, {bytes}")));
        rows.extend(stages.map(|stages| ("thread time", stages)));
    }
    rows.push(("time", text::seconds(r.wall_seconds)));
    rows.extend(r.peak_memory.map(|peak| ("memory", format!("peak {}", text::bytes(peak)))));
    rows
}

/// Rows of a run, with the written output.
fn run_summary<R>(
    r: &RunReport<R>,
    rows: &[(&'static str, String)],
    written: Option<String>,
) -> String {
    let tasks = format!("{}\n{}", r.folder, text::table(rows));
    written.map_or(tasks.clone(), |written| format!("{tasks}\n{written}"))
}
