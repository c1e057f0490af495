//! Findings of a proof of lines: their number and the first place of each.

use super::exact::Xy;

/// How often something was found, and where first: the part, and x and y in it, that are least.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineDefect {
    /// How often.
    pub count: u64,
    /// The part and position of the first one.
    pub first: Option<(u32, Xy)>,
}

impl LineDefect {
    pub(super) fn add(&mut self, part: u32, at: Xy) {
        self.merge(Self { count: 1, first: Some((part, at)) });
    }

    pub(super) fn merge(&mut self, other: Self) {
        self.count += other.count;
        let firsts = [self.first, other.first].into_iter().flatten();
        let by_place = |p: &(u32, Xy), q: &(u32, Xy)| {
            let places = p.1[0].total_cmp(&q.1[0]).then(p.1[1].total_cmp(&q.1[1]));
            p.0.cmp(&q.0).then(places)
        };
        self.first = firsts.min_by(by_place);
    }
}

/// The vertex that is farthest from the segment in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProofFarthestVertex {
    /// Its distance.
    pub distance: f64,
    /// Its part.
    pub part: u32,
    /// Where it is.
    pub at: [f64; 2],
}

/// Report of the checks of simplified lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LineCheckReport {
    /// Parts with vertices.
    pub parts: u64,
    /// Vertices before and after.
    pub vertices: [u64; 2],
    /// Parts with a vertex that the original part does not have, or not in that order, or without an
    /// end of the line. They take no part in what follows but crossings.
    pub foreign: LineDefect,
    /// The largest distance, if any vertex was left out.
    pub farthest: Option<ProofFarthestVertex>,
    /// Vertices beyond the tolerance.
    pub beyond: LineDefect,
    /// Vertices whose height or measure is another one.
    pub changed: LineDefect,
    /// Parts without vertices that had some, and had to stay.
    pub missing: LineDefect,
    /// Rings without vertices that are too large to tell whether they could go.
    pub unknown: u64,
    /// Pairs of segments that meet off a common end, in the original.
    pub original_crossings: u64,
    /// And in the result.
    pub crossings: u64,
    /// Those of the result that are not pairs of segments of the original.
    pub new_crossings: LineDefect,
    /// Rings without area that had some.
    pub collapsed: LineDefect,
    /// Parts without vertices that had some, those that had to stay among them.
    pub dropped: u64,
    /// Rings with a changed sign of their area.
    pub turned: LineDefect,
    /// Vertices of the result, and given points, that are on another side of a part, once for each
    /// position and such part; the part named is the one they have moved across.
    pub moved: LineDefect,
    /// Segments of the original that parts shared and different segments replace, and segments of the
    /// result that replace different stretches of it: borders torn apart, or run together.
    pub torn: LineDefect,
}

impl LineCheckReport {
    /// Whether nothing is wrong.
    pub fn is_sound(&self) -> bool {
        let defects = [
            self.foreign,
            self.beyond,
            self.changed,
            self.missing,
            self.new_crossings,
            self.collapsed,
            self.turned,
            self.moved,
            self.torn,
        ];
        defects.iter().all(|defect| defect.count == 0)
    }

    /// Adds what [`judge`](super::judge) found in a band.
    pub fn add_band(&mut self, band: &Self) {
        self.original_crossings += band.original_crossings;
        self.crossings += band.crossings;
        self.new_crossings.merge(band.new_crossings);
        self.moved.merge(band.moved);
        self.torn.merge(band.torn);
    }
}
