//! The smallest tolerance whose mesh fits a budget of vertices or triangles.
//!
//! Counts come from complete runs that write nothing, so they are exact, and the last run writes what its trial
//! counted. Between trials the logarithm of the count is taken to be linear in the logarithm of the tolerance;
//! vertices that no tolerance removes (the outlines of voids) are subtracted from the count once they are
//! known. The first guess comes from a sample of the grid, and is corrected by the count of the first trial.
//! Trials end when the tolerance is known to [`WIDTH`], when the count is within [`SLACK`] below the budget,
//! and after [`MAX_TRIALS`].

use terrane_base::error::{Error, Result};

/// The tolerance found is at most this factor above one that does not fit, if trials last.
const WIDTH: f64 = 1.002;
/// A count this close below the budget (as a fraction of it) is close enough.
const SLACK: f64 = 0.002;
/// Trials after which the best one is taken: each is a run of its own.
pub(super) const MAX_TRIALS: u32 = 6;
/// Trials beyond the budget after which the coarsest mesh is tried.
const PATIENCE: u32 = 4;
/// Largest step, as a factor, while only one side of the bracket is known.
const MAX_STEP: f64 = 16.0;
/// Counts fall with the tolerance at least this much, in logarithms.
const MIN_SLOPE: f64 = 0.02;
/// A tolerance that keeps only mandatory vertices.
const COARSEST: f64 = 1e30;
/// A tolerance this small against the first guess is replaced by 0.
const TINY: f64 = 1e-9;

/// A tolerance and the size of its mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ToleranceTrial {
    pub(super) tolerance: f64,
    pub(super) count: u64,
}

/// Finds the tolerance for at most `budget`; returns it with the number of trials. `known` is a trial with a
/// tolerance of 0, if there is one. `guess` estimates the tolerance, better with a trial; `count` is the exact
/// count at a tolerance. Fails with `Usage`, with the least count, if not even the coarsest mesh fits.
pub(super) fn search(
    budget: u64,
    known: Option<ToleranceTrial>,
    mut guess: impl FnMut(Option<ToleranceTrial>) -> Result<f64>,
    mut count: impl FnMut(f64) -> Result<u64>,
) -> Result<(f64, u32)> {
    let spent = known.is_some().into();
    let mut search =
        ToleranceSearch { budget, guess: guess(known)?, spent, trials: Vec::new(), same_side: 0 };
    while let Some(tolerance) = search.next() {
        let trial = ToleranceTrial { tolerance, count: count(tolerance)? };
        search.note(trial);
        let min_count = search.min_count();
        if min_count > budget {
            return Err(too_small(budget, min_count));
        }
        if search.trials.len() == 1 && !search.is_close() {
            search.guess = guess(Some(trial))?;
        }
    }
    let fits = search.fits().map_or(COARSEST, |trial| trial.tolerance);
    Ok((fits, search.spent + search.trials.len() as u32))
}

fn too_small(budget: u64, min_count: u64) -> Error {
    Error::usage(format!("a budget of {budget} is below the coarsest mesh of this grid"))
        .remedy(format!("allow at least {min_count}"))
}

/// State of the search.
struct ToleranceSearch {
    budget: u64,
    guess: f64,
    spent: u32,
    trials: Vec<ToleranceTrial>,
    /// Trials in a row that have moved the side of the bracket that is beyond the budget.
    same_side: u32,
}

impl ToleranceSearch {
    /// The next tolerance to try; `None` when the search is over.
    fn next(&self) -> Option<f64> {
        let left = MAX_TRIALS - self.spent - self.trials.len() as u32;
        let (over, fits) = (self.over(), self.fits());
        if left == 0 || self.is_close() {
            return None;
        }
        if fits.is_none() && (left == 1 || self.trials.len() as u32 == PATIENCE) {
            return Some(COARSEST);
        }
        match (over, fits) {
            (Some(over), Some(fits)) if fits.tolerance < COARSEST => self.between(over, fits),
            (over, fits) => Some(self.beyond(over, fits)),
        }
    }

    /// True when no other tolerance would be much better.
    fn is_close(&self) -> bool {
        let target = self.budget as f64 * (1.0 - SLACK);
        self.fits().is_some_and(|fits| fits.tolerance == 0.0 || fits.count as f64 >= target)
    }

