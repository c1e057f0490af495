//! Summary of heights at points.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{report, text};
use terrane_terrain::sample::SampleReport;

impl Summarize for SampleReport {
    fn summary(&self) -> String {
        let heights = match (self.lowest, self.highest) {
            (Some(low), Some(high)) => {
                let [low, high] = [low, high].map(text::number);
                format!("{low} to {high}")
            }
            _ => "none".to_owned(),
        };
        let [positions, without] = [self.positions, self.without_height].map(text::count);
        let mut rows = vec![
            ("features", format!("{} of {}", text::count(self.features), self.points_file)),
            ("crs", self.crs.clone()),
            ("positions", format!("{positions}, {without} of them without a height")),
            ("heights", heights),
            ("output", format!("{}, {}", self.format, text::bytes(self.output_bytes))),
        ];
        rows.extend(report::transformed(self.transformed.as_ref()));
        let rate = text::rate(self.positions_per_second, "positions");
        rows.extend(report::took(&self.run, Some(rate), ""));
        rows.extend(report::notes(&self.notes));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }
}
