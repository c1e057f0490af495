//! Findings of a proof of lines: their number and the first place of each.

use super::exact::Xy;

/// Number of occurrences of a defect, and its first place by part, x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineDefect {
    /// Number of occurrences.
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
        self.first = firsts.min_by(|(part, p), (other, q)| {
            part.cmp(other).then(p[0].total_cmp(&q[0])).then(p[1].total_cmp(&q[1]))
        });
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
    /// Parts with a vertex that the original part does not have, or has in another order, or without an end of
    /// the line. They are excluded from all checks but crossings.
    pub foreign: LineDefect,
    /// The largest distance, if any vertex was left out.
    pub farthest: Option<ProofFarthestVertex>,
    /// Vertices beyond the tolerance.
    pub beyond: LineDefect,
    /// Vertices whose height or measure is another one.
    pub changed: LineDefect,
    /// Lost parts that had to stay.
    pub missing: LineDefect,
    /// Rings without vertices, too large to decide whether they could be dropped.
    pub unknown: u64,
    /// Pairs of segments that meet off a common end, in the original.
    pub original_crossings: u64,
    /// The same in the result.
    pub crossings: u64,
    /// Pairs of the result that are not pairs of segments of the original.
    pub new_crossings: LineDefect,
    /// Rings without area that had some.
    pub collapsed: LineDefect,
    /// Lost parts in all.
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

    /// Adds the findings of [`judge`](super::judge) in a band.
    pub fn add_band(&mut self, band: &Self) {
        self.original_crossings += band.original_crossings;
        self.crossings += band.crossings;
        self.new_crossings.merge(band.new_crossings);
        self.moved.merge(band.moved);
        self.torn.merge(band.torn);
    }
}
