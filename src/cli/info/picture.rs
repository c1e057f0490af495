//! Summary of `terrane info CLOUD --picture`.

use terrane_options::Choice;

use crate::cli::shared::text;
use terrane_viewer::cloud_picture::PictureReport;

/// Names and values; areas are in squared `unit`.
pub(super) fn rows(report: &PictureReport, unit: &str) -> Vec<(String, String)> {
    let cells = format!(
        "{} x {} of {} {unit}, {} with points",
        text::count(report.columns),
        text::count(report.rows),
        text::number(report.cell),
        text::count(report.filled)
    );
    let voids = &report.voids;
    let mut void = format!(
        "{} cells, {:.1} % of the hull, {}",
        text::count(voids.cells),
        100.0 * voids.share,
        area(voids.area, unit)
    );
    if let Some(bounds) = voids.largest_bounds {
        let bounds = bounds.map(text::number).join(", ");
        void += &format!("; the largest {} within {bounds}", area(voids.largest_area, unit));
    }
    let (what, bytes) = (report.shows.name(), text::bytes(report.output_bytes));
    let picture = format!("{}, {what}, {bytes}", report.output);
    let rows = [
        ("picture", picture),
        ("cells", cells),
        ("densest", format!("{} points per square {unit}", text::number(report.densest))),
        ("voids", void),
    ];
    rows.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

fn area(area: f64, unit: &str) -> String {
    format!("{} square {unit}", text::number(area))
}
