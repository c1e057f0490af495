//! Longitudinal profile of a river: monotonic downwards, never above a bank.

use std::collections::BTreeMap;

/// Lowest bank height by station, for stations with banks.
pub(super) type Stations = BTreeMap<u32, f64>;

/// Levels along a line: linear between knots, constant before the first and after the last.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RiverProfile {
    /// Stations (ascending) and levels (descending).
    knots: Vec<(f64, f64)>,
}

impl RiverProfile {
    /// Profile downwards from `above` (infinite if unknown), with a knot at each station with banks lower
    /// than all before. A knot is at the start of its station, so that the whole station is below the bank.
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
        // Banks of the first station take precedence over the level upstream.
        if knots.len() > 1 && knots[1].0 == 0.0 {
            knots.remove(0);
        }
        Self { knots }
    }

    /// True if the level is unknown.
    pub(super) fn is_unknown(&self) -> bool {
        self.knots.is_empty()
    }

    /// The level at `along` stations from the start; infinite if unknown.
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

/// True if banks rise along a line: all banks of the last third are above the median of the first third.
/// False for less than nine stations.
pub(super) fn rises(stations: &Stations) -> bool {
    let third = stations.len() / 3;
    if third < 3 {
        return false;
    }
    let mut first: Vec<f64> = stations.values().take(third).copied().collect();
    first.sort_unstable_by(f64::total_cmp);
    stations.values().rev().take(third).all(|&lowest| lowest > first[third / 2])
}
