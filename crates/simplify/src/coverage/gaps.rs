//! Distances between segment ends that meet, to detect borders that almost match.

use std::collections::BTreeMap;

use terrane_line::Xy;

/// Ends closer than this share of the shorter segment are considered identical.
const NEAR: f64 = 1e-3;
/// Smallest number of such pairs.
const FEWEST: u64 = 10;

fn length([a, b]: [Xy; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Pairs of segments that meet, and those with almost identical ends.
#[derive(Clone, Debug, Default)]
pub(super) struct MeetingGaps {
    all: u64,
    /// Count by the power of ten above the distance of the ends.
    near: BTreeMap<i32, u64>,
}

impl MeetingGaps {
    /// Adds a pair.
    pub(super) fn add(&mut self, [s, t]: [[Xy; 2]; 2]) {
        let gaps = s.iter().flat_map(|p| t.map(|q| length([*p, q]))).filter(|gap| *gap > 0.0);
        let gap = gaps.fold(f64::INFINITY, f64::min);
        self.all += 1;
        if gap < NEAR * length(s).min(length(t)) {
            *self.near.entry(gap.log10().floor() as i32 + 1).or_default() += 1;
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.all += other.all;
        let near = other.near.iter();
        near.for_each(|(power, count)| *self.near.entry(*power).or_default() += count);
    }

    /// Note for mostly close pairs, with a snap distance that merges almost all of their ends.
    pub(super) fn note(&self) -> Option<String> {
        let all: u64 = self.near.values().sum();
        let mut sum = 0;
        let power = self.near.iter().find(|(_, count)| {
            sum += **count;
            sum * 20 >= all * 19
        });
        let (power, _) = power.filter(|_| all >= FEWEST && all * 2 >= self.all)?;
        Some(format!(
            "borders almost match: {sum} pairs of segments that cross, touch or overlap have ends within \
             1e{power} and keep their vertices; try ‹snap› 1e{power}"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_to_try_is_above_nearly_all_gaps() {
        let mut gaps = MeetingGaps::default();
        let pair = |gap: f64| [[[0.0, 0.0], [10.0, 0.0]], [[gap, 0.0], [10.0, 5.0]]];
        (0..9).for_each(|_| gaps.add(pair(3e-7)));
        assert_eq!(gaps.note(), None, "too few");
        (0..20).for_each(|_| gaps.add(pair(2e-9)));
        gaps.add(pair(2.0));
        let mut all = gaps.clone();
        assert!(all.note().unwrap().ends_with("try ‹snap› 1e-6"));
        (0..400).for_each(|_| gaps.add(pair(2e-9)));
        all.merge(&gaps);
        assert!(all.note().unwrap().ends_with("try ‹snap› 1e-8"), "{:?}", all.note());
        (0..500).for_each(|_| all.add(pair(2.0)));
        assert_eq!(all.note(), None, "most are crossings as such");
    }
}
