//! Summary of `terrane info` for vector files.

use crate::cli::shared::text;
use terrane_viewer::info::{FeaturesInfoReport, FieldStats};

/// Names and values.
pub(crate) fn rows(report: &FeaturesInfoReport) -> Vec<(String, String)> {
    let kinds = report.geometries.iter();
    let kinds = kinds.map(|(kind, n)| format!("{}: {}", kind.name(), text::count(*n)));
    let mut rows = vec![("format", report.format.to_owned())];
    rows.extend(report.layer.clone().map(|layer| ("layer", layer)));
    rows.extend([
        ("crs", report.crs.clone()),
        (
            "unit",
            if report.crs == "unknown" { "unknown" } else { report.horizontal_unit }.to_owned(),
        ),
        ("features", format!("{}{}", text::count(report.features), with_ids(report))),
        ("geometries", kinds.collect::<Vec<_>>().join(", ")),
        ("parts", parts(report)),
        ("vertices", text::count(report.vertices)),
    ]);
    rows.extend(report.bounds.map(|bounds| ("bounds", bounds.map(text::position).join(", "))));
    rows.extend(report.heights.map(|ends| ("heights", range(ends))));
    let times = if report.measures_are_times { ", seconds since 1970 (UTC)" } else { "" };
    rows.extend(report.measures.map(|ends| ("measures", range(ends) + times)));
    let rows = rows.into_iter().filter(|(_, value)| !value.is_empty());
    let mut rows: Vec<_> = rows.map(|(k, v)| (k.to_owned(), v)).collect();
    rows.extend(report.fields.iter().map(|field| ("field".to_owned(), described(report, field))));
    rows.extend(report.notes.iter().map(|note| ("note".to_owned(), note.clone())));
    rows
}

fn range(ends: [f64; 2]) -> String {
    ends.map(text::position).join(" to ")
}

fn with_ids(report: &FeaturesInfoReport) -> String {
    match report.ids {
        0 => String::new(),
        ids if ids == report.features => ", each with an id".to_owned(),
        ids => format!(", {} with an id", text::count(ids)),
    }
}

/// Lines and rings, if any.
fn parts(report: &FeaturesInfoReport) -> String {
    let counts =
        [("lines", report.lines), ("outer rings", report.outer_rings), ("holes", report.holes)];
    let present = counts.into_iter().filter(|(_, n)| *n > 0);
    present.map(|(name, n)| format!("{name}: {}", text::count(n))).collect::<Vec<_>>().join(", ")
}

/// "NAME: text of 32 bytes, null in 3 features".
fn described(report: &FeaturesInfoReport, field: &FieldStats) -> String {
    let mut text = format!("{}: {}", field.name.escape_debug(), field.kind);
    text.extend(field.width.map(|width| format!(" of {width} bytes")));
    text.extend(field.decimals.filter(|n| *n > 0).map(|n| format!(" with {n} decimals")));
    let nulls = report.features.saturating_sub(field.values);
    text.extend((nulls > 0).then(|| format!(", null in {} features", text::count(nulls))));
    text
}
