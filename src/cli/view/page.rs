//! `terrane view --html` and `--serve`: a page of a grid, a mesh, lines, a cloud or tiles.

use std::path::Path;

use super::{ALTITUDE, AZIMUTH, Args, serve};
use crate::cli::shared::{many, points, report, text};
use crate::cloud::OpenOptions;
use crate::error::{Error, Result};
pub(super) use crate::jobs::page::MOST_POINTS;
use crate::jobs::page::{self, PageJob, PageReport, Show, USUAL_POINTS};
use crate::jobs::{Cancel, Resources};

/// True when one of the inputs is of features, or of lines by name.
pub(super) fn are_lines(inputs: &[String]) -> bool {
    inputs.iter().any(|input| many::are_features(input) || many::are_made_lines(input))
}

/// What is shown of the inputs; `cloud` tells how these are read, where they are.
///
/// # Errors
/// An option that does nothing for it.
pub(super) fn show(args: &Args, cloud: Option<OpenOptions>) -> Result<Show> {
    if let Some(open) = cloud {
        refuse_for_clouds(args)?;
        let points = args.points.unwrap_or(USUAL_POINTS);
        return Ok(Show::Cloud { open: Box::new(open), points });
    }
    refuse_cloud(args)?;
    if serve::are_tiles(&args.input) {
        serve::check_tiles(args)?;
        return Ok(Show::Tiles);
    }
    if are_lines(&args.input) {
        refuse_for_lines(args)?;
        return Ok(Show::Lines { layer: args.layer.clone() });
    }
    refuse_for_surfaces(args)?;
    Ok(match args.insertion {
        true => Show::Insertion,
        false => Show::Surface { against: args.against.clone().map(|grid| vec![grid].into()) },
    })
}

pub(super) fn make(
    args: &Args,
    show: Show,
    output: &Path,
    resources: Resources,
    cancel: &Cancel,
) -> Result<PageReport> {
    let job = PageJob {
        input: args.input.clone().into(),
        reading: args.grid.whole().reading(None),
        show,
        output: output.to_path_buf(),
        overwrite: args.overwrite,
        edges: args.edges,
        azimuth: args.azimuth.unwrap_or(AZIMUTH),
        altitude: args.altitude.unwrap_or(ALTITUDE),
        exaggeration: args.exaggeration,
        bbox: args.grid.bounds,
        resources,
    };
    page::run(&job, args.show.progress().as_ref(), cancel)
}

/// The options about surfaces that do nothing for lines and clouds, and whether they were given.
fn of_surfaces(args: &Args) -> [(&'static str, bool); 5] {
    [
        ("--insertion", args.insertion),
        ("--against", args.against.is_some()),
        ("--edges", args.edges),
        ("--azimuth", args.azimuth.is_some()),
        ("--altitude", args.altitude.is_some()),
    ]
}

/// Fails when an option was given that does nothing for lines.
fn refuse_for_lines(args: &Args) -> Result<()> {
    let exaggeration = ("--exaggeration", args.exaggeration.is_some());
    let given: Vec<_> = of_surfaces(args).into_iter().chain([exaggeration]).collect();
    refuse("lines", args, &given)
}

/// Fails when an option was given that does nothing for clouds.
fn refuse_for_clouds(args: &Args) -> Result<()> {
    let layer = ("--layer", args.layer.is_some());
    let given: Vec<_> = of_surfaces(args).into_iter().chain([layer]).collect();
    refuse_given("clouds", args.grid.given_of_grids(), &given)
}

/// Fails when an option about clouds was given, as the input is none.
pub(super) fn refuse_cloud(args: &Args) -> Result<()> {
    if args.points.is_some() {
        return Err(Error::usage("--points is for point clouds, and this is none")
            .remedy("leave --points out"));
    }
    args.input.iter().try_for_each(|input| args.cloud.refuse(input))
}

/// Fails when one of these options was given, or one about grids or many files.
pub(super) fn refuse(what: &str, args: &Args, given: &[(&'static str, bool)]) -> Result<()> {
    refuse_given(what, args.grid.given().or(args.many.given()), given)
}

/// Fails when one of these options was given, or this `other`.
fn refuse_given(
    what: &str,
    other: Option<&'static str>,
    given: &[(&'static str, bool)],
) -> Result<()> {
    let given = given.iter().filter(|(_, given)| *given).map(|(option, _)| *option);
    match other.into_iter().chain(given).next() {
        Some(option) => Err(Error::usage(format!("{option} is not for a page of {what}"))
            .remedy(format!("leave {option} out"))),
        None => Ok(()),
    }
}

/// Fails when an option was given that does nothing for a grid or mesh.
fn refuse_for_surfaces(args: &Args) -> Result<()> {
    if args.layer.is_some() {
        return Err(Error::usage("--layer is for a page of lines").remedy("leave --layer out"));
    }
    match &args.against {
        Some(grid) => args.grid.whole().check(grid),
        None => args.grid.whole().check_all(&args.input),
    }
}

pub(super) fn summary(r: &PageReport) -> String {
    let mut rows = vec![("page", format!("{}, {}", r.page, text::bytes(r.output_bytes)))];
    let triangles = r.triangles.map(|n| format!(", {} triangles", text::count(n)));
    if let Some(vertices) = r.vertices {
        let vertices =
            format!("{} vertices{}", text::count(vertices), triangles.unwrap_or_default());
        rows.push(("holds", vertices));
    }
    if let (Some(shown), Some(census)) = (r.points, &r.census) {
        let of = if shown < census.kept { ", chosen evenly" } else { "" };
        let shown = format!("{} of {} points{of}", text::count(shown), text::count(census.kept));
        rows.push(("shows", shown));
        rows.push(("points", points::census(census)));
    }
    if let (Some(tiles), Some(levels)) = (r.tiles, r.levels) {
        rows.push(("shows", format!("{} tiles of {levels} levels", text::count(tiles))));
    }
    if let (Some(parts), Some(features)) = (r.parts, r.features) {
        let of =
            format!("{} lines and rings of {} features", text::count(parts), text::count(features));
        rows.push(("lines", of));
    }
    if let Some(stride) = r.stride.filter(|stride| *stride > 1) {
        rows.push(("samples", format!("one in {stride} along rows and columns")));
    }
    rows.push(("bounds", r.bounds.map(text::number).join(", ")));
    if let (Some(low), Some(high)) = (r.lowest, r.highest) {
        rows.push(("heights", format!("{} to {}", text::number(low), text::number(high))));
    }
    if let Some(error) = r.max_error {
        rows.push(("error", format!("{} at the most", text::number(error))));
    }
    rows.extend(report::took(&r.run, None, ""));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}
