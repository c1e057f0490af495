//! The smallest tolerance whose mesh fits a budget of vertices or triangles.
//!
//! Counts come from complete runs that write nothing, so they are exact, and the last run writes
//! what its trial counted. Between trials the logarithm of the count is taken to be linear in the
//! logarithm of the tolerance. Trials end when the tolerance is known to [`WIDTH`] or the count is
//! within [`SLACK`] below the budget.

use crate::error::{Error, Result};

/// The tolerance found is at most this factor above one that does not fit.
const WIDTH: f64 = 1.005;
/// A count this close below the budget (as a fraction of it) is close enough.
const SLACK: f64 = 0.002;
/// Trials after which the best one so far is taken.
const MOST_TRIALS: u32 = 30;
/// Trials beyond the budget after which the coarsest mesh is tried.
const PATIENCE: u32 = 2;
/// Largest step, as a factor, while only one side of the bracket is known.
const MOST_STEP: f64 = 16.0;
/// A tolerance that keeps nothing that need not be kept.
const COARSEST: f64 = 1e30;
/// A tolerance this small against the first guess is replaced by 0.
const TINY: f64 = 1e-9;

/// A tolerance and what its mesh counts.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Trial {
    tolerance: f64,
    count: u64,
}

/// Finds the tolerance for at most `budget`, starting from `guess`; returns it with the number of
/// trials. `count` tells the exact count at a tolerance. Fails with `Usage`, telling the least
/// count, when not even the coarsest mesh fits.
pub(super) fn search(
    budget: u64,
    guess: f64,
    mut count: impl FnMut(f64) -> Result<u64>,
) -> Result<(f64, u32)> {
    let mut search = Search::new(budget, guess);
    while let Some(tolerance) = search.next() {
        search.note(Trial { tolerance, count: count(tolerance)? });
        if search.trials == PATIENCE && search.fits.is_none() {
            let least = count(COARSEST)?;
            search.trials += 1;
            if least > budget {
                return Err(too_small(budget, least));
            }
        }
    }
    let fits = search.fits.unwrap_or(Trial { tolerance: COARSEST, count: 0 });
    Ok((fits.tolerance, search.trials))
}

fn too_small(budget: u64, least: u64) -> Error {
    Error::usage(format!("no mesh of this grid is as small as {budget}"))
        .remedy(format!("the coarsest one has {least}: allow at least that"))
}

/// What is known so far.
struct Search {
    budget: u64,
    guess: f64,
    /// The largest tolerance known not to fit, and
    over: Option<Trial>,
    /// the smallest known to fit above it.
    fits: Option<Trial>,
    trials: u32,
}

impl Search {
    fn new(budget: u64, guess: f64) -> Self {
        Self { budget, guess, over: None, fits: None, trials: 0 }
    }

    /// The next tolerance to try; `None` when the search is over.
    fn next(&self) -> Option<f64> {
        let next = match (self.over, self.fits) {
            (None, None) => self.guess,
            (Some(over), None) => over.tolerance * self.step(over),
            (None, Some(fits)) if self.is_close(fits) => return None,
            (None, Some(fits)) => self.below(fits.tolerance / self.step(fits)),
            (Some(over), Some(fits)) => self.between(over, fits)?,
        };
        Some(round_up(next))
    }

    fn note(&mut self, trial: Trial) {
        self.trials += 1;
        let is_new = |known: Option<Trial>, is_better: fn(f64, f64) -> bool| {
            known.is_none_or(|known| is_better(trial.tolerance, known.tolerance))
        };
        if trial.count > self.budget {
            if is_new(self.over, |new, old| new > old) {
                self.over = Some(trial);
            }
        } else if is_new(self.fits, |new, old| new < old) {
            self.fits = Some(trial);
        }
    }

    /// The factor by which the tolerance should change when only `trial` is known: the count is
    /// taken to go with 1 / tolerance, and a little more each time is added to get past the budget.
    fn step(&self, trial: Trial) -> f64 {
        let (count, budget) = (trial.count.max(1) as f64, self.budget.max(1) as f64);
        let beyond = 1.05 * 1.5_f64.powi(self.trials.min(30) as i32 - 1);
        ((count / budget).max(budget / count) * 1.05).max(beyond).min(MOST_STEP)
    }

