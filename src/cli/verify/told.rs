//! What is told of a proof, whatever it is of.

use crate::cli::shared::{say, text};

/// Names the broken promises on stderr, and those not judged, for those who asked for no result.
pub(crate) fn tell(failures: &[String], not_judged: &[String]) {
    failures.iter().for_each(|failure| say::failure(failure));
    not_judged.iter().for_each(|what| say::not_judged(what));
}

/// What came of a proof.
pub(crate) fn verdict(passed: bool, not_judged: &[String]) -> String {
    match (passed, not_judged) {
        (true, []) => "verified: every promise is kept".to_owned(),
        (true, not) => format!("nothing wrong is found, but not judged: {}", not.join("; ")),
        (false, _) => "NOT verified".to_owned(),
    }
}

/// The smallest angle of a mesh.
pub(crate) fn angles(smallest: Option<f64>) -> String {
    smallest.map_or("none".to_owned(), |a| format!("{} degrees at the least", text::number(a)))
}

/// What is told of vertices that are not `source`: a failure only where terrane made them.
pub(crate) fn vertices(off: u64, made_by_terrane: bool, [source, of]: [&str; 2]) -> String {
    match (text::count(off), made_by_terrane) {
        _ if off == 0 => format!("all are {source} of the {of}"),
        (off, true) => format!("{off} off the {source}"),
        (off, false) => {
            format!("{off} off the {source}; no failure, because terrane did not write this mesh")
        }
    }
}

/// What is told of edges.
pub(crate) fn edges(inner: u64, open: u64, non_delaunay: u64) -> String {
    let [inner, outer, delaunay] = [inner, open, non_delaunay].map(text::count);
    format!("{inner} inside, {delaunay} of them not Delaunay; {outer} on the outline")
}
