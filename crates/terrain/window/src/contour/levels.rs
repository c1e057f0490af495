//! Contour levels, and the rank of a sample among them.

use terrane_base::error::{Error, Result};

/// The rank of a void.
pub(super) const VOID: i32 = i32::MIN;

/// Ranks are below this in magnitude.
const MAX_RANK: f64 = (1 << 30) as f64;

/// Largest magnitude of a height.
const MAX_HEIGHT: f64 = 1e30;

/// A number whose addition rounds others below 2^31 to whole ones, which are then its lowest bits.
const ROUNDING: f64 = 1.5 * (1_u64 << 52) as f64;

/// The heights of contour lines, numbered upwards.
#[derive(Clone, Debug, PartialEq)]
pub struct ContourLevels(LevelRule);

#[derive(Clone, Debug, PartialEq)]
enum LevelRule {
    /// Level k is at `(base + k * step) / scale`; `base` and `step` are whole where a scale of a
    /// power of ten makes them so, so that levels are decimal numbers rounded once.
    Every { base: f64, step: f64, scale: f64 },
    /// Level k is the k-th, counted from 1.
    List(Vec<f64>),
}

impl ContourLevels {
    /// All whole multiples of `interval`, counted from `base`.
    ///
    /// # Errors
    /// `Usage` when the interval is not finite and above 0, or the base is not finite or more than
    /// 2^30 intervals from 0.
    pub fn every(interval: f64, base: f64) -> Result<Self> {
        if !(interval > 0.0 && interval.is_finite() && (1.0 / interval).is_finite()) {
            return Err(Error::usage(format!("the contour interval {interval} is out of range"))
                .remedy("pass a number above 0"));
        }
        let steps = base.abs() / interval;
        if steps.is_nan() || steps >= MAX_RANK {
            return Err(Error::usage(format!(
                "a base of {base} is too far from 0 for an interval of {interval}"
            ))
            .remedy("pass a base between 0 and the interval: the levels are the same"));
        }
        let decimal = (0..9).map(|digits| 10_f64.powi(digits)).find_map(|scale| {
            let (base, step) = (scaled_integer(base, scale)?, scaled_integer(interval, scale)?);
            Some(LevelRule::Every { base, step, scale })
        });
        Ok(Self(decimal.unwrap_or(LevelRule::Every { base, step: interval, scale: 1.0 })))
    }

    /// These levels, in any order.
    ///
    /// # Errors
    /// `Usage` for none, or one that is not finite.
    pub fn list(mut levels: Vec<f64>) -> Result<Self> {
        if levels.is_empty() || !levels.iter().all(|level| level.is_finite()) {
            return Err(Error::usage("the contour levels are empty or not finite")
                .remedy("pass heights, such as 10,50,100"));
        }
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        Ok(Self(LevelRule::List(levels)))
    }

    /// The height of a level.
    #[inline]
    pub fn height(&self, level: i32) -> f64 {
        match &self.0 {
            LevelRule::Every { base, step, scale } => (base + f64::from(level) * step) / scale,
            LevelRule::List(levels) => levels[level as usize - 1],
        }
    }

    /// The rank of a height: the number of the highest level that it is above. `None` for NaN, and for a height
    /// that [`trace`](super::trace) refuses.
    pub fn rank_of(&self, height: f64) -> Option<i32> {
        let mut rank = [VOID];
        let is_ranked = self.fill(&[height], &mut rank);
        Some(rank[0]).filter(|&rank| is_ranked && rank != VOID)
    }

    /// The lower and the upper end of the band of the heights with a rank; `None` below the first and above the
    /// last level of a list.
    pub fn band(&self, rank: i32) -> [Option<f64>; 2] {
        [rank, rank + 1].map(|level| match &self.0 {
            LevelRule::Every { .. } => Some(self.height(level)),
            LevelRule::List(levels) => {
                usize::try_from(level - 1).ok().and_then(|at| levels.get(at)).copied()
            }
        })
    }

