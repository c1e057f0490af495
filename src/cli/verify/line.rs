//! Summary of verified lines.

use crate::cli::shared::{report, text};
use crate::cli::verify::verdict;
use terrane_simplify::DistanceKind;
use terrane_verify::LineVerifyReport;

/// Summary of a verification: verdict, failures, and figures.
pub(super) fn summary(r: &LineVerifyReport) -> String {
    let verdict = verdict::in_words(&r.verdict);
    let unit = if r.measure == DistanceKind::Geographic { " m" } else { "" };
    let far = text::number(r.largest_distance);
    let place = r.farthest.map_or(String::new(), |[x, y]| format!(", at {x}, {y}"));
    let allowed = match r.tolerance {
        Some(tolerance) => format!(" of {}{unit} allowed", text::number(tolerance)),
        None => String::new(),
    };
    let only = if r.topology { "" } else { " (not judged without --topology)" };
    let [before, after] = r.vertices.map(text::count);
    let [had, has, new] = r.crossings.map(text::count);
    let (features, parts) = (text::count(r.features), text::count(r.parts));
    let mut rows = vec![
        ("proof", verdict),
        (
            "features",
            format!(
                "{features}; {} missing, {} added, {} with other properties, {} with other points",
                text::count(r.gone_features),
                text::count(r.added_features),
                text::count(r.changed_attributes),
                text::count(r.changed_points)
            ),
        ),
        ("lines", format!("{parts} lines and rings, {} missing", text::count(r.dropped))),
        ("heights", format!("{} changed, including measures", text::count(r.changed_heights))),
        ("vertices", format!("{after} of {before}")),
        ("distance", format!("{far}{unit}{allowed}{place}")),
        ("crossings", format!("{has}, {new} of them new; {had} before{only}")),
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
