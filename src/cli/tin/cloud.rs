//! Reports of meshes of clouds, for people.

use crate::cli::shared::{points, report, text};
use crate::cli::tin::told::{errors, stages};
use terrane_lidar::cloud_tin::CloudTinReport;

/// A made mesh for people.
pub(crate) fn summary(r: &CloudTinReport) -> String {
    let share = format!("{}, {} of the points", text::count(r.vertices), text::percent(r.kept));
    let mut rows = vec![
        ("points", points(r)),
        ("vertices", share),
        ("triangles", text::count(r.triangles)),
        ("max error", errors(r.max_error, r.tolerance, r.rmse, &r.vertical_unit)),
        ("file", format!("{}, {}", text::bytes(r.output_bytes), r.format)),
    ];
    rows.extend(r.keep_points.as_ref().map(|kept| ("kept", text::kept(kept, "cloud"))));
    let lines = r.breaklines.as_ref();
    rows.extend(lines.map(|lines| ("breaklines", text::breaklines(lines, "cloud"))));
    rows.extend(r.placed.as_ref().map(|placed| ("placed", text::placed(placed))));
    let rate = text::rate(r.points_per_second, "points");
    rows.extend(report::took(&r.run, Some(rate), &stages(&r.stages)));
    rows.extend(report::notes(&r.notes));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

fn points(r: &CloudTinReport) -> String {
    let stacked = match r.stacked_points {
        0 => String::new(),
        n => format!("; {} above another at the same position", text::count(n)),
    };
    format!("{}, {}{stacked}", points::census(&r.points), r.crs)
}
