//! Summary of `terrane info --quality`: triangulation quality of a mesh.

use crate::cli::shared::text;
use terrane_verify::{
    AngleReport, AspectReport, DegreeReport, GridLocation, QualityReport, SlopeReport,
};

/// Measured values.
pub(crate) fn rows(quality: &QualityReport) -> Vec<(String, String)> {
    let mut rows = vec![
        ("edges", edges(quality)),
        ("Delaunay", delaunay(quality)),
        ("degrees", degrees(&quality.degrees)),
        ("angles", angles(&quality.smallest_angles)),
        ("largest angle", format!("{} degrees", text::height(quality.largest_angle))),
        ("aspect ratios", aspects(&quality.aspect_ratios)),
    ];
    rows.extend(quality.smallest_angles_in_space.iter().map(|a| ("angles in space", angles(a))));
    rows.extend(odd(quality).map(|odd| ("odd", odd)));
    if let Some(slope) = &quality.slope {
        rows.push(("slopes", slopes(slope)));
        rows.extend(slope.notes.iter().map(|note| ("note", note.clone())));
    }
    rows.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

fn edges(q: &QualityReport) -> String {
    let [all, inside, border] = [q.edges, q.interior_edges, q.border_edges].map(text::count);
    let [shortest, longest] = [q.shortest_edge, q.longest_edge].map(text::height);
    let sum = text::number(q.edge_length_sum);
    format!(
        "{all}: {inside} inner, {border} on the border; length {shortest} to {longest}, total {sum}"
    )
}

fn delaunay(q: &QualityReport) -> String {
    let Some(share) = q.delaunay_share else { return "no inner edges".to_owned() };
    let [cocircular, not] =
        [q.cocircular_edges, q.interior_edges - q.delaunay_edges].map(text::count);
    let share = percent(share);
    format!(
        "{share} of inner edges in x and y, {cocircular} of them cocircular; {not} not Delaunay"
    )
}

fn degrees(d: &DegreeReport) -> String {
    let [min, max] = [d.min, d.max].map(|n| n.map_or("-".to_owned(), text::count));
    format!("{min} to {max} edges per vertex, mean {}", text::height(d.mean))
}

fn angles(a: &AngleReport) -> String {
    let [min, one, five, half] =
        [a.min, a.percentile_1, a.percentile_5, a.median].map(text::height);
    let below = a.below.iter().map(|b| format!("{}: {}", text::number(b.angle), percent(b.share)));
    let below: Vec<String> = below.collect();
    format!(
        "smallest per triangle: minimum {min} degrees, 1st percentile {one}, 5th {five}, median {half}; \
         below {}",
        below.join(", ")
    )
}

fn aspects(a: &AspectReport) -> String {
    format!("mean {}, maximum {}", text::height(a.mean), text::height(a.max))
}

/// Defects of a surface.
fn odd(q: &QualityReport) -> Option<String> {
    let counts = [
        (q.broken_triangles, "triangles with an unusable vertex"),
        (q.empty_triangles, "triangles without area"),
        (q.inverted_triangles, "clockwise triangles"),
        (q.folded_edges, "folded edges"),
        (q.non_manifold_edges, "non-manifold edges"),
    ];
    let defects = counts.into_iter().filter(|(count, _)| *count > 0);
    let defects = defects.map(|(count, what)| format!("{} {what}", text::count(count)));
    let defects: Vec<String> = defects.collect();
    (!defects.is_empty()).then(|| defects.join(", "))
}

fn slopes(s: &SlopeReport) -> String {
    let place = s.max_at.map_or(String::new(), |GridLocation { column, row, x, y }| {
        format!(" at column {column}, row {row} (x {x}, y {y})")
    });
    let [rms, max] = [s.rms, s.max].map(text::height);
    let missing = match s.uncovered_cells {
        0 => String::new(),
        n => format!("; {} cells not covered", text::count(n)),
    };
    let cells = text::count(s.cells);
    format!("RMS error {rms} degrees over {cells} cells, maximum {max}{place}{missing}")
}

/// Rounded to a hundredth, but never to 100 % or 0 % unless exact.
fn percent(share: f64) -> String {
    let hundredths = (share * 10_000.0).round();
    match hundredths {
        _ if share == 1.0 => "100 %".to_owned(),
        10_000.0 => "over 99.99 %".to_owned(),
        0.0 if share > 0.0 => "under 0.01 %".to_owned(),
        _ => format!("{} %", text::number(hundredths / 100.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_never_rounded_to_all_or_nothing() {
        let known = [
            (0.0, "0 %"),
            (1e-9, "under 0.01 %"),
            (0.012_34, "1.23 %"),
            (0.999_999, "over 99.99 %"),
            (1.0, "100 %"),
        ];
        known.into_iter().for_each(|(share, told)| assert_eq!(percent(share), told));
    }
}
