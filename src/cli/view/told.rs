//! Pictures and pages, for people.

use crate::cli::shared::{points, report, text};
use terrane_viewer::page::PageReport;
use terrane_viewer::view::ViewReport;

/// A picture.
pub(crate) fn summary(r: &ViewReport) -> String {
    let heights = match (r.lowest, r.highest) {
        (Some(low), Some(high)) => {
            format!("{} to {}", text::number(low.into()), text::number(high.into()))
        }
        _ => "none: there is no surface in this picture".to_owned(),
    };
    let mut rows = vec![
        ("picture", format!("{} x {} pixels, {}", r.width, r.height, text::bytes(r.output_bytes))),
        ("bounds", r.bounds.map(text::number).join(", ")),
        ("heights", heights),
        ("exaggeration", text::number(r.exaggeration)),
    ];
    rows.extend(report::took(&r.run, None, ""));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

/// A page.
pub(crate) fn page_summary(r: &PageReport) -> String {
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