    fn note(&mut self, trial: ToleranceTrial) {
        let moves = self.over().is_some_and(|over| trial.tolerance > over.tolerance);
        let is_over = trial.count > self.budget;
        self.same_side = if is_over && moves { self.same_side + 1 } else { 0 };
        self.trials.push(trial);
    }

    /// The largest tolerance known not to fit.
    fn over(&self) -> Option<ToleranceTrial> {
        let over = self.trials.iter().filter(|trial| trial.count > self.budget);
        over.copied().max_by(|a, b| a.tolerance.total_cmp(&b.tolerance))
    }

    /// The smallest known to fit.
    fn fits(&self) -> Option<ToleranceTrial> {
        let fits = self.trials.iter().filter(|trial| trial.count <= self.budget);
        fits.copied().min_by(|a, b| a.tolerance.total_cmp(&b.tolerance))
    }

    /// The count of the coarsest mesh; 0 while it is not known.
    fn min_count(&self) -> u64 {
        let coarsest = self.trials.iter().find(|trial| trial.tolerance == COARSEST);
        coarsest.map_or(0, |trial| trial.count)
    }

    /// The logarithms of a tolerance and of its count above the least one.
    fn place(&self, trial: ToleranceTrial) -> [f64; 2] {
        [trial.tolerance.ln(), self.height(trial.count as f64)]
    }

    fn height(&self, count: f64) -> f64 {
        (count - self.min_count() as f64).max(1.0).ln()
    }

    /// Signed distance of a count from the target.
    fn miss(&self, count: f64) -> f64 {
        self.height(count) - self.height(self.budget as f64 * (1.0 - SLACK / 2.0))
    }

    /// Distance of a trial from the target.
    fn distance(&self, trial: ToleranceTrial) -> f64 {
        self.miss(trial.count as f64).abs()
    }

    /// The logarithm of the tolerance that a line through the two trials gives, followed from the first.
    fn followed(&self, near: ToleranceTrial, other: ToleranceTrial) -> f64 {
        let ([x, y], [other_x, other_y]) = (self.place(near), self.place(other));
        let slope = ((y - other_y) / (other_x - x)).max(MIN_SLOPE);
        x + self.miss(near.count as f64) / slope
    }

    /// True when the guess is clearly on the side of a trial where the budget must be.
    fn leads_on(&self, trial: ToleranceTrial) -> bool {
        if trial.count > self.budget {
            self.guess > trial.tolerance * WIDTH
        } else {
            self.guess < trial.tolerance / WIDTH
        }
    }

    /// A tolerance beyond all trials on one side, where the other is not known.
    fn beyond(&self, over: Option<ToleranceTrial>, fits: Option<ToleranceTrial>) -> f64 {
        let usual =
            self.trials.iter().filter(|trial| trial.tolerance > 0.0 && trial.tolerance < COARSEST);
        let mut known: Vec<ToleranceTrial> = usual.copied().collect();
        known.sort_by(|a, b| self.distance(*a).total_cmp(&self.distance(*b)));
        let target = match known[..] {
            [] => return round_up(self.guess),
            [only] if self.leads_on(only) => return round_up(self.guess),
            // The count is taken to go with 1 / tolerance.
            [only] => only.tolerance.ln() + self.miss(only.count as f64),
            [near, other, ..] => self.followed(near, other),
        };
        // Each trial on the same side goes further, so that a curve with jumps is left behind.
        let (step, nudge) = (MAX_STEP.ln(), WIDTH.ln());
        let push = nudge.max(0.25 * (known.len() as f64 - 1.0).powi(2));
        let from = known[0].tolerance.ln();
        let next = match (over, fits) {
            (Some(over), _) => target.min(from + step).max(over.tolerance.ln() + push),
            (_, Some(fits)) => target.max(from - step).min(fits.tolerance.ln() - nudge),
            _ => target,
        };
        let next = next.exp();
        if next < self.guess * TINY { 0.0 } else { round_up(next) }
    }

