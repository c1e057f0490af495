//! `terrane verify` on terrain tiles.

use crate::cli::shared::{Outcome, check, many, report, text};
use crate::cli::verify::args::Args;
use crate::cli::verify::told;
use crate::cloud;
use crate::error::{Error, Result};
use crate::files::name_of;
use crate::jobs::Cancel;
use crate::jobs::options::GridInput;
use crate::jobs::sift::{Sifted, Skipped};
use crate::jobs::verify::tiles::{
    CheckReport, LevelReport, TilesVerifyJob, TilesVerifyReport, verify_tiles,
    verify_tiles_of_cloud,
};
use crate::raster::{self, Inputs};

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    refuse(args)?;
    match args.many.are_clouds(&args.source)? {
        true => of_cloud(args, cancel),
        false => of_grid(args, cancel),
    }
}

/// Against a model of the ground, made again.
fn of_cloud(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    args.grid.refuse_cloud(&args.source[0])?;
    let resources = args.machine.resources();
    let options = args.points.open_options(&args.grid, &resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.source, many::Kind::Clouds(&options), &resources)?;
    let read = [cloud::files(&names)?, args.grid.clip.clone().into_iter().collect()].concat();
    let job = job(args, read, Inputs::default())?;
    // Points are within bounds and polygons, and the model is whole.
    let reading = GridInput { bounds: None, clip: None, ..job.reading };
    let job = TilesVerifyJob { reading, ..job };
    let model = args.ground.model(names, args.many.reading(options));
    let report = verify_tiles_of_cloud(&model, &job, args.show.progress().as_ref(), cancel)?;
    tell(args, &report, &skipped)
}

fn of_grid(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    args.ground.refuse(&args.source[0])?;
    args.points.refuse(&args.source[0])?;
    let resources = args.machine.resources();
    let options = args.grid.open_options(&resources);
    let Sifted { names, skipped } =
        args.many.take(&args.source, many::Kind::Grids(&options), &resources)?;
    args.grid.check_all(&names)?;
    let job = job(args, args.grid.read_with(raster::files(&names)?), names.into())?;
    let report = verify_tiles(&job, args.show.progress().as_ref(), cancel)?;
    tell(args, &report, &skipped)
}

/// The job against a raster; `read` are the files that are read for that.
fn job(args: &Args, mut read: Vec<String>, raster: Inputs) -> Result<TilesVerifyJob> {
    read.extend(args.water.iter().chain(&args.geoid).cloned());
    read.push(name_of(args.mesh.clone())?);
    check::report(args.report.as_deref(), &read, &[], args.overwrite)?;
    Ok(TilesVerifyJob {
        tiles: args.mesh.clone(),
        raster,
        reading: args.grid.reading(args.water.as_ref()),
        geoid: args.geoid.clone(),
        resources: args.machine.resources(),
    })
}

fn tell(args: &Args, report: &TilesVerifyReport, skipped: &[Skipped]) -> Result<Outcome> {
    let whole = report::WithSkipped { report, skipped };
    told::finish(args, &whole, &report.verdict, || summary(report))
}

/// Refuses what tiles are not held to.
fn refuse(args: &Args) -> Result<()> {
    let of_lines = args.lines.given();
    let option = of_lines.or(args.max_error.is_some().then_some("--max-error"));
    if let Some(option) = option {
        let what = if of_lines.is_some() { "simplified lines" } else { "meshes" };
        return Err(Error::usage(format!("{option} is for {what}, and these are terrain tiles"))
            .in_file(&args.mesh)
            .remedy(format!("leave {option} out: layer.json states what tiles promise")));
    }
    args.refuse_of_meshes("these are terrain tiles")
}

/// A proof for people: the verdict, what failed, and the figures.
fn summary(r: &TilesVerifyReport) -> String {
    let verdict = told::in_words(&r.verdict);
    let failures: String = r.verdict.failures.iter().map(|f| format!("  - {f}\n")).collect();
    let sizes = [r.files, r.vertices, r.triangles].map(text::count);
    let mut rows = vec![(
        "tiles".to_owned(),
        format!("{}, {} vertices, {} triangles", sizes[0], sizes[1], sizes[2]),
    )];
    rows.extend(r.checks.iter().map(|check| (check.check.to_owned(), judged(check))));
    rows.extend(r.levels.iter().map(|level| (format!("level {}", level.level), of(level))));
    let rate = text::rate(r.samples_per_second, "samples");
    let took = report::took(&r.run, Some(rate), "");
    rows.extend(took.into_iter().chain(report::notes(&r.notes)).map(|(k, v)| (k.to_owned(), v)));
    format!("{verdict}\n{failures}{}", text::table(&rows))
}

fn judged(check: &CheckReport) -> String {
    let faults: u64 = check.faults.iter().map(|fault| fault.count).sum();
    let verdict = match faults {
        0 => "nothing wrong".to_owned(),
        count => format!("{} faults", text::count(count)),
    };
    format!("{verdict}; {}", check.looked_at)
}

/// A level on one line.
fn of(level: &LevelReport) -> String {
    let [error, allowed] =
        [level.max_error.map_or("-".to_owned(), text::bound), text::number(level.tolerance)];
    let gap = match (level.coarser_gap, level.coarser_gap_allowed) {
        (Some(gap), Some(allowed)) => {
            format!(", gap {} of {} to the coarser level", text::bound(gap), text::number(allowed))
        }
        _ => String::new(),
    };
    format!(
        "{} tiles, error {error} of {allowed} m, RMSE {}; {} borders, {} differ, gap {}{gap}",
        text::count(level.tiles),
        text::height(level.rmse),
        text::count(level.borders),
        text::count(level.borders_differing),
        level.gap.map_or("-".to_owned(), text::bound)
    )
}
