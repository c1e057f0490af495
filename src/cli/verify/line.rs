//! `terrane verify` on simplified lines.

use crate::cli::shared::{Outcome, check, report, text};
use crate::cli::verify::args::Args;
use crate::cli::verify::told;
use crate::error::{Error, Result};
use crate::files::{name_of, path_of};
use crate::jobs::Cancel;
use crate::jobs::line::Measure;
use crate::jobs::verify::{LineVerifyJob, LineVerifyReport, verify_lines};

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let job = job(args)?;
    let report = verify_lines(&job, args.show.progress().as_ref(), cancel)?;
    told::finish(args, &report, &report.verdict, || summary(&report))
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<LineVerifyJob> {
    let [original] = args.source.as_slice() else {
        return Err(Error::usage("lines are proved against one file")
            .remedy("name the file that they were made from"));
    };
    if args.max_error.is_some() {
        return Err(Error::usage("--max-error is for meshes, and these are lines")
            .in_file(&args.mesh)
            .remedy("pass --tolerance"));
    }
    if let Some(option) = args.grid.given() {
        return Err(Error::usage(format!("{option} is for grids, and these are lines"))
            .in_file(&args.mesh)
            .remedy(format!("leave {option} out")));
    }
    args.refuse_of_kept("these are lines")?;
    args.refuse_of_surfaces("these are lines")?;
    if let Some(option) = args.many.given() {
        return Err(Error::usage(format!(
            "{option} is for many files, and lines are proved against one"
        ))
        .remedy(format!("leave {option} out")));
    }
    args.points.refuse(original)?;
    check::input(original)?;
    let read = [name_of(args.mesh.clone())?, original.clone()];
    check::report(args.report.as_deref(), &read, &[], args.overwrite)?;
    let original = path_of(original);
    let lines = &args.lines;
    Ok(LineVerifyJob {
        lines: args.mesh.clone(),
        original: original.into_owned(),
        layer: lines.layer.clone(),
        tolerance: lines.tolerance,
        is_space: lines.metric.is_some(),
        topology: lines.topology,
        may_drop: lines.may_drop(),
        sides: lines.sides.clone(),
        resources: args.machine.resources(),
    })
}

/// A proof for people: the verdict, what failed, and the figures.
fn summary(r: &LineVerifyReport) -> String {
    let verdict = told::in_words(&r.verdict);
    let unit = if r.measure == Measure::Geographic { " m" } else { "" };
    let far = text::number(r.largest_distance);
    let place = r.farthest.map_or(String::new(), |[x, y]| format!(", at {x}, {y}"));
    let allowed = match r.tolerance {
        Some(tolerance) => format!(" of {}{unit} allowed", text::number(tolerance)),
        None => String::new(),
    };
    let only = if r.topology { "" } else { " (not judged: --topology)" };
    let [before, after] = r.vertices.map(text::count);
    let [had, has, new] = r.crossings.map(text::count);
    let (features, parts) = (text::count(r.features), text::count(r.parts));
    let mut rows = vec![
        ("proof", verdict),
        (
            "features",
            format!(
                "{features}; {} gone, {} added, {} with other properties, {} with other points",
                text::count(r.gone_features),
                text::count(r.added_features),
                text::count(r.changed_attributes),
                text::count(r.changed_points)
            ),
        ),
        ("lines", format!("{parts} lines and rings, {} gone", text::count(r.dropped))),
        ("heights", format!("{} changed, measures among them", text::count(r.changed_heights))),
        ("vertices", format!("{after} of {before}")),
        ("distance", format!("{far}{unit}{allowed}{place}")),
        ("crossings", format!("{has}, of which {new} are new; {had} before{only}")),
        (
            "rings",
            format!(
                "{} without area, {} turned over{only}",
                text::count(r.collapsed),
                text::count(r.turned)
            ),
        ),
        (
            "sides",
            format!("{} changed, {} borders torn{only}", text::count(r.moved), text::count(r.torn)),
        ),
    ];
    rows.extend(report::took(&r.run, None, ""));
    rows.extend(r.verdict.failures.iter().map(|failure| ("broken", failure.clone())));
    rows.extend(r.verdict.not_judged.iter().map(|what| ("not judged", what.clone())));
    rows.extend(report::notes(&r.notes));
    format!("{} <- {}\n{}", r.lines, r.original, text::table(&rows))
}
