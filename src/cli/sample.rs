//! Summaries of features with properties of a grid: heights at points, statistics of zones.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{report, text};
use terrane_terrain::AnnotationReport;
use terrane_terrain::sample::SampleReport;
use terrane_terrain::zonal::ZonalReport;

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
        let positions = format!("{positions}, {without} of them without a height");
        let rows = vec![("positions", positions), ("heights", heights)];
        summary(&self.common, rows, text::rate(self.positions_per_second, "positions"))
    }
}

impl Summarize for ZonalReport {
    fn summary(&self) -> String {
        let rows = vec![("samples", text::count(self.samples))];
        summary(&self.common, rows, text::rate(self.samples_per_second, "samples"))
    }
}

fn summary(common: &AnnotationReport, own: Vec<(&'static str, String)>, rate: String) -> String {
    let features = format!("{} of {}", text::count(common.features), common.features_file);
    let mut rows = vec![("features", features), ("grid CRS", common.crs.clone())];
    // The output has the CRS of the features.
    rows.extend(common.transformed.iter().map(|own| ("reprojected by", own.operation.clone())));
    rows.extend(own);
    rows.push(("output", format!("{}, {}", common.format, text::bytes(common.output_bytes))));
    rows.extend(report::took(&common.run, Some(rate), ""));
    rows.extend(report::notes(&common.notes));
    format!("{} -> {}\n{}", common.input, common.output, text::table(&rows))
}
