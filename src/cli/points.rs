//! Summary of written points.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{points, report, text};
use terrane_lidar::points::TranslateReport;
use terrane_lidar::points::plan::PointsWritten;

/// Output of a plan.
pub(super) fn by_plan(written: PointsWritten) -> String {
    let report = TranslateReport::from(written);
    let mut rows = facts(&report);
    rows.extend(report::notes(&report.notes));
    format!("{} -> {}\n{}", report.input, report.output, text::table(&rows))
}

impl Summarize for TranslateReport {
    fn summary(&self) -> String {
        let mut rows = facts(self);
        rows.extend(
            report::transformed(self.transformed.as_ref()).filter(|(name, _)| *name == "operation"),
        );
        let rate = self.points_per_second.map(|rate| text::rate(rate, "points"));
        rows.extend(report::took(&self.run, rate, ""));
        rows.extend(report::notes(&self.notes));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }
}

fn facts(r: &TranslateReport) -> Vec<report::Row> {
    let written = format!("{} of point format {}", text::count(r.points), r.point_format);
    let files = match r.files {
        1 => String::new(),
        several => format!(", in {} files", text::count(several)),
    };
    let census = r.census.as_ref().map(|census| ("points", points::census(census)));
    let mut rows: Vec<report::Row> = census.into_iter().collect();
    rows.extend([
        ("written", written + &files),
        ("system", r.crs.clone()),
        ("size", text::bytes(r.output_bytes)),
    ]);
    rows
}
