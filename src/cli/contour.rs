//! Summary of contour lines.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{report, text};
use terrane_terrain::contour::ContourReport;

impl Summarize for ContourReport {
    fn summary(&self) -> String {
        let heights = match (self.lowest, self.highest) {
            (Some(low), Some(high)) => {
                let [low, high] = [low, high].map(text::number);
                format!("{} from {low} to {high}", text::count(self.levels))
            }
            _ => "none (no level is crossed)".to_owned(),
        };
        let lines =
            format!("{}, {} of them rings", text::count(self.lines), text::count(self.rings));
        let mut rows = vec![
            ("grid", format!("{} x {} samples", self.width, self.height)),
            ("crs", self.crs.clone()),
            ("levels", heights),
            self.polygons.map_or(("lines", lines), |count| ("polygons", text::count(count))),
            ("vertices", vertices(self)),
        ];
        rows.push(("output", format!("{}, {}", self.format, text::bytes(self.output_bytes))));
        if self.left_out > 0 {
            let count = text::count(self.left_out);
            rows.push((
                "left out",
                format!("{count} rings without area around samples on a level"),
            ));
        }
        rows.extend(report::transformed(self.transformed.as_ref()));
        rows.extend(report::took(
            &self.run,
            Some(text::rate(self.samples_per_second, "samples")),
            "",
        ));
        rows.extend(report::notes(&self.notes));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }
}

fn vertices(r: &ContourReport) -> String {
    let written = text::count(r.vertices);
    match r.tolerance {
        // Those of polygons are written twice, and there are more on the border.
        Some(tolerance) if r.polygons.is_none() => {
            let unit = if tolerance.metres { " m" } else { "" };
            let (before, within) =
                (text::count(r.original_vertices), text::number(tolerance.value));
            format!("{written} of {before}, within {within}{unit}")
        }
        _ => written,
    }
}
