//! Summary of verified meshes of point clouds.

use crate::cli::shared::{points, text};
use crate::cli::verify::verdict;
use terrane_verify::{CloudProofFindings, CloudVerifyReport};

/// Summary of a verification.
pub(crate) fn summary(r: &CloudVerifyReport) -> String {
    let original =
        if r.of.breaklines.is_some() { "cloud, or anchor vertices of breaklines" } else { "cloud" };
    let (mut rows, off) = (vec![("points", points(&r.of))], verdict::off_vertices(r, original));
    rows.extend(
        r.of.keep_points.as_ref().map(|kept| ("kept", text::required_points(kept, "cloud"))),
    );
    rows.extend(r.of.breaklines.as_ref().map(|lines| {
        let vertices = text::count(r.of.on_breaklines);
        ("breaklines", format!("{}, {vertices} vertices on them", text::breaklines(lines, "cloud")))
    }));
    let unit = format!(" ({})", r.of.vertical_unit);
    verdict::summary(r, rows, off, &unit, text::rate(r.of.points_per_second, "points"))
}

fn points(r: &CloudProofFindings) -> String {
    let [covered, judged] = [r.covered_points, r.judged_points].map(text::count);
    let stacked = match r.stacked_points {
        0 => String::new(),
        n => format!("; {} stacked (same x and y)", text::count(n)),
    };
    format!("{covered} of {judged} covered{stacked}; read: {}", points::census(&r.points))
}
