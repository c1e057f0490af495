//! Counts of triangulation.

use serde::{Deserialize, Serialize};

/// Counts of samples. Adding is commutative, so the order of work leaves no trace.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct SampleCounts {
    /// Valid samples.
    pub(super) valid: u64,
    /// Valid samples without a valid cell.
    pub(super) isolated: u64,
    /// Samples that look like undeclared nodata: the lowest such stored value, and their number.
    pub(super) suspects: Option<(f64, u64)>,
    /// The lowest and highest height of windows with heights outside the usual range of land.
    #[serde(default)]
    pub(super) odd_range: Option<[f64; 2]>,
    /// Samples to keep that are vertices. Known once the mesh is written, so it is not saved.
    #[serde(skip)]
    pub(super) kept: u64,
    /// Triangles with too small an angle; not saved either.
    #[serde(skip)]
    pub(super) thin: MeshFlaws,
    /// Vertices on breaklines without an edge along them; not saved either.
    #[serde(skip)]
    pub(super) apart: MeshFlaws,
}

/// Places where the mesh does not meet a requirement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshFlaws {
    /// Number of places.
    pub count: u64,
    /// Row and column of the first one.
    pub first: Option<[u32; 2]>,
}

impl MeshFlaws {
    /// Counts a place.
    pub(super) fn note(&mut self, row: u32, col: u32) {
        self.add(Self { count: 1, first: Some([row, col]) });
    }

    fn add(&mut self, other: Self) {
        self.count += other.count;
        self.first = self.first.into_iter().chain(other.first).min();
    }
}

impl SampleCounts {
    /// Adds another tally; of two suspected values the lower one counts.
    pub(super) fn add(&mut self, other: SampleCounts) {
        self.valid += other.valid;
        self.isolated += other.isolated;
        self.kept += other.kept;
        self.thin.add(other.thin);
        self.apart.add(other.apart);
        let ranges = self.odd_range.into_iter().chain(other.odd_range);
        self.odd_range = ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        self.suspects = match (self.suspects, other.suspects) {
            (Some((a, few)), Some((b, more))) if a == b => Some((a, few + more)),
            (Some(a), Some(b)) => Some(if a.0 < b.0 { a } else { b }),
            (a, b) => a.or(b),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_suspect_counts() {
        let mut all = SampleCounts::default();
        for suspects in
            [Some((-99.0, 5)), None, Some((-9999.0, 2)), Some((-9999.0, 1)), Some((-99.0, 7))]
        {
            let odd_range = suspects.map(|(low, count)| [low, count as f64]);
            let kept = 2;
            all.add(SampleCounts {
                valid: 10,
                isolated: 1,
                suspects,
                odd_range,
                kept,
                ..SampleCounts::default()
            });
        }
        let suspects = Some((-9999.0, 3));
        let odd_range = Some([-9999.0, 7.0]);
        let all_of_them =
            SampleCounts { valid: 50, isolated: 5, kept: 10, ..SampleCounts::default() };
        let expected = SampleCounts { suspects, odd_range, ..all_of_them };
        assert_eq!(all, expected);
    }

    #[test]
    fn of_flaws_the_first_is_told() {
        let mut thin = MeshFlaws::default();
        for (row, col) in [(4, 1), (2, 7), (2, 3), (9, 0)] {
            thin.note(row, col);
        }
        thin.add(MeshFlaws::default());
        assert_eq!(thin, MeshFlaws { count: 4, first: Some([2, 3]) });
    }
}
