//! Exact conversion of world limits to steps of a lattice.

use super::decimal::Decimal;

/// The steps of a lattice along an axis: step n is at offset + scale * n. Scale and offset mean decimals, and a float
/// is that decimal or slightly off it (32690 * 0.01 is not 326.9). A limit equal to either value is at the step, any
/// other limit is between steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ruler {
    scale: f64,
    offset: f64,
    exact: Option<DecimalSteps>,
}

/// Scale and offset as whole numbers of the unit 10^-`digits`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct DecimalSteps {
    scale: i128,
    offset: i128,
    digits: u32,
}

/// Steps are clamped to this magnitude; no lattice is larger.
const FAR: i64 = 1 << 40;
/// Maximum error of the float estimate of a step.
const NEAR: i64 = 2;
/// Minimum fraction of a step between a step and other positions.
const HAIR: f64 = 1.0 / (1 << 20) as f64;

impl Ruler {
    /// From a positive scale and an offset, both finite.
    pub fn new(scale: f64, offset: f64) -> Self {
        Self { scale, offset, exact: DecimalSteps::new(scale, offset) }
    }

    /// The coordinate of a step, rounded once.
    pub fn at(&self, step: i64) -> f64 {
        match self.exact {
            Some(DecimalSteps { scale, offset, digits }) => {
                Decimal::new(scale * i128::from(step) + offset, digits).value()
            }
            None => self.in_floats(step),
        }
    }

    /// The coordinate as LAS readers compute it.
    fn in_floats(&self, step: i64) -> f64 {
        step as f64 * self.scale + self.offset
    }

    /// The lowest step at or above `limit`.
    pub fn first(&self, limit: f64) -> i64 {
        self.partition(limit, |step| self.at(step).max(self.in_floats(step)) < limit)
    }

    /// The highest step at or below `limit`.
    pub fn last(&self, limit: f64) -> i64 {
        self.partition(limit, |step| self.at(step).min(self.in_floats(step)) <= limit) - 1
    }

    /// Position of a coordinate in steps: an integer at a step and only there.
    pub fn place(&self, world: f64) -> f64 {
        let (first, last) = (self.first(world), self.last(world));
        let steps = (world - self.offset) / self.scale;
        match first {
            _ if first.abs() >= FAR => steps,
            _ if first <= last => first as f64,
            _ => steps.clamp(last as f64 + HAIR, first as f64 - HAIR),
        }
    }

    /// The lowest step that is not `below`; the search starts near `limit`.
    fn partition(&self, limit: f64, below: impl Fn(i64) -> bool) -> i64 {
        let guess = ((limit - self.offset) / self.scale) as i64;
        let guess = guess.clamp(-FAR, FAR);
        let (mut low, mut high) = (guess - NEAR, guess + NEAR);
        // The quotient is off by more than NEAR where the offset is far larger than the scale; then the
        // search takes the whole range.
        if !below(low) || below(high) {
            (low, high) = (-FAR, FAR);
        }
        while low < high {
            let middle = low + (high - low).div_euclid(2);
            match below(middle) {
                true => low = middle + 1,
                false => high = middle,
            }
        }
        low
    }
}

impl DecimalSteps {
    fn new(scale: f64, offset: f64) -> Option<Self> {
        let (scale, offset) = (Decimal::of(scale)?, Decimal::of(offset)?);
        let digits = scale.digits().max(offset.digits());
        let (scale, offset) = (scale.units(digits)?, offset.units(digits)?);
        // No step that the search may ask for overflows in `at`.
        scale.checked_mul(i128::from(2 * FAR))?.checked_add(offset.checked_abs()?)?;
        Some(Self { scale, offset, digits })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Scales and offsets as they occur, and odd ones.
    fn rulers() -> Vec<Ruler> {
        let scales = [1.0, 0.01, 0.001, 0.1, 0.25, 1e-7, 0.0254, 0.3, 1.0 / 3.0, 1e-20];
        let offsets = [0.0, 500_000.0, -4_750_000.5, 1.1, 0.005, 1e15, 123.456_789_01];
        let with = |scale| offsets.map(|offset| Ruler::new(scale, offset));
        scales.into_iter().flat_map(with).collect()
    }

    #[test]
    fn the_step_that_people_write() {
        let ruler = Ruler::new(0.01, 0.0);
        assert_ne!(32_690.0 * 0.01, 326.9);
        assert_eq!((ruler.first(326.9), ruler.last(326.9)), (32_690, 32_690));
        let read = 32_690.0 * 0.01;
        assert_eq!((ruler.first(read), ruler.last(read)), (32_690, 32_690));
        assert_eq!((ruler.first(326.900_001), ruler.last(326.900_001)), (32_691, 32_690));
        assert_eq!((ruler.place(326.9), ruler.place(0.0)), (32_690.0, 0.0));
        let between = ruler.place(326.900_000_000_1);
        assert!((32_690.0 + HAIR..32_690.1).contains(&between));
        let below = ruler.place(326.899_999_999_9);
        assert!(32_689.9 < below && below <= 32_690.0 - HAIR);
    }

    #[test]
    fn decimals_too_long_for_all_steps_are_not_counted() {
        let ruler = Ruler::new(1.1, 1e-27);
        assert_eq!(ruler.at(FAR), 1.1 * FAR as f64);
        assert_eq!((ruler.first(11.0), ruler.last(11.0)), (10, 10));
    }

    #[test]
    fn limits_without_end_hold_all_and_others_far_off_nothing() {
        for ruler in rulers() {
            assert_eq!(ruler.first(f64::NEG_INFINITY), -FAR);
            assert_eq!(ruler.last(f64::INFINITY), FAR - 1);
            assert_eq!((ruler.first(1e300), ruler.last(-1e300)), (FAR, -FAR - 1));
        }
    }

    proptest! {
        #[test]
        fn steps_are_found_by_their_decimals_and_by_their_floats(
            which in 0_usize..70, step in -2_000_000_000_i64..2_000_000_000,
        ) {
            let ruler = rulers()[which];
            for limit in [ruler.at(step), ruler.in_floats(step)] {
                prop_assert!(ruler.first(limit) <= step && step <= ruler.last(limit));
            }
            let naive = ruler.exact.map(|DecimalSteps { scale, offset, digits }| {
                format!("{}e-{digits}", scale * i128::from(step) + offset).parse().unwrap()
            });
            prop_assert_eq!(naive.unwrap_or(ruler.in_floats(step)), ruler.at(step));
        }

        #[test]
        fn other_limits_lie_between_steps(which in 0_usize..70, limit in -1e9_f64..1e9) {
            let ruler = rulers()[which];
            let (first, last) = (ruler.first(limit), ruler.last(limit));
            prop_assert!(first <= last + 1);
            prop_assert!(first == -FAR || ruler.at(first - 1) < limit);
            prop_assert!(last >= FAR - 1 || ruler.at(last + 1) > limit);
            let steps = (limit - ruler.offset) / ruler.scale;
            prop_assert!((ruler.place(limit) - steps).abs() <= 1e-5 + 1e-15 * steps.abs());
        }
    }
}