    /// The rank of each height: the number of the highest level that it is above (equal to, or
    /// higher); [`VOID`] for NaN. `Err` with the place of a height that has none.
    pub(super) fn rank<H: Copy + Into<f64>>(
        &self,
        heights: &[H],
        ranks: &mut [i32],
    ) -> std::result::Result<(), usize> {
        if self.fill(heights, ranks) {
            return Ok(());
        }
        let unranked = heights.iter().position(|z| !self.fill(std::slice::from_ref(z), &mut [0]));
        Err(unranked.unwrap_or_default())
    }

    /// False where a height has no rank.
    fn fill<H: Copy + Into<f64>>(&self, heights: &[H], ranks: &mut [i32]) -> bool {
        match &self.0 {
            // A division by 1 takes as long as any.
            &LevelRule::Every { base, step, scale: 1.0 } => {
                rank_by_step(base, step, |height| height, |z| z, heights, ranks)
            }
            &LevelRule::Every { base, step, scale } => {
                rank_by_step(base, step, |height| height / scale, |z| z * scale, heights, ranks)
            }
            LevelRule::List(levels) => rank_by_list(levels, heights, ranks),
        }
    }
}

/// A value times a power of ten, if that is an integer and no digit is lost.
fn scaled_integer(value: f64, scale: f64) -> Option<f64> {
    let scaled = (value * scale).round();
    (scaled / scale == value && scaled.abs() < 1e9).then_some(scaled)
}

/// False where a height has no rank. One step, without a branch, for each sample: the nearest whole
/// number of intervals is the rank, or one above it.
#[inline(always)]
fn rank_by_step<H: Copy + Into<f64>>(
    base: f64,
    step: f64,
    unscaled: impl Fn(f64) -> f64,
    scaled: impl Fn(f64) -> f64,
    heights: &[H],
    ranks: &mut [i32],
) -> bool {
    let inverse = 1.0 / step;
    let mut sound = true;
    for (&z, rank) in heights.iter().zip(ranks) {
        let z: f64 = z.into();
        let steps = (scaled(z) - base) * inverse;
        let rounded = steps + ROUNDING;
        let nearest = rounded - ROUNDING;
        // The product above is a guess. What decides is the height of the level, computed as for lines.
        let below = i32::from(unscaled(base + nearest * step) > z);
        let found = rounded.to_bits() as i32 - below;
        *rank = if z.is_nan() { VOID } else { found };
        sound &= z.is_nan() | ((steps.abs() < MAX_RANK) & (z.abs() <= MAX_HEIGHT));
    }
    sound
}

