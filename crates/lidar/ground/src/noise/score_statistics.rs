//! Sums of scores, and their mean and deviation.

/// Sums of up to 2^40 integers below 2^44, independent of their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScoreSums {
    count: u64,
    sum: u128,
    squares: u128,
}

impl ScoreSums {
    /// The largest score.
    pub(super) const MOST: u64 = (1 << 44) - 1;

    /// Adds a score.
    pub fn add(&mut self, score: u64) {
        self.count += 1;
        self.sum += u128::from(score);
        self.squares += u128::from(score) * u128::from(score);
    }

    /// Adds other sums.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// The mean and the standard deviation of a sample; zeros if there are too few scores.
    pub(super) fn mean_and_deviation(&self) -> [f64; 2] {
        let count = u128::from(self.count);
        if count < 2 {
            return [self.sum as f64, 0.0];
        }
        let (mean, rest) = (self.sum / count, self.sum % count);
        // Squares of differences from the whole mean: what is too large for 128 bits in between is so in the difference
        // alone, which is not.
        let twice = mean.wrapping_mul(self.sum).wrapping_mul(2);
        let mean_squares = mean.wrapping_mul(mean).wrapping_mul(count);
        let squares = self.squares.wrapping_sub(twice).wrapping_add(mean_squares);
        let (n, rest) = (self.count as f64, rest as f64);
        let variance = ((squares as f64 - rest * rest / n) / (n - 1.0)).max(0.0);
        [mean as f64 + rest / n, variance.sqrt()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_exact_however_large_the_mean() {
        for (far, n) in [(0, 3_u64), (1 << 30, 1000), (ScoreSums::MOST - 1000, 100_001)] {
            let scores = (0..n).map(|i| far + i * 7919 % 1000);
            let (mut sums, mut back, mut half) =
                (ScoreSums::default(), ScoreSums::default(), ScoreSums::default());
            scores.clone().for_each(|score| sums.add(score));
            scores.clone().rev().take(n as usize / 2).for_each(|score| half.add(score));
            scores.clone().rev().skip(n as usize / 2).for_each(|score| back.add(score));
            back.merge(&half);
            assert_eq!(sums, back);
            let mean = scores.clone().map(|s| (s - far) as f64).sum::<f64>() / n as f64;
            let squares = scores.map(|s| ((s - far) as f64 - mean).powi(2)).sum::<f64>();
            let [found, deviation] = sums.mean_and_deviation();
            assert!((found - far as f64 - mean).abs() < 1e-2, "{found}");
            let expected = (squares / (n - 1) as f64).sqrt();
            assert!((deviation / expected - 1.0).abs() < 1e-12, "{deviation} {expected}");
        }
        let mut one = ScoreSums::default();
        assert_eq!(one.mean_and_deviation(), [0.0; 2]);
        one.add(5);
        assert_eq!(one.mean_and_deviation(), [5.0, 0.0]);
    }
}
