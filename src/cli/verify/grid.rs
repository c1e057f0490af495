//! Summary of verified meshes of grids.

use crate::cli::shared::text;
use crate::cli::verify::verdict;
use terrane_base::bound::ErrorBound;
use terrane_verify::{BandProof, OfGrid, VerifyReport};

/// Summary of a verification.
pub(crate) fn summary(r: &VerifyReport) -> String {
    let mut rows: Vec<_> = r.of.bands.iter().map(|proof| ("band", band(proof))).collect();
    rows.extend(r.of.bands.is_empty().then(|| ("surface", surface(r))));
    rows.push(("samples", samples(&r.of)));
    rows.extend(
        r.of.keep_points.as_ref().map(|kept| ("kept", text::required_points(kept, "grid"))),
    );
    rows.extend(r.of.breaklines.as_ref().map(|lines| {
        let vertices = text::count(r.of.on_breaklines);
        ("breaklines", format!("{}, {vertices} vertices on them", text::breaklines(lines, "grid")))
    }));
    let off = verdict::off_vertices(r, "grid");
    verdict::summary(r, rows, off, "", text::rate(r.of.samples_per_second, "samples"))
}

/// Error in a band.
fn band(r: &BandProof) -> String {
    let max = r.max_error.map_or("-".to_owned(), text::bound);
    let over = text::count(r.over);
    let allowed = r.tolerance.map_or(String::new(), |e| {
        format!(", {} allowed, {over} samples above it", text::number(e))
    });
    let rmse = r.rmse.map_or(String::new(), |e| format!("; RMSE {}", text::number(e)));
    format!("{} (weight {}): at most {max}{allowed}{rmse}", r.band, text::number(r.weight))
}

/// Error on the lines between samples.
fn surface(r: &VerifyReport) -> String {
    let [over, breaks] = [r.of.over_between_samples.count, r.of.breaks].map(text::count);
    let judged = match (r.of.bound, r.tolerance) {
        (ErrorBound::Samples, _) => "; not promised by this mesh",
        (ErrorBound::Surface, None) => "; not judged",
        (ErrorBound::Surface, Some(_)) => "",
    };
    let max = r.of.surface_error.map_or("-".to_owned(), text::bound);
    let over = r.tolerance.map_or(String::new(), |_| format!(", {over} above the bound"));
    format!("error at most {max}, {breaks} breaks between samples{over}{judged}")
}

fn samples(r: &OfGrid) -> String {
    let mut line =
        format!("{} of {} covered", text::count(r.covered_samples), text::count(r.surface_samples));
    if r.isolated_samples > 0 {
        line += &format!("; {} isolated (no surface)", text::count(r.isolated_samples));
    }
    line
}