/// Neighbours have nearly the same rank: the search starts from that of the sample before.
fn rank_by_list<H: Copy + Into<f64>>(levels: &[f64], heights: &[H], ranks: &mut [i32]) -> bool {
    let mut last = 0;
    let mut sound = true;
    for (&z, rank) in heights.iter().zip(ranks) {
        let z: f64 = z.into();
        if z.is_nan() {
            *rank = VOID;
            continue;
        }
        sound &= z.abs() <= MAX_HEIGHT;
        while last < levels.len() && levels[last] <= z {
            last += 1;
        }
        while last > 0 && levels[last - 1] > z {
            last -= 1;
        }
        *rank = last as i32;
    }
    sound
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rank(levels: &ContourLevels, z: f64) -> Option<i32> {
        let mut ranks = [0];
        levels.rank(&[z], &mut ranks).ok()?;
        Some(ranks[0])
    }

    proptest! {
        #[test]
        fn a_rank_is_the_highest_level_reached(
            interval in prop_oneof![Just(0.1), Just(0.3), Just(20.0), Just(2.5), 0.001..1000.0],
            base in prop_oneof![Just(0.0), Just(0.7), -50.0..50.0],
            k in -100_000..100_000,
            off in -3_i32..=3,
        ) {
            let levels = ContourLevels::every(interval, base).unwrap();
            let mut z = levels.height(k);
            for _ in 0..off.abs() {
                z = if off > 0 { z.next_up() } else { z.next_down() };
            }
            let found = rank(&levels, z).unwrap();
            prop_assert_eq!(found, if off < 0 { k - 1 } else { k });
            prop_assert!(levels.height(found) <= z && z < levels.height(found + 1));
        }

        #[test]
        fn lists_are_ranked_as_by_counting(
            list in prop::collection::vec(-9..9_i32, 1..8),
            heights in prop::collection::vec(-10..10_i32, 1..20),
        ) {
            let list: Vec<f64> = list.iter().map(|&v| v.into()).collect();
            let levels = ContourLevels::list(list.clone()).unwrap();
            let mut distinct = list;
            distinct.sort_by(f64::total_cmp);
            distinct.dedup();
            let mut ranks = vec![0; heights.len()];
            let heights: Vec<f32> = heights.iter().map(|&z| z as f32).collect();
            levels.rank(&heights, &mut ranks).unwrap();
            for (&z, &found) in heights.iter().zip(&ranks) {
                let count = distinct.iter().filter(|level| **level <= f64::from(z)).count();
                prop_assert_eq!(found, count as i32);
            }
            prop_assert!((0..distinct.len()).all(|k| levels.height(k as i32 + 1) == distinct[k]));
        }
    }

    #[test]
    fn levels_are_round_numbers() {
        let heights = |interval, base| {
            let levels = ContourLevels::every(interval, base).unwrap();
            [1, 3, 7].map(|k| levels.height(k))
        };
        assert_eq!(heights(0.1, 0.0), [0.1, 0.3, 0.7]);
        assert_eq!(heights(0.3, 0.05), [0.35, 0.95, 2.15]);
        assert_eq!(heights(20.0, 0.0), [20.0, 60.0, 140.0]);
        assert_eq!(heights(1.0 / 3.0, 0.0), [1.0 / 3.0, 1.0, 7.0 * (1.0 / 3.0)]);
    }

    #[test]
    fn nonsense_is_refused() {
        for interval in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-320] {
            assert!(ContourLevels::every(interval, 0.0).is_err(), "{interval}");
        }
        for base in [f64::NAN, f64::INFINITY, 1e12] {
            assert!(ContourLevels::every(1.0, base).is_err(), "{base}");
        }
        assert!(
            ContourLevels::list(vec![]).is_err() && ContourLevels::list(vec![f64::NAN]).is_err()
        );
        let levels = ContourLevels::every(1.0, 0.0).unwrap();
        assert_eq!(rank(&levels, f64::NAN), Some(VOID));
        assert_eq!(rank(&levels, 1e10), None);
        assert_eq!(levels.rank(&[1.0, f64::NAN, 2e9], &mut [0; 3]), Err(2));
        for (interval, base) in [(0.001, 1e7), (1.0, MAX_RANK), (0.1, 1e9)] {
            assert!(ContourLevels::every(interval, base).is_err(), "{base} by {interval}");
        }
        assert!(
            ContourLevels::every(1000.0, 1e12).is_ok()
                && ContourLevels::every(1.0, MAX_RANK - 1.0).is_ok()
        );
        let list = ContourLevels::list(vec![1.0]).unwrap();
        assert_eq!((rank(&list, 1e10), rank(&list, -1e31)), (Some(1), None));
    }
    /// Ranks end at 2^30 either way, whatever the interval, the base and the digits after the point.
    #[test]
    fn the_first_height_without_a_rank_is_told() {
        let most = (1_i32 << 30) - 1;
        for (interval, base) in [(1.0, 0.0), (4.0, -8.0), (0.5, 0.0), (0.25, 2.5), (0.1, 0.7)] {
            let levels = ContourLevels::every(interval, base).unwrap();
            for (k, sign) in [(most, 1), (-most, -1)] {
                let (last, beyond) = (levels.height(k), levels.height(k + sign));
                assert_eq!(rank(&levels, last), Some(k), "{interval} {base}");
                assert_eq!(levels.rank(&[last, f64::NAN, beyond, beyond], &mut [0; 4]), Err(2));
            }
        }
        for levels in
            [ContourLevels::every(1e25, 0.0).unwrap(), ContourLevels::list(vec![0.0]).unwrap()]
        {
            let [z, beyond] = [MAX_HEIGHT, MAX_HEIGHT.next_up()];
            assert_eq!(levels.rank(&[z, -z, z, -beyond], &mut [0; 4]), Err(3));
            assert_eq!(levels.rank(&[z, beyond], &mut [0; 2]), Err(1));
        }
    }
}
