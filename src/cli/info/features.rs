//! Summary of `terrane info` for vector files.

use crate::cli::shared::text;
use terrane_viewer::info::{FeaturesInfoReport, FieldStats};

/// Names and values.
pub(crate) fn rows(own: &FeaturesInfoReport) -> Vec<(String, String)> {
    let join = |values: &[f64]| {
        values.iter().map(|value| text::position(*value)).collect::<Vec<_>>().join(", ")
    };
    let kinds = own.geometries.iter();
    let kinds = kinds.map(|(kind, n)| format!("{}: {}", kind.name(), text::count(*n)));
    let range = |ends: &[f64; 2]| ends.map(text::position).join(" to ");
    let mut rows = vec![("format", own.format.to_owned())];
    rows.extend(own.layer.clone().map(|layer| ("layer", layer)));
    rows.extend([
        ("crs", own.crs.clone()),
        ("unit", if own.crs == "unknown" { "unknown" } else { own.horizontal_unit }.to_owned()),
        ("features", format!("{}{}", text::count(own.features), with_ids(own))),
        ("geometries", kinds.collect::<Vec<_>>().join(", ")),
        ("parts", parts(own)),
        ("vertices", text::count(own.vertices)),
    ]);
    rows.extend(own.bounds.map(|bounds| ("bounds", join(&bounds))));
    rows.extend(own.heights.as_ref().map(|ends| ("heights", range(ends))));
    let times = if own.measures_are_times { ", seconds since 1970 (UTC)" } else { "" };
    rows.extend(own.measures.as_ref().map(|ends| ("measures", range(ends) + times)));
    let rows = rows.into_iter().filter(|(_, value)| !value.is_empty());
    let mut rows: Vec<_> = rows.map(|(k, v)| (k.to_owned(), v)).collect();
    rows.extend(own.fields.iter().map(|field| ("field".to_owned(), described(own, field))));
    rows.extend(own.notes.iter().map(|note| ("note".to_owned(), note.clone())));
    rows
}

fn with_ids(own: &FeaturesInfoReport) -> String {
    match own.ids {
        0 => String::new(),
        ids if ids == own.features => ", each with an id".to_owned(),
        ids => format!(", {} with an id", text::count(ids)),
    }
}

/// Lines and rings, if any.
fn parts(own: &FeaturesInfoReport) -> String {
    let counts = [("lines", own.lines), ("outer rings", own.outer_rings), ("holes", own.holes)];
    let some = counts.into_iter().filter(|(_, n)| *n > 0);
    some.map(|(name, n)| format!("{name}: {}", text::count(n))).collect::<Vec<_>>().join(", ")
}

/// "NAME: text of 32 bytes, null in 3 features".
fn described(own: &FeaturesInfoReport, field: &FieldStats) -> String {
    let mut told = format!("{}: {}", field.name.escape_debug(), field.kind);
    told.extend(field.width.map(|width| format!(" of {width} bytes")));
    told.extend(field.decimals.filter(|n| *n > 0).map(|n| format!(" with {n} decimals")));
    let nulls = own.features.saturating_sub(field.values);
    told.extend((nulls > 0).then(|| format!(", null in {} features", text::count(nulls))));
    told
}