    /// A tolerance between two trials: on the line through them, or towards the middle where that was
    /// beyond the budget before, so that a curve with jumps (integer heights) cannot hold the search up.
    fn between(&self, over: ToleranceTrial, fits: ToleranceTrial) -> Option<f64> {
        if over.tolerance == 0.0 || fits.tolerance <= over.tolerance * WIDTH {
            return None;
        }
        let [low, high] = [over, fits].map(|trial| trial.tolerance.ln());
        let is_over_nearer = self.distance(over) < self.distance(fits);
        let [near, other] = if is_over_nearer { [over, fits] } else { [fits, over] };
        let share = ((self.followed(near, other) - low) / (high - low)).clamp(0.03, 0.97);
        let first = if self.same_side > 1 { f64::midpoint(share, 0.5) } else { share };
        // Close to the one that fits, rounding up may give that one again: then the middle.
        let mut steps =
            [first, 0.5].into_iter().map(|share| round_up((low + (high - low) * share).exp()));
        steps.find(|&next| next < fits.tolerance)
    }
}

/// Rounds up to four digits, so that the tolerance found is short to print.
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
    use proptest::prelude::*;
    use terrane_base::error::ErrorKind;

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
        fn what_is_found_fits_after_six_trials_at_most(
            budget in 10_u64..2_000_000, guess in 1e-3..1e3, slope in 0.5..2.5,
            quantum in prop_oneof![Just(0.0), 0.01..2.0], least in prop_oneof![Just(0_u64), 0..900_000_u64]
        ) {
            let count = |tolerance| least + curve(tolerance, quantum, slope);
            let mut counted = 0;
            let found = search(budget, None, |_| Ok(guess), |t| {
                counted += 1;
                Ok(count(t))
            });
            prop_assert!(counted <= MAX_TRIALS, "{} trials", counted);
            match found {
                Ok((tolerance, trials)) => {
                    prop_assert!(count(tolerance) <= budget);
                    prop_assert_eq!(trials, counted);
                }
                Err(_) => prop_assert!(count(COARSEST) > budget),
            }
        }

        #[test]
        fn from_a_fair_guess_the_budget_is_nearly_used_whatever_the_voids(
            exact in 0.02..50.0, off in -0.7..0.7_f64, slope in 0.7..2.5, least in 0_u64..900_000
        ) {
            let count = |tolerance| least + curve(tolerance, 0.0, slope);
            let budget = count(exact);
            let guess = exact * off.exp();
            let (tolerance, _) = search(budget, None, |_| Ok(guess), |t| Ok(count(t))).unwrap();
            let used = count(tolerance) as f64 / budget as f64;
            prop_assert!((0.85..=1.0).contains(&used), "{}", used);
        }

        /// A sample that is off by a factor says nothing where it has less at any tolerance than the
        /// budget, and says all once it is compared with a trial.
        #[test]
        fn a_sample_that_is_off_leads_to_the_budget(
            exact in 0.02..50.0, off in 0.5..2.0, slope in 0.7..2.5, whole: bool
        ) {
            let count = |tolerance| curve(tolerance, 0.0, slope);
            let budget = count(exact);
            let guess = |trial: Option<ToleranceTrial>| {
                let factor = trial.map_or(1.0, |trial| {
                    off * count(trial.tolerance) as f64 / trial.count as f64
                });
                let wanted = budget as f64 * factor;
                let fits = |t: &f64| off * count(*t) as f64 <= wanted;
                Ok((0..1400).map(|i| 1e-4 * 1.01_f64.powi(i)).find(fits).unwrap_or(1e6))
            };
            let known = whole.then(|| ToleranceTrial { tolerance: 0.0, count: count(0.0) });
            let (tolerance, trials) = search(budget, known, guess, |t| Ok(count(t))).unwrap();
            let used = count(tolerance) as f64 / budget as f64;
            prop_assert!((0.99..=1.0).contains(&used), "{}", used);
            prop_assert!(trials <= MAX_TRIALS);
        }
    }

    #[test]
    fn few_trials_suffice_from_a_fair_guess() {
        let (_, trials) = search(10_000, None, |_| Ok(30.0), |t| Ok(curve(t, 0.0, 1.2))).unwrap();
        assert!(trials <= 5, "{trials}");
    }

    #[test]
    fn too_small_a_budget_tells_the_least_count() {
        let error = search(3, None, |_| Ok(1.0), |t| Ok(curve(t, 0.0, 1.0))).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains("allow at least 4"));
    }
}
