//! Independent proof of simplified lines: distances, crossings, rings, sides and shared borders. Shares
//! no line with what simplifies them.
//!
//! Parts (lines and rings) are compared one by one with their originals ([`PartComparison`]): distances of removed
//! vertices, collapsed and turned rings. The stretches of the originals and the segments in their place
//! ([`LineProofPieces`]) are then judged together, one band of x after the other ([`judge`]): crossings, sides and
//! shared borders. No figure depends on the bands. Everything is decided from positions: vertices at the same x
//! and y are the same.

mod crossings;
mod exact;
mod gone;
mod matching;
mod measure;
mod parts;
mod pieces;
mod report;
mod shared;
mod sides;
#[cfg(test)]
mod tests;

use exact::Xy;
use terrane_base::error::{Error, Result};

pub use matching::PartVertices;
pub use measure::ProofDistance;
pub use parts::{DroppedParts, PartComparison};
pub use pieces::{LineProofPieces, XRange};
pub use report::{LineCheckReport, LineDefect, ProofFarthestVertex};

/// Lines and rings, flat.
#[derive(Clone, Copy, Debug)]
pub struct ProofLines<'a> {
    /// x, y and z of all vertices, part after part; z is 0 where there is none.
    pub points: &'a [[f64; 3]],
    /// Where each part begins, and at the end how many vertices there are.
    pub starts: &'a [usize],
    /// Which parts are rings; a ring ends with the vertex it begins with.
    pub closed: &'a [bool],
}

impl ProofLines<'_> {
    fn count(&self) -> usize {
        self.closed.len()
    }

    fn part(&self, part: usize) -> &[[f64; 3]] {
        &self.points[self.starts[part]..self.starts[part + 1]]
    }

    /// Whether a part ends at the x and y where it begins.
    fn is_closed(&self, part: usize) -> bool {
        let [first, last] = [self.part(part).first(), self.part(part).last()];
        first.map(|p| [p[0], p[1]]) == last.map(|p| [p[0], p[1]])
    }

    fn check(&self, name: &str) -> Result<()> {
        let n = self.points.len();
        if u32::try_from(n).is_err() {
            return Err(Error::limit("the number of vertices", n, u32::MAX).at(name));
        }
        let flat = self.starts.len() == self.closed.len() + 1
            && self.starts.first() == Some(&0)
            && self.starts.last() == Some(&n)
            && self.starts.windows(2).all(|pair| pair[0] <= pair[1]);
        if !flat {
            return Err(Error::usage("parts are not contiguous").at(name));
        }
        if let Some(at) = self.points.iter().position(|p| !p.iter().all(|v| v.abs() < 1e130)) {
            return Err(Error::bad_input("coordinate is not finite, or exceeds 1e130")
                .at(format!("{name}, vertex {at}")));
        }
        match (0..self.count()).find(|&part| self.closed[part] && !self.is_closed(part)) {
            Some(part) => Err(Error::bad_input("a ring does not end where it begins")
                .at(format!("{name}, part {part}"))),
            None => Ok(()),
        }
    }
}

/// Lines to be checked against their originals.
#[derive(Clone, Copy, Debug)]
pub struct LineQuestion<'a> {
    /// The lines before.
    pub original: ProofLines<'a>,
    /// The lines after: as many parts, in the same order, without vertices where one was dropped.
    pub simplified: ProofLines<'a>,
    /// Positions that must stay on their side of every part.
    pub points: &'a [[f64; 2]],
    /// How distances are measured.
    pub distance: ProofDistance,
    /// Largest allowed distance, in its units; `None` to measure only.
    pub tolerance: Option<f64>,
}

/// Checks simplified lines against their originals. Any part may have been dropped.
///
/// O(n log n) for n vertices, plus, for each piece, the positions in its box. About 20 bytes a vertex,
/// and some megabytes for a band.
///
/// # Errors
/// `Usage` when the two do not have the same number of parts, or rings in the same places; `BadInput`
/// for coordinates that are not finite and rings that do not close.
pub fn check(question: &LineQuestion<'_>) -> Result<LineCheckReport> {
    check_by(question, BAND_VERTICES)
}

/// Vertices of a band, about; it takes some hundred bytes for each.
pub const BAND_VERTICES: usize = 1 << 17;

fn check_by(question: &LineQuestion<'_>, band: usize) -> Result<LineCheckReport> {
    let (original, simplified) = (&question.original, &question.simplified);
    original.check("original")?;
    simplified.check("result")?;
    if original.closed != simplified.closed {
        return Err(Error::usage("the parts of the result are not those of the original"));
    }
    let mut report = LineCheckReport::default();
    let mut pieces = LineProofPieces::new(XRange::ALL);
    let LineQuestion { distance, tolerance, .. } = *question;
    let comparison = PartComparison { distance, tolerance, drops: DroppedParts::Any };
    for (part, &closed) in (0u32..).zip(original.closed) {
        let [before, after] =
            [original, simplified].map(|lines| PartVertices::of(lines.part(part as usize)));
        comparison.part(part, before, after, closed, &mut report, &mut pieces);
    }
    for band in pieces.bands(band) {
        report.add_band(&judge(&pieces, question.points, band));
    }
    Ok(report)
}

/// Judges the pieces in a band together, and `points` that must stay on their side. `pieces` covers at least
/// that band.
pub fn judge(pieces: &LineProofPieces, points: &[Xy], band: XRange) -> LineCheckReport {
    let mut report = LineCheckReport::default();
    crossings::count(pieces, band, &mut report);
    shared::count(pieces, band, &mut report);
    sides::moved(pieces, points, band, &mut report);
    report
}
