//! Summary of `terrane info` for point clouds.

use std::collections::BTreeMap;
use std::fmt::Display;

use super::{details, picture};
use crate::cli::shared::text;
use terrane_base::geom::Point3;
use terrane_viewer::cloud_stats::CloudStats;
use terrane_viewer::heights::HeightDistribution;
use terrane_viewer::info::CloudInfoReport;

/// Names and values.
pub(crate) fn rows(cloud: &CloudInfoReport) -> Vec<(String, String)> {
    let unit = cloud.horizontal_unit;
    let mut rows = vec![
        ("format", cloud.format.to_owned()),
        (
            "points",
            format!("{} in {} parts", text::count(cloud.points), text::count(cloud.parts as u64)),
        ),
        ("files", text::count(cloud.files as u64)),
        ("crs", cloud.crs.clone()),
        (
            "unit",
            format!(
                "{unit}, heights in {}",
                cloud.vertical_unit.as_deref().unwrap_or("unit unknown")
            ),
        ),
        ("scale", cloud.scale.map(|v| v.to_string()).join(", ")),
        ("offset", cloud.offset.map(|v| v.to_string()).join(", ")),
    ];
    rows.extend(cloud.bounds.iter().flat_map(|ends| {
        let [low, high] = corners(cloud, ends);
        [("lowest corner", low), ("highest corner", high)]
    }));
    rows.extend(
        cloud.density.map(|density| {
            ("density", format!("{} points per square {unit}", text::number(density)))
        }),
    );
    let mut rows: Vec<_> = rows.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
    rows.extend(details::rows(&cloud.details));
    rows.extend(cloud.stats.iter().flat_map(|stats| stats_rows(cloud, stats)));
    let heights = cloud.stats.iter().filter_map(|stats| stats.heights.as_ref());
    rows.extend(heights.flat_map(heights_rows));
    rows.extend(cloud.picture.iter().flat_map(|drawn| picture::rows(drawn, unit)));
    rows.extend(cloud.notes.iter().map(|note| ("note".to_owned(), note.clone())));
    rows
}

/// Corners with the decimals of the scale.
fn corners(cloud: &CloudInfoReport, ends: &[Point3; 2]) -> [String; 2] {
    let decimals = cloud.scale.map(|s| (-s.log10()).ceil().clamp(0.0, 12.0) as usize);
    ends.map(|p| std::array::from_fn::<_, 3, _>(|i| format!("{:.*}", decimals[i], p[i])).join(", "))
}

fn stats_rows(cloud: &CloudInfoReport, stats: &CloudStats) -> Vec<(String, String)> {
    let census = &stats.census;
    let mut rows = vec![
        ("read", format!("{}, {} kept", text::count(census.read), text::count(census.kept))),
        ("classes", counts(&stats.classes)),
        ("returns", format!("{}, last: {}", counts(&stats.returns), text::count(stats.last))),
        ("flags", counts(&stats.flags)),
    ];
    if census.lost > 0 {
        rows.push(("lost", text::count(census.lost)));
    }
    rows.extend(stats.bounds.iter().flat_map(|ends| {
        let [low, high] = corners(cloud, ends);
        [("lowest found", low), ("highest found", high)]
    }));
    rows.into_iter().filter(|(_, v)| !v.is_empty()).map(|(k, v)| (k.to_owned(), v)).collect()
}

fn counts<K: Display>(counts: &BTreeMap<K, u64>) -> String {
    let counts = counts.iter().map(|(name, count)| format!("{name}: {}", text::count(*count)));
    counts.collect::<Vec<_>>().join(", ")
}

/// Characters of the longest bar.
const LONGEST: u64 = 40;

/// Mean, percentiles, and a bar per step.
fn heights_rows(heights: &HeightDistribution) -> Vec<(String, String)> {
    let percentiles = heights.percentiles.iter();
    let percentiles = percentiles.map(|(percent, z)| format!("{percent} %: {}", text::number(*z)));
    let percentiles = percentiles.collect::<Vec<_>>().join(", ");
    let mut rows = vec![
        ("mean height".to_owned(), text::number(heights.mean)),
        (
            "percentiles".to_owned(),
            format!("{percentiles} (within {})", text::number(heights.within)),
        ),
    ];
    let max_points = heights.histogram.iter().map(|bar| bar.points).max().unwrap_or(1).max(1);
    rows.extend(heights.histogram.iter().map(|bar| {
        // Non-empty bins get at least one character.
        let long = (bar.points as f64 / max_points as f64 * LONGEST as f64).ceil() as usize;
        let name = format!("{} to {}", text::number(bar.low), text::number(bar.high));
        let gap = if long > 0 { " " } else { "" };
        (name, format!("{}{gap}{}", "#".repeat(long), text::count(bar.points)))
    }));
    rows
}
