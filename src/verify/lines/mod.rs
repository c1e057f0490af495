//! Independent proof of simplified lines: distances, crossings, rings, sides and shared borders. Shares
//! no line with what simplifies them.
//!
//! Parts (lines and rings) are compared one by one with those they were made from. Everything is
//! decided from positions: vertices at the same x and y are the same.

mod matching;
mod measure;
mod positions;
mod shared;
mod sides;
mod sweep;
#[cfg(test)]
mod tests;

use crate::error::{Error, Result};

pub use measure::Distance;
use positions::Positions;

/// Lines and rings, flat.
#[derive(Clone, Copy, Debug)]
pub struct Lines<'a> {
    /// x, y and z of all vertices, part after part; z is 0 where there is none.
    pub points: &'a [[f64; 3]],
    /// Where each part begins, and at the end how many vertices there are.
    pub starts: &'a [usize],
    /// Which parts are rings; a ring ends with the vertex it begins with.
    pub closed: &'a [bool],
}

impl Lines<'_> {
    fn count(&self) -> usize {
        self.closed.len()
    }

    fn range(&self, part: usize) -> std::ops::Range<usize> {
        self.starts[part]..self.starts[part + 1]
    }

    fn at(&self, vertex: usize) -> [f64; 2] {
        [self.points[vertex][0], self.points[vertex][1]]
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
            return Err(Error::usage("parts do not begin where the ones before them end").at(name));
        }
        let sound = |v: &f64| v.abs() < 1e130;
        if let Some(at) = self.points.iter().position(|p| !p.iter().all(sound)) {
            return Err(Error::bad_input("a coordinate is not finite, or too large")
                .at(format!("{name}, vertex {at}")));
        }
        let open = |&part: &usize| {
            let range = self.range(part);
            self.closed[part] && !range.is_empty() && self.at(range.start) != self.at(range.end - 1)
        };
        match (0..self.count()).find(open) {
            Some(part) => Err(Error::bad_input("a ring does not end where it begins")
                .at(format!("{name}, part {part}"))),
            None => Ok(()),
        }
    }
}

/// What is to be checked.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The lines before.
    pub original: Lines<'a>,
    /// The lines after: as many parts, in the same order, without vertices where one was dropped.
    pub simplified: Lines<'a>,
    /// Positions that were to stay on their side of every part.
    pub points: &'a [[f64; 2]],
    /// How distances are measured.
    pub distance: Distance,
    /// Largest allowed distance, in its units; `None` to measure only.
    pub tolerance: Option<f64>,
}

/// How often something was found, and where first: part, x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Defect {
    /// How often.
    pub count: u64,
    /// The part and position of the first one.
    pub first: Option<(usize, [f64; 2])>,
}

impl Defect {
    fn add(&mut self, part: usize, at: [f64; 2]) {
        self.count += 1;
        self.first.get_or_insert((part, at));
    }
}

/// The vertex that is farthest from the segment in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Farthest {
    /// Its distance.
    pub distance: f64,
    /// Its part.
    pub part: usize,
    /// Where it is.
    pub at: [f64; 2],
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Parts with vertices.
    pub parts: u64,
    /// Vertices before and after.
    pub vertices: [u64; 2],
    /// Parts with a vertex that the original part does not have, or not in that order, or without an
    /// end of the line. They take no part in what follows but crossings.
    pub foreign: Defect,
    /// The largest distance, if any vertex was left out.
    pub farthest: Option<Farthest>,
    /// Vertices beyond the tolerance.
    pub beyond: Defect,
    /// Pairs of segments that meet off a common end, in the original.
    pub original_crossings: u64,
    /// And in the result.
    pub crossings: u64,
    /// Those of the result that are not pairs of segments of the original.
    pub new_crossings: Defect,
    /// Rings without area that had some.
    pub collapsed: Defect,
    /// Parts without vertices that had some.
    pub dropped: u64,
    /// Rings whose area has changed its sign.
    pub turned: Defect,
    /// Vertices of the result, and given points, that are on another side of a part, once for each
    /// such part; the part named is the one they have moved across.
    pub moved: Defect,
    /// Segments in more parts, or fewer, than some segment of the original that they replace: borders
    /// torn apart, or run together.
    pub torn: Defect,
}

impl Report {
    /// Whether nothing is wrong. Parts that were dropped are what somebody asked for.
    pub fn is_sound(&self) -> bool {
        let defects = [
            self.foreign,
            self.beyond,
            self.new_crossings,
            self.collapsed,
            self.turned,
            self.moved,
            self.torn,
        ];
        defects.iter().all(|defect| defect.count == 0)
    }
}

/// Checks simplified lines against their originals.
///
/// O(n log n) for n vertices, plus, for each vertex of the result, the segments that share a strip of
/// x with it. About 150 bytes a vertex.
///
/// # Errors
/// `Usage` when the two do not have the same number of parts, or rings in the same places; `BadInput`
/// for coordinates that are not finite and rings that do not close.
pub fn check(question: &Question<'_>) -> Result<Report> {
    let (original, simplified) = (&question.original, &question.simplified);
    original.check("original")?;
    simplified.check("result")?;
    if original.closed != simplified.closed {
        return Err(Error::usage("the parts of the result are not those of the original"));
    }
    let mut report = Report::default();
    count(question, &mut report);
    let positions = Positions::new(original);
    let ids = [original, simplified].map(|lines| positions.ids(lines));
    let pieces = matching::pieces(question, &ids, &mut report);
    sweep::crossings(question, &ids, &mut report);
    shared::check(question, &ids, &pieces, &mut report);
    sides::rings(question, &mut report);
    sides::moved(question, &mut report);
    Ok(report)
}

fn count(question: &Question<'_>, report: &mut Report) {
    report.vertices =
        [question.original, question.simplified].map(|lines| lines.points.len() as u64);
    for part in 0..question.original.count() {
        let [before, after] =
            [question.original, question.simplified].map(|lines| lines.range(part).is_empty());
        report.parts += u64::from(!after);
        report.dropped += u64::from(after && !before);
    }
}
