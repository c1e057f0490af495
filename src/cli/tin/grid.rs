//! `terrane tin` on grids.

use std::path::{Path, PathBuf};

use crate::cli::shared::{Outcome, check, many, pipes, report, system, text};
use crate::cli::tin::args::{Args, Creation};
use crate::cli::tin::textbook;
use crate::cli::tin::told::{Told, errors, stages};
use crate::cli::verify;
use crate::error::{Error, Result};
use crate::jobs::Cancel;
use crate::jobs::bands::Bands;
use crate::jobs::sift::{Sifted, Skipped};
use crate::jobs::tin::{self, TinJob, TinReport};
use crate::jobs::verify::VerifyJob;
use crate::mesh;
use crate::raster::{self, OpenOptions, undeclared_nodata};

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    args.points.refuse(&args.input[0])?;
    args.disk.check_workdir(args.workdir.as_deref())?;
    args.textbook.check(args)?;
    let bands = args.bands.bands(&args.grid)?;
    let resources = args.machine.resources();
    let options = OpenOptions { colours: bands.is_some(), ..args.grid.open_options(&resources) };
    let grids = many::Kind::Grids(&options);
    let mut args = args.clone();
    let mut stdin = pipes::Stdin::expect(&mut args.input, pipes::Holds::Grid, &resources)?;
    if args.workdir.is_some() {
        stdin.refuse("--workdir")?;
    }
    args.input = args.many.find(&args.input, grids)?;
    let job = job(&args)?;
    stdin.gather(&mut args.input, cancel)?;
    let Sifted { names, skipped } = args.many.sift(args.input.clone(), grids, &resources)?;
    let job = TinJob { input: stdin.inputs(names), ..job };
    make(&args, (&job, bands.as_ref()), &skipped, cancel)
}

