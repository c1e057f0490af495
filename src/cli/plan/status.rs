//! `terrane plan status`: progress of a plan.

use std::path::PathBuf;

use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, output, text};
use terrane_base::error::Result;
use terrane_engine::operation::Divisible;
use terrane_engine::plan::{Forecast, PlanKind, StatusReport, kind};
use terrane_engine::skip_bad::Skipped;
use terrane_lidar::cloud_tin::CloudTinOptions;
use terrane_lidar::cloud_tin::plan::PointStatus;
use terrane_lidar::grid::GridOptions;
use terrane_lidar::grid::plan::CellStatus;
use terrane_lidar::points::PointsOptions;
use terrane_lidar::points::plan::PointTileStatus;
use terrane_terrain::tin::{MeshStatus, TinOptions};
use terrane_tiles::{TilesOptions, TilesStatus};

/// Show the completed and pending tasks of a plan
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct PlanStatusArgs {
    /// Folder of the plan
    folder: PathBuf,
    /// Print the result as JSON, with each pending task and the tasks it depends on
    #[arg(long)]
    json: bool,
}

impl Verb for PlanStatusArgs {
    const NAME: &'static str = "status";

    fn run(&self, _: &VerbCall<'_>) -> Result<VerbOutcome> {
        run(self)
    }
}

pub(crate) fn run(args: &PlanStatusArgs) -> Result<VerbOutcome> {
    match kind(&args.folder)? {
        PlanKind::Tin => print::<TinOptions>(args, summary),
        PlanKind::Cloud => print::<CloudTinOptions>(args, cloud_summary),
        PlanKind::Grid => print::<GridOptions>(args, grid_summary),
        PlanKind::Tiles => print::<TilesOptions>(args, tiles_summary),
        PlanKind::Points => print::<PointsOptions>(args, points_summary),
    }
}

fn print<O: Divisible>(
    args: &PlanStatusArgs,
    summary: fn(&StatusReport<O::Status>) -> String,
) -> Result<VerbOutcome> {
    let report = O::status(&args.folder)?;
    match args.json {
        true => output::json(&report)?,
        false => output::result(&summary(&report))?,
    }
    Ok(VerbOutcome::Kept)
}

/// Summary of a plan of a grid.
pub(crate) fn grid_summary(r: &StatusReport<CellStatus>) -> String {
    let [width, height, tile] =
        [r.of.width, r.of.height, r.tile_cells].map(|n| text::count(n.into()));
    let of = [
        ("points", text::count(r.of.points)),
        ("grid", format!("{width} x {height} cells in tiles of {tile}, written as {}", r.format)),
    ];
    table("grid", of, r)
}

/// Summary of a plan of a mesh.
pub(crate) fn summary(r: &StatusReport<MeshStatus>) -> String {
    let error = text::number(r.of.max_error);
    let of = [
        ("samples", text::count(r.of.samples)),
        ("max error", format!("{error}, written as {}", r.format)),
    ];
    table("mesh", of, r)
}

/// Summary of a plan of a mesh of a point cloud.
pub(crate) fn cloud_summary(r: &StatusReport<PointStatus>) -> String {
    let (points, error) = (text::count(r.of.points), text::number(r.of.max_error));
    let of = [
        ("points", format!("{points} in {} regions", text::count(r.of.regions))),
        ("max error", format!("{error}, written as {}", r.format)),
    ];
    table("mesh", of, r)
}

/// Summary of a plan of point tiles.
pub(crate) fn points_summary(r: &StatusReport<PointTileStatus>) -> String {
    let [columns, rows] = r.of.squares.map(text::count);
    let (side, cut) = (text::number(r.of.side), text::count(r.tile_cells.into()));
    let squares =
        format!("{columns} x {rows} of {side}, {cut} x {cut} per task, written as {}", r.format);
    table(
        "points",
        [("cloud", format!("{} points", text::count(r.of.points))), ("tiles", squares)],
        r,
    )
}

/// Summary of a plan of terrain tiles.
pub(crate) fn tiles_summary(r: &StatusReport<TilesStatus>) -> String {
    let of = [
        ("samples", text::count(r.of.samples)),
        ("levels", format!("0 to {}, written as {}", r.of.max_level, r.format)),
    ];
    table("tiles", of, r)
}

/// Skipped input files of a plan, as rows of a table.
pub(crate) fn skipped(skipped: &[Skipped]) -> impl Iterator<Item = (&'static str, String)> {
    skipped.iter().map(|Skipped { file, reason }| ("skipped", format!("{file}: {reason}")))
}

/// Summary of any plan of a `kind`, with its specific rows.
fn table<S>(kind: &'static str, of: [(&'static str, String); 2], r: &StatusReport<S>) -> String {
    let (done, left) = (text::count(r.done), text::count(r.to_do.len() as u64));
    let mut rows = vec![("plan", r.plan_id[..16].to_owned())];
    rows.extend(of);
    rows.push(("tasks", format!("{done} done, {left} to do")));
    if !r.to_do.is_empty() {
        rows.push(("time", time(&r.forecast)));
    }
    rows.push(("memory", format!("at least {} per task", text::bytes(r.forecast.least_memory))));
    let Forecast { disk_needed, output_bytes, .. } = r.forecast;
    let [used, more, output] = [r.object_bytes, disk_needed, output_bytes].map(text::bytes);
    rows.push((
        "disk",
        format!("{used} used, about {more} more needed, about {output} for the {kind}"),
    ));
    if !r.damaged.is_empty() {
        rows.push(("damaged", r.damaged.join(", ")));
    }
    rows.extend(skipped(&r.skipped));
    rows.extend(r.last_output.output_fault.clone().map(|fault| ("note", fault)));
    rows.push(match &r.last_output.output {
        Some(output) => (kind, output.clone()),
        None => ("next", format!("terrane plan run {}", r.folder)),
    });
    format!("{} in {}\n{}", r.input, r.folder, text::table(&rows))
}

fn time(Forecast { seconds, threads, .. }: &Forecast) -> String {
    let threads = if *threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
    format!("about {} on {threads}", text::seconds(*seconds))
}
