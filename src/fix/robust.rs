//! Means of seconds whose noise has heavy tails.
//!
//! Some gyros are quiet in most seconds and far off in a few. Student's t with three degrees of freedom describes such seconds; its likelihood
//! weighs a second at u scales from the centre with w = 4/(3 + u²) (Lange, Little and Taylor, J. Am. Stat. Assoc. 84, 1989, p. 881). To an
//! observation's rate x belongs the value
//!
//! z = c + w (x − c)/m, m the mean of dψ/du, ψ = w u:
//!
//! the mean of these values is the robust centre c, and their scatter is that of the centre times the root of their number, whatever the true
//! distribution is (Huber, Robust Statistics, 1981, section 6.3). So they go through the same sums as the rates, and slope, autocorrelation and
//! variance follow as they do for a plain mean.
//!
//! Sway is no such noise: it cancels in the plain mean only where all of it is kept. What a mean makes of noise that cancels is seen in the
//! means of blocks of some seconds, which are kept for both.

use libm::{log, sqrt};

/// Degrees of freedom of Student's t.
const DEGREES_OF_FREEDOM: f64 = 3.0;
/// Steps from median and median deviation to centre and scale: the error shrinks by more than a half in each.
const STEPS: usize = 12;
/// Fewest rows whose tails can be told.
pub(super) const LEAST_ROWS: usize = 8;
/// Least mean derivative: Gaussian noise has 0.63 and Student's t 2/3; with half of that the values would scatter twice as far.
const LEAST_DERIVATIVE: f64 = 0.33;
/// Length of a block, seconds: some six in a dwell of half a minute.
const BLOCK_S: f64 = 5.0;

/// Centre and scale of rows by Student's t.
pub(super) struct Tails {
    centre_deg_h: f64,
    /// Of a one-second rate.
    scale_deg_h: f64,
    /// Mean of dψ/du.
    derivative: f64,
    /// Logarithm of the likelihood of Student's t over that of a normal distribution, each at its best.
    pub evidence: f64,
}

/// ln Γ(2) − ln Γ(3/2) − ln(3π)/2, of Student's t with three degrees of freedom, and −(1 + ln 2π)/2, of the normal distribution.
const LOG_OF_T: f64 = -1.000_888_849_623_509_5;
const LOG_OF_NORMAL: f64 = -1.418_938_533_204_672_7;

impl Tails {
    /// From lengths and rates of rows, their median and their median absolute deviation. `None` of too few rows, of rows that repeat
    /// themselves, and where the centre is not determined.
    pub fn fit<I>(rows: impl Fn() -> I, median_deg_h: f64, deviation_deg_h: f64) -> Option<Self>
    where
        I: Iterator<Item = (f64, f64)>,
    {
        let count = rows().count();
        if count < LEAST_ROWS || deviation_deg_h <= 0.0 {
            return None;
        }
        let count = count as f64;
        let (mut centre_deg_h, mut scale_deg_h) = (median_deg_h, deviation_deg_h);
        for _ in 0..STEPS {
            let (mut weights, mut sum, mut squares) = (0.0, 0.0, 0.0);
            for (seconds, rate_deg_h) in rows() {
                let off = rate_deg_h - centre_deg_h;
                let weight = seconds * weight(seconds * off * off / (scale_deg_h * scale_deg_h));
                weights += weight;
                sum += weight * off;
                squares += weight * off * off;
            }
            centre_deg_h += sum / weights;
            scale_deg_h = sqrt(squares / count);
        }
        let squared = |seconds: f64, rate_deg_h: f64| {
            let off = (rate_deg_h - centre_deg_h) / scale_deg_h;
            seconds * off * off
        };
        let evidence = count * (LOG_OF_T - LOG_OF_NORMAL + log(sigma(&rows, count) / scale_deg_h))
            - rows().map(|(seconds, rate_deg_h)| 2.0 * log(1.0 + squared(seconds, rate_deg_h) / 3.0)).sum::<f64>();
        let slopes = rows().map(|(seconds, rate_deg_h)| {
            let squared = squared(seconds, rate_deg_h);
            weight(squared) * (DEGREES_OF_FREEDOM - squared) / (DEGREES_OF_FREEDOM + squared)
        });
        let derivative = slopes.sum::<f64>() / count;
        let tails = Self { centre_deg_h, scale_deg_h, derivative, evidence };
        (derivative > LEAST_DERIVATIVE && scale_deg_h > 0.0).then_some(tails)
    }