    fn below(&self, tolerance: f64) -> f64 {
        if tolerance < self.guess * TINY { 0.0 } else { tolerance }
    }

    fn is_close(&self, fits: Trial) -> bool {
        fits.tolerance == 0.0 || fits.count as f64 >= self.budget as f64 * (1.0 - SLACK)
    }

    /// A tolerance between two trials, by the secant; later every third time the middle, so that a
    /// curve with jumps (integer heights) cannot hold the search up.
    fn between(&self, over: Trial, fits: Trial) -> Option<f64> {
        let narrow = fits.tolerance <= over.tolerance * WIDTH;
        if narrow || over.tolerance == 0.0 || self.is_close(fits) || self.trials >= MOST_TRIALS {
            return None;
        }
        let [low, high] = [over, fits].map(|trial| trial.tolerance.ln());
        let [most, least] = [over, fits].map(|trial| (trial.count.max(1) as f64).ln());
        let wanted = (self.budget as f64 * (1.0 - SLACK / 2.0)).ln();
        let secant = (most - wanted) / (most - least);
        let first = if self.trials > 6 && self.trials % 3 == 2 { 0.5 } else { secant };
        // Close to the one that fits, rounding up may give that one again: then the middle.
        let at = |share: f64| (low + (high - low) * share.clamp(0.05, 0.95)).exp();
        [first, 0.5].map(at).into_iter().find(|&next| round_up(next) < fits.tolerance)
    }
}

/// Rounds up to four digits, so that the tolerance found is one that can be said.
fn round_up(tolerance: f64) -> f64 {
    if tolerance == 0.0 || !tolerance.is_finite() {
        return tolerance;
    }
    let unit = tolerance.log10().floor() as i32 - 3;
    let scaled = tolerance * 10_f64.powi(-unit);
    let digits = (scaled - scaled * f64::EPSILON * 4.0).ceil();
    format!("{digits}e{unit}").parse().unwrap_or(tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;
    use proptest::prelude::*;

    #[test]
    fn rounding_goes_up_and_is_short() {
        assert_eq!(round_up(1.2341), 1.235);
        assert_eq!(round_up(1.234), 1.234);
        assert_eq!(round_up(0.00012341), 0.0001235);
        assert_eq!(round_up(99_999.0), 100_000.0);
        assert_eq!(round_up(0.0), 0.0);
    }

    /// A curve with jumps: heights are multiples of `quantum`.
    fn curve(tolerance: f64, quantum: f64, slope: f64) -> u64 {
        let seen = if quantum > 0.0 { (tolerance / quantum).floor() * quantum } else { tolerance };
        (1e6 / (1.0 + seen * 10.0).powf(slope)) as u64 + 4
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn the_tolerance_found_fits_and_little_less_does_not(
            budget in 10_u64..2_000_000, guess in 1e-3..1e3, quantum in prop_oneof![Just(0.0), 0.01..2.0],
            slope in 0.5..2.5
        ) {
            let count = |tolerance| curve(tolerance, quantum, slope);
            let (tolerance, trials) = search(budget, guess, |t| Ok(count(t))).unwrap();
            prop_assert!(count(tolerance) <= budget);
            prop_assert!(trials <= MOST_TRIALS, "{}", trials);
            let near = count(tolerance) as f64 >= budget as f64 * (1.0 - SLACK);
            prop_assert!(near || tolerance == 0.0 || count(tolerance / 1.0051) > budget);
        }
    }

    #[test]
    fn few_trials_suffice_from_a_fair_guess() {
        let (_, trials) = search(10_000, 30.0, |t| Ok(curve(t, 0.0, 1.2))).unwrap();
        assert!(trials <= 5, "{trials}");
    }

    #[test]
    fn too_small_a_budget_tells_the_least_count() {
        let error = search(3, 1.0, |t| Ok(curve(t, 0.0, 1.0))).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains("the coarsest one has 4"));
    }
}
