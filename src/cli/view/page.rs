//! `terrane view --html`: a page of a grid, a mesh or lines.

use std::path::Path;

use super::Args;
use crate::cli::shared::{check, report, text};
use crate::error::Result;
use crate::jobs::page::{self, PageJob, PageReport, Show};
use crate::jobs::{Cancel, Resources};

pub(super) fn make(
    args: &Args,
    html: &Path,
    resources: Resources,
    cancel: &Cancel,
) -> Result<PageReport> {
    if args.against.is_none() {
        args.grid.check_all(&args.input)?;
    }
    args.against.iter().try_for_each(|grid| args.grid.check(grid))?;
    check::ending(html, &["html", "htm"], "a page")?;
    check::new_file(html, args.overwrite)?;
    let job = PageJob {
        input: args.input.clone().into(),
        reading: args.grid.reading(None),
        show: Show::Surface { against: args.against.clone().map(|grid| vec![grid].into()) },
        output: html.to_path_buf(),
        overwrite: args.overwrite,
        edges: args.edges,
        azimuth: args.azimuth,
        altitude: args.altitude,
        exaggeration: args.exaggeration,
        bbox: args.bbox,
        resources,
    };
    page::run(&job, args.show.progress().as_ref(), cancel)
}

pub(super) fn summary(r: &PageReport) -> String {
    let mut rows = vec![("page", format!("{}, {}", r.page, text::bytes(r.output_bytes)))];
    let triangles = r.triangles.map(|n| format!(", {} triangles", text::count(n)));
    let vertices = format!("{} vertices{}", text::count(r.vertices), triangles.unwrap_or_default());
    rows.push(("holds", vertices));
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
