//! Summary of meshes of point clouds.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{points, report, text};
use crate::cli::tin::report::{errors, stages};
use terrane_lidar::cloud_tin::CloudTinReport;

impl Summarize for CloudTinReport {
    fn summary(&self) -> String {
        let share =
            format!("{}, {} of the points", text::count(self.vertices), text::percent(self.kept));
        let mut rows = vec![
            ("points", points(self)),
            ("vertices", share),
            ("triangles", text::count(self.triangles)),
            ("max error", errors(self.max_error, self.tolerance, self.rmse, &self.vertical_unit)),
            ("file", format!("{}, {}", text::bytes(self.output_bytes), self.format)),
        ];
        rows.extend(
            self.keep_points.as_ref().map(|kept| ("kept", text::required_points(kept, "cloud"))),
        );
        let lines = self.breaklines.as_ref();
        rows.extend(lines.map(|lines| ("breaklines", text::breaklines(lines, "cloud"))));
        rows.extend(self.placed.as_ref().map(|placed| ("placed", text::placed(placed))));
        let rate = text::rate(self.points_per_second, "points");
        rows.extend(report::took(&self.run, Some(rate), &stages(&self.stages)));
        rows.extend(report::notes(&self.notes));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }

    fn shortfall(&self) -> Option<String> {
        self.shortfall()
    }
}

fn points(r: &CloudTinReport) -> String {
    let stacked = match r.stacked_points {
        0 => String::new(),
        n => format!("; {} stacked (same x and y)", text::count(n)),
    };
    format!("{}, {}{stacked}", points::census(&r.points), r.crs)
}
