//! Levels along a line: down only, and nowhere above a bank.

use std::collections::BTreeMap;

/// The lowest bank at each station that has any.
pub(super) type Stations = BTreeMap<u32, f64>;

/// The level along a line: straight between knots, constant before the first and after the last.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RiverProfile {
    /// Stations and levels: the ones rise, the others fall.
    knots: Vec<(f64, f64)>,
}

impl RiverProfile {
    /// Down from `above` (infinite where it is not known), with a knot wherever banks are lower than any before.
    /// A knot is where its station begins, so that all of the station is as low.
    pub(super) fn new(above: f64, stations: &Stations) -> Self {
        let mut knots = Vec::new();
        if above.is_finite() {
            knots.push((0.0, above));
        }
        for (&station, &lowest) in stations {
            if knots.last().is_none_or(|&(_, level)| lowest < level) {
                knots.push((f64::from(station), lowest));
            }
        }
        // The banks of the first station tell more than what is above.
        if knots.len() > 1 && knots[1].0 == 0.0 {
            knots.remove(0);
        }
        Self { knots }
    }

    /// True when nothing tells of a level.
    pub(super) fn is_unknown(&self) -> bool {
        self.knots.is_empty()
    }

    /// The level `along` stations from the beginning on, infinite where nothing tells of one.
    pub(super) fn at(&self, along: f64) -> f64 {
        let next = self.knots.partition_point(|&(station, _)| station <= along);
        let before = next.checked_sub(1).map(|last| self.knots[last]);
        match (before, self.knots.get(next)) {
            (None, None) => f64::INFINITY,
            (Some((_, level)), None) | (None, Some(&(_, level))) => level,
            (Some((from, high)), Some(&(to, low))) => {
                let share = (along - from) / (to - from);
                (high - share * (high - low)).clamp(low, high)
            }
        }
    }
}

/// True where banks rise along a line: those of the last third are all above the middle one of the first third.
/// Of less than nine stations nothing is said.
pub(super) fn rises(stations: &Stations) -> bool {
    let third = stations.len() / 3;
    if third < 3 {
        return false;
    }
    let mut first: Vec<f64> = stations.values().take(third).copied().collect();
    first.sort_unstable_by(f64::total_cmp);
    stations.values().rev().take(third).all(|&lowest| lowest > first[third / 2])
}
