//! Contour lines for people.

use crate::cli::shared::{report, system, text};
use terrane_terrain::contour::ContourReport;

/// What was made.
pub(super) fn summary(r: &ContourReport) -> String {
    let heights = match (r.lowest, r.highest) {
        (Some(low), Some(high)) => {
            let [low, high] = [low, high].map(text::number);
            format!("{} from {low} to {high}", text::count(r.levels))
        }
        _ => "none: no height is crossed".to_owned(),
    };
    let lines = format!("{}, {} of them rings", text::count(r.lines), text::count(r.rings));
    let mut rows = vec![
        ("grid", format!("{} x {} samples", r.width, r.height)),
        ("crs", r.crs.clone()),
        ("levels", heights),
        ("lines", lines),
        ("vertices", vertices(r)),
        ("output", format!("{}, {}", r.format, text::bytes(r.output_bytes))),
    ];
    if r.left_out > 0 {
        let count = text::count(r.left_out);
        rows.push(("left out", format!("{count} around samples exactly on a level and no area")));
    }
    rows.extend(system::rows(r.transformed.as_ref()));
    rows.extend(report::took(&r.run, Some(text::rate(r.samples_per_second, "samples")), ""));
    rows.extend(report::notes(&r.notes));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

fn vertices(r: &ContourReport) -> String {
    let written = text::count(r.vertices);
    match r.tolerance {
        Some(tolerance) => {
            let unit = if tolerance.metres { " m" } else { "" };
            let (before, within) =
                (text::count(r.original_vertices), text::number(tolerance.value));
            format!("{written} of {before}, within {within}{unit}")
        }
        None => written,
    }
}
