//! Summary of statistics of zones.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{report, text};
use terrane_terrain::zonal::ZonalReport;

impl Summarize for ZonalReport {
    fn summary(&self) -> String {
        let mut rows = vec![
            ("zones", format!("{} of {}", text::count(self.zones), self.zones_file)),
            ("crs", self.crs.clone()),
            ("samples", text::count(self.samples)),
            ("output", format!("{}, {}", self.format, text::bytes(self.output_bytes))),
        ];
        rows.extend(report::transformed(self.transformed.as_ref()));
        let rate = text::rate(self.samples_per_second, "samples");
        rows.extend(report::took(&self.run, Some(rate), ""));
        rows.extend(report::notes(&self.notes));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }
}