fn make(
    args: &Args,
    (job, bands): (&TinJob, Option<&Bands>),
    skipped: &[Skipped],
    cancel: &Cancel,
) -> Result<Outcome> {
    let progress = args.show.progress();
    let made = match &args.workdir {
        None => match (bands, args.textbook.by(args)) {
            (Some(bands), _) => tin::run_bands(job, bands, progress.as_ref(), cancel)?,
            (None, None) => tin::run(job, progress.as_ref(), cancel)?,
            (None, Some(by)) => tin::run_by(job, &by, progress.as_ref(), cancel)?,
        },
        Some(folder) => {
            tin::run_in(folder, job, skipped, args.disk.check(), progress.as_ref(), cancel)?
        }
    };
    let checked = match args.verify {
        true => {
            let proof = VerifyJob { bands: args.bands.asked(&args.grid)?, ..proof(job, &made) };
            Some(crate::jobs::verify::run(&proof, progress.as_ref(), cancel)?)
        }
        false => None,
    };
    let unmet = made.unmet();
    let told = Told { made: &made, checked: checked.as_ref(), skipped, unmet };
    told.tell(args, || summary(&made), verify::summary)
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<TinJob> {
    args.grid.check_all(&args.input)?;
    let usual = args.split.tiles.map(|_| "PLY");
    let format = mesh::by_path(&args.output, args.format.as_deref().or(usual))?;
    let is_plain = format.carries == mesh::Carries::Nothing;
    if args.bands.is_given() && is_plain {
        return Err(Error::usage(format!("{} has no room for --bands", format.name))
            .remedy("write PLY, or GLB for three or four bands of 8 bits"));
    }
    let mut files = args.grid.read_with(raster::files(&args.input)?);
    files.extend(args.method.files());
    files.extend(args.system.files()?);
    check::not_among(&files, &[&args.output])?;
    // An output that exists may be the mesh of an earlier run there.
    let goes_on = args.workdir.as_ref().is_some_and(|folder| folder.exists());
    args.split.check_output(&args.output, args.overwrite || goes_on)?;
    let results: Vec<&Path> =
        std::iter::once(&args.output).chain(&args.workdir).map(PathBuf::as_path).collect();
    check::report(args.report.as_deref(), &files, &results, args.overwrite)?;
    let solid_base = args.co.iter().map(|Creation::SolidBase(height)| *height).next_back();
    if solid_base.is_some() && !format.can_be_solid {
        return Err(Error::usage(format!("{} has no option SOLID_BASE", format.name))
            .remedy("write STL or 3MF, or leave --co out"));
    }
    let placing = args.print.placing()?;
    if let Some(option) = placing.given().filter(|_| args.workdir.is_some()) {
        return Err(Error::usage(format!("{option} cannot be kept in a --workdir"))
            .remedy(format!("leave one of --workdir and {option} out")));
    }
    if solid_base.is_some() && placing.base.is_some() {
        return Err(Error::usage("--base and SOLID_BASE are two bottoms of one solid")
            .remedy("leave one of them out"));
    }
    if (solid_base.is_some() || placing.base.is_some()) && args.verify {
        return Err(Error::usage("a solid has walls and a bottom, which are no terrain to verify")
            .remedy("leave out --verify, or verify the mesh without --base and --co SOLID_BASE"));
    }
    let transform = args.system.transform()?;
    if transform.is_some() && args.verify {
        return Err(Error::usage("a mesh is proved in the system of its grid")
            .remedy("leave --verify out, or --to-crs"));
    }
    Ok(TinJob {
        input: args.input.clone().into(),
        reading: args.grid.reading(args.method.water.as_ref()),
        output: args.output.clone(),
        format: Some(format.name.to_owned()),
        overwrite: args.overwrite,
        split: args.split.tiles,
        solid_base,
        placing,
        transform,
        goal: args.goal.goal()?,
        refinement: args.method.refinement(),
        tile: args.method.tile(),
        measure: args.show.json || args.report.is_some(),
        resources: args.machine.resources(),
    })
}

/// The job of proving what a tin job wrote.
pub(crate) fn proof(job: &TinJob, made: &TinReport) -> VerifyJob {
    VerifyJob {
        mesh: job.output.clone(),
        raster: job.input.clone(),
        reading: job.reading.clone(),
        tolerance: Some(made.tolerance),
        bound: None,
        min_angle: None,
        keep_points: job.refinement.keep_points.clone(),
        breaklines: job.refinement.breaklines.clone(),
        bands: None,
        resources: job.resources.clone(),
    }
}

/// A made mesh for people.
pub(crate) fn summary(r: &TinReport) -> String {
    let mut rows = vec![
        (
            "grid",
            format!(
                "{} x {}, {}",
                text::count(r.width.into()),
                text::count(r.height.into()),
                r.crs
            ),
        ),
        ("samples", samples(r)),
        (
            "vertices",
            format!("{}, {} of the valid samples", text::count(r.vertices), text::percent(r.kept)),
        ),
        ("triangles", text::count(r.triangles)),
        ("max error", errors(r.max_error, r.tolerance, r.rmse, &r.vertical_unit)),
        ("file", format!("{}, {}", text::bytes(r.output_bytes), r.format)),
    ];
    rows.extend(r.bands.iter().map(|band| ("band", text::band(band))));
    rows.extend(textbook::told(r).map(|method| ("method", method)));
    rows.extend(r.min_angle.zip(r.thin_triangles).map(|(least, thin)| {
        let held = if thin.count == 0 { "held by all" } else { "missed by some" };
        ("min angle", format!("{least} degrees, {held}"))
    }));
    rows.extend(r.keep_points.as_ref().map(|kept| ("kept", text::kept(kept, "grid"))));
    rows.extend(r.breaklines.as_ref().map(|lines| ("breaklines", text::breaklines(lines, "grid"))));
    rows.extend(r.water.as_ref().map(|water| ("water", text::water(water))));
    rows.extend(system::rows(r.transformed.as_ref()));
    rows.extend(r.placed.as_ref().map(|placed| ("placed", text::placed(placed))));
    if let (Some(value), Some(count)) = (r.suspected_nodata, r.suspected_samples) {
        rows.push(("warning", undeclared_nodata(count, value)));
    }
    let rate = text::rate(r.samples_per_second, "samples");
    rows.extend(report::took(&r.run, Some(rate), &format!("in threads: {}", stages(&r.stages))));
    rows.extend(report::notes(&r.notes));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

fn samples(r: &TinReport) -> String {
    let void = r.samples.saturating_sub(r.valid_samples);
    let mut line = text::count(r.samples);
    if void > 0 {
        line += &format!(", {} void", text::count(void));
    }
    if r.isolated_samples > 0 {
        let lone = text::count(r.isolated_samples);
        line += &format!(", {lone} valid without a valid cell beside them (no surface there)");
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::figures::Figures;
    use crate::jobs::placing::Placed;

    #[test]
    fn a_summary_tells_counts_errors_and_time() {
        let report = TinReport {
            input: "a.tif".into(),
            output: "a.ply".into(),
            format: "PLY".into(),
            width: 1201,
            height: 643,
            vertical_unit: "metre".into(),
            tolerance: 5.0,
            max_error: Some(4.998046875),
            samples: 772_243,
            valid_samples: 772_000,
            isolated_samples: 2,
            vertices: 12_345,
            kept: 0.016,
            samples_per_second: 12.3e6,
            placed: Some(Placed::default()),
            suspected_nodata: Some(-1.0),
            suspected_samples: Some(7),
            run: Figures { threads: 2, peak_memory: Some(1 << 20), ..Figures::default() },
            notes: vec!["first".into(), "second".into()],
            ..TinReport::default()
        };
        let text = summary(&report);
        for part in [
            "1,201 x 643",
            "243 void",
            "12,345, 1.60 %",
            "4.99805 metre, 5 metre allowed",
            "12.3 M samples/s, 2 threads",
            "2 valid without",
        ] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        let lines: Vec<_> = text.lines().collect();
        let is_new = |i: usize| !lines[..i].contains(&lines[i]);
        assert!((0..lines.len()).all(is_new), "a line is there twice:\n{text}");
    }
}
