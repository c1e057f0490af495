//! Summary of meshes of grids.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{report, text};
use crate::cli::tin::report::{errors, stages};
use terrane_raster::undeclared_nodata;
use terrane_terrain::tin::{GREEDY, TinReport};

impl Summarize for TinReport {
    fn summary(&self) -> String {
        let mut rows = vec![
            (
                "grid",
                format!(
                    "{} x {}, {}",
                    text::count(self.width.into()),
                    text::count(self.height.into()),
                    self.crs
                ),
            ),
            ("samples", samples(self)),
            (
                "vertices",
                format!(
                    "{}, {} of the valid samples",
                    text::count(self.vertices),
                    text::percent(self.kept)
                ),
            ),
            ("triangles", text::count(self.triangles)),
            ("max error", errors(self.max_error, self.tolerance, self.rmse, &self.vertical_unit)),
            ("file", format!("{}, {}", text::bytes(self.output_bytes), self.format)),
        ];
        rows.extend(self.bands.iter().map(|band| ("band", text::band(band))));
        rows.extend(method(self).map(|method| ("method", method)));
        rows.extend(self.min_angle.zip(self.thin_triangles).map(|(min_angle, thin)| {
            let verdict =
                if thin.count == 0 { "met by all triangles" } else { "not met by all triangles" };
            ("min angle", format!("{min_angle} degrees, {verdict}"))
        }));
        rows.extend(
            self.keep_points.as_ref().map(|kept| ("kept", text::required_points(kept, "grid"))),
        );
        rows.extend(
            self.breaklines.as_ref().map(|lines| ("breaklines", text::breaklines(lines, "grid"))),
        );
        rows.extend(self.water.as_ref().map(|water| ("water", text::water(water))));
        rows.extend(report::transformed(self.transformed.as_ref()));
        rows.extend(self.placed.as_ref().map(|placed| ("placed", text::placed(placed))));
        if let (Some(value), Some(count)) = (self.suspected_nodata, self.suspected_samples) {
            rows.push(("warning", undeclared_nodata(count, value)));
        }
        let rate = text::rate(self.samples_per_second, "samples");
        rows.extend(report::took(
            &self.run,
            Some(rate),
            &format!("thread time: {}", stages(&self.stages)),
        ));
        rows.extend(report::notes(&self.notes));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }

    fn shortfall(&self) -> Option<String> {
        self.shortfall()
    }
}

/// The method, if it is not the default.
fn method(report: &TinReport) -> Option<String> {
    let (method, triangulation) = (report.method.as_deref(), report.triangulation.as_deref());
    let method = method.or(triangulation.map(|_| GREEDY))?;
    Some([Some(method), triangulation].into_iter().flatten().collect::<Vec<_>>().join(", "))
}

fn samples(r: &TinReport) -> String {
    let void = r.samples.saturating_sub(r.valid_samples);
    let mut line = text::count(r.samples);
    if void > 0 {
        line += &format!(", {} void", text::count(void));
    }
    if r.isolated_samples > 0 {
        let lone = text::count(r.isolated_samples);
        line += &format!(", {lone} isolated (no surface)");
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_engine::local_frame::StorageScale;

    #[test]
    fn a_summary_tells_counts_errors_and_time() {
        let mut report = TinReport::default();
        report.input = "a.tif".into();
        report.output = "a.ply".into();
        report.format = "PLY".into();
        report.width = 1201;
        report.height = 643;
        report.vertical_unit = "metre".into();
        report.tolerance = 5.0;
        report.max_error = Some(4.998046875);
        report.samples = 772_243;
        report.valid_samples = 772_000;
        report.isolated_samples = 2;
        report.vertices = 12_345;
        report.kept = 0.016;
        report.samples_per_second = 12.3e6;
        report.placed = Some(StorageScale::default());
        report.suspected_nodata = Some(-1.0);
        report.suspected_samples = Some(7);
        (report.run.threads, report.run.peak_memory) = (2, Some(1 << 20));
        report.notes = vec!["first".into(), "second".into()];
        let text = report.summary();
        for part in [
            "1,201 x 643",
            "243 void",
            "12,345, 1.60 %",
            "4.99805 metre, 5 metre allowed",
            "12.3 M samples/s, 2 threads",
            "2 isolated",
        ] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        let lines: Vec<_> = text.lines().collect();
        let is_new = |i: usize| !lines[..i].contains(&lines[i]);
        assert!((0..lines.len()).all(is_new), "a line is there twice:\n{text}");
    }
}
