//! Summary of a verification of any kind.

use crate::cli::shared::report::{self, Row};
use crate::cli::shared::{VerbOutcome, output, text};
use terrane_base::frontend::Frontend;
use terrane_engine::proof::ProofVerdict;
use terrane_verify::{MeshOriginal, MeshReport};

/// Prints failures and unjudged checks on stderr, in quiet mode.
pub(crate) fn print(verdict: &ProofVerdict) {
    verdict
        .failures
        .iter()
        .for_each(|failure| output::failure(&Frontend::CommandLine.spell(failure)));
    verdict.not_judged.iter().for_each(|what| output::not_judged(what));
}

/// Whether all guarantees hold.
pub(crate) fn outcome(verdict: &ProofVerdict) -> VerbOutcome {
    VerbOutcome::of(verdict.passed, verdict.judged)
}

/// The verdict in words.
pub(super) fn in_words(verdict: &ProofVerdict) -> String {
    match (verdict.passed, verdict.not_judged.as_slice()) {
        (true, []) => "verified: every promise is kept".to_owned(),
        (true, not) => format!("no failure found, but not judged: {}", not.join("; ")),
        (false, _) => "NOT verified".to_owned(),
    }
}

/// Summary of a verified mesh: verdict, failures, and figures. `own` are rows of the original, `off` is a row
/// about vertices that are not in the original; `unit` is that of errors, and `rate` the speed of the
/// verification.
pub(super) fn summary<O: MeshOriginal>(
    r: &MeshReport<O>,
    own: Vec<Row>,
    off: Row,
    unit: &str,
    rate: String,
) -> String {
    let failures: String = r.verdict.failures.iter().map(|f| format!("  - {f}\n")).collect();
    let sizes =
        format!("{} vertices, {} triangles", text::count(r.vertices), text::count(r.triangles));
    let mut rows = vec![("error", errors(r) + unit)];
    rows.extend(own);
    rows.extend([("mesh", sizes), off, ("edges", edges(r)), ("angles", angles(r))]);
    rows.extend(
        r.source.as_ref().map(|name| ("source", format!("{name} (from the header, not judged)"))),
    );
    rows.extend(report::took(&r.run, Some(rate), ""));
    format!("{}\n{failures}{}", in_words(&r.verdict), text::table(&rows))
}

fn errors<O: MeshOriginal>(r: &MeshReport<O>) -> String {
    let max = r.max_error.map_or("-".to_owned(), text::bound);
    let allowed = match r.tolerance {
        Some(tolerance) => format!("at most {max}, {} allowed", text::number(tolerance)),
        None => format!("at most {max}; not judged (pass --max-error)"),
    };
    let [rmse, mean] = [r.rmse, r.mean_error].map(text::height);
    format!("{allowed}; measured: RMSE {rmse}, mean {mean}")
}

/// Smallest angle of a mesh; a guaranteed angle is judged separately.
fn angles<O: MeshOriginal>(r: &MeshReport<O>) -> String {
    match r.smallest_angle {
        Some(angle) => format!("at least {} degrees {} (measured)", text::number(angle), O::PLANE),
        None => "none".to_owned(),
    }
}

/// Summary of vertices that are not points of the original: a failure only for meshes of terrane.
pub(super) fn off_vertices<O: MeshOriginal>(r: &MeshReport<O>, of: &str) -> Row {
    let (source, off) = (O::POINTS, r.of.off_vertices().count);
    let vertices = match (text::count(off), r.made_by_terrane) {
        _ if off == 0 && r.of.is_fitted() => {
            format!("all lie at {source} of the {of}, heights fitted")
        }
        _ if off == 0 => format!("all are {source} of the {of}"),
        (off, _) if r.of.may_be_off() => {
            format!("{off} off the {source} (anchor vertices of missing breaklines)")
        }
        (off, true) => format!("{off} off the {source}"),
        (off, false) => {
            format!("{off} off the {source} (not a failure: not written by terrane)")
        }
    };
    ("vertices", vertices)
}

/// Summary of edges: the Delaunay property is judged only if the mesh guarantees it.
fn edges<O: MeshOriginal>(r: &MeshReport<O>) -> String {
    let [inner, outer] = [r.interior_edges, r.open_edges].map(text::count);
    let delaunay = match r.non_delaunay_edges.count {
        0 => format!("all Delaunay {}", O::PLANE),
        count => format!("{} not Delaunay {}", text::count(count), O::PLANE),
    };
    let promise = if r.delaunay { "" } else { " (not promised by this mesh)" };
    format!("{inner} inner, {delaunay}{promise}; {outer} on the outline")
}