    /// The value that stands for the rate of a row.
    pub fn value(&self, seconds: f64, rate_deg_h: f64) -> f64 {
        let off = rate_deg_h - self.centre_deg_h;
        let squared = seconds * off * off / (self.scale_deg_h * self.scale_deg_h);
        self.centre_deg_h + weight(squared) * off / self.derivative
    }
}

/// Standard deviation of a one-second rate about the mean of the rows.
fn sigma<I: Iterator<Item = (f64, f64)>>(rows: &impl Fn() -> I, count: f64) -> f64 {
    let seconds: f64 = rows().map(|(seconds, _)| seconds).sum();
    let mean = rows().map(|(seconds, rate_deg_h)| seconds * rate_deg_h).sum::<f64>() / seconds;
    sqrt(rows().map(|(seconds, rate_deg_h)| seconds * (rate_deg_h - mean) * (rate_deg_h - mean)).sum::<f64>() / count)
}

/// Weight of a row at the root of `squared` scales from the centre.
fn weight(squared: f64) -> f64 {
    (DEGREES_OF_FREEDOM + 1.0) / (DEGREES_OF_FREEDOM + squared)
}

/// How the means of neighbouring blocks differ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Blocks {
    /// Half the sum of squared differences by the length of a block, (°/h)² · s: in white noise as many variances of a one-second rate as
    /// there are pairs.
    pub squares: f32,
    pub pairs: u16,
}

impl Blocks {
    /// Those of two parts of a dwell, but for the pair between them.
    pub fn joined(self, next: Self) -> Self {
        Self { squares: self.squares + next.squares, pairs: self.pairs.saturating_add(next.pairs) }
    }
}

/// Gathers [`Blocks`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BlockSums {
    seconds: f64,
    sum: f64,
    /// Length and mean of the block before.
    last: Option<(f64, f64)>,
    squares: f64,
    pairs: u16,
}

impl BlockSums {
    /// Takes a row of a length and a rate.
    pub fn add(&mut self, seconds: f64, rate_deg_h: f64) {
        self.seconds += seconds;
        self.sum += seconds * rate_deg_h;
        // Lengths of rows are rounded.
        if self.seconds < 0.999 * BLOCK_S {
            return;
        }
        let mean = self.sum / self.seconds;
        if let Some((before_s, before)) = self.last.replace((self.seconds, mean)) {
            let weight = before_s * self.seconds / (before_s + self.seconds);
            self.squares += weight * (mean - before) * (mean - before);
            self.pairs = self.pairs.saturating_add(1);
        }
        (self.seconds, self.sum) = (0.0, 0.0);
    }

    pub fn blocks(&self) -> Blocks {
        Blocks { squares: self.squares as f32, pairs: self.pairs }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(rates: &[f64]) -> Option<Tails> {
        let (mut sorted, middle) = (rates.to_vec(), rates.len() / 2);
        sorted.sort_by(f64::total_cmp);
        let median = sorted[middle];
        let mut off: std::vec::Vec<f64> = rates.iter().map(|rate| (rate - median).abs()).collect();
        off.sort_by(f64::total_cmp);
        Tails::fit(|| rates.iter().map(|&rate| (1.0, rate)), median, 1.4826 * off[middle])
    }

    #[test]
    fn the_values_have_the_centre_for_their_mean() {
        let rates = [1.0, 2.0, 3.0, 2.5, 1.5, 2.2, 1.9, 30.0, 2.1];
        let tails = fit(&rates).unwrap();
        let mean = rates.iter().map(|&rate| tails.value(1.0, rate)).sum::<f64>() / 9.0;
        assert!((mean - tails.centre_deg_h).abs() < 1e-3, "{mean} {}", tails.centre_deg_h);
        assert!((mean - 2.05).abs() < 0.2, "{mean}");
        // A rate in the centre stands for itself; one far off for less than it is: 3 c w → 12 scales²/off.
        assert_eq!(tails.value(1.0, tails.centre_deg_h), tails.centre_deg_h);
        assert!(tails.value(1.0, 30.0) < 5.0);
    }

    #[test]
    fn few_rows_and_rows_that_repeat_themselves_tell_no_tails() {
        assert!(fit(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]).is_none());
        assert!(fit(&[1.0; 9]).is_none());
    }

    #[test]
    fn blocks_by_hand() {
        // Means 1, 3 and 2 of five seconds: 2.5 · (4 + 1) = 12.5, of two pairs.
        let mut sums = BlockSums::default();
        (0..17).for_each(|second| sums.add(1.0, [1.0, 3.0, 2.0, 9.0][second / 5]));
        assert_eq!(sums.blocks(), Blocks { squares: 12.5, pairs: 2 });
    }
}
