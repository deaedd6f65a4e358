//! What a few or many errors say together, and how far to trust it.

pub use north::diagnose::statistics::rms_interval;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{Beta, ContinuousCDF};

/// Azimuth minus truth, degrees, in −180 … 180.
pub fn azimuth_error_deg(found_deg: f64, true_deg: f64) -> f64 {
    (found_deg - true_deg + 180.0).rem_euclid(360.0) - 180.0
}

/// Error of an azimuth that is missing, degrees: the rms of an even distribution over the circle, 180/√3.
pub const MISSING_DEG: f64 = 103.923_048_454_132_64;

/// Root mean square; not-a-number of nothing.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (count, sum) = values.into_iter().fold((0.0, 0.0), |(count, sum), value| (count + 1.0, sum + value * value));
    f64::sqrt(sum / count)
}

/// The middle of these; not-a-number of nothing.
pub fn median(mut values: Vec<f64>) -> f64 {
    quantities::median::median(&mut values).unwrap_or(f64::NAN)
}

/// 95 % interval of the probability of what happened `hits` times in `trials` (Clopper and Pearson, Biometrika 26, 1934).
pub fn probability_interval(hits: usize, trials: usize) -> [f64; 2] {
    let misses = trials - hits;
    let quantile = |low: usize, high: usize, probability: f64| {
        Beta::new(low as f64, high as f64).map_or(f64::NAN, |beta| beta.inverse_cdf(probability))
    };
    let lowest = if hits == 0 { 0.0 } else { quantile(hits, misses + 1, 0.025) };
    let highest = if misses == 0 { 1.0 } else { quantile(hits + 1, misses, 0.975) };
    [lowest, highest]
}

/// Resamplings of the bootstrap.
const RESAMPLINGS: usize = 400;

/// 95 % interval of the ratio of two sums over campaigns, whose runs are not independent: bootstrap over the campaigns.
pub fn ratio_interval(sums: &[[f64; 2]]) -> [f64; 2] {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut resampled: Vec<f64> =
        (0..RESAMPLINGS).map(|_| ratio((0..sums.len()).map(|_| &sums[random.random_range(0..sums.len())]))).collect();
    resampled.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|share: f64| resampled[(share * (RESAMPLINGS - 1) as f64).round() as usize])
}

/// The ratio of two sums over campaigns; not-a-number of nothing.
pub fn ratio<'a>(sums: impl IntoIterator<Item = &'a [f64; 2]>) -> f64 {
    let [over, under] = sums.into_iter().fold([0.0, 0.0], |[a, b], [over, under]| [a + over, b + under]);
    over / under
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        assert_eq!(azimuth_error_deg(1.0, 359.0), 2.0);
        assert_eq!((rms([3.0, -4.0]), MISSING_DEG), (12.5f64.sqrt(), 180.0 / 3f64.sqrt()));
        assert_eq!((median(vec![3.0, 1.0, 2.0]), median(vec![1.0, 4.0])), (2.0, 2.5));
        // Chi-square of 10 degrees of freedom: 3.247 and 20.483 at 2.5 and 97.5 % (tables).
        // Of 10 in 10 the lower end is 0.025^(1/10) = 0.6915.
        let [low, high] = probability_interval(10, 10);
        assert!((low - 0.6915).abs() < 1e-4 && high == 1.0);
        let [low, high] = probability_interval(0, 10);
        assert!(low == 0.0 && (high - 0.3085).abs() < 1e-4);
        // Two equal campaigns give the same in every resampling; of two of which one has all and one nothing, a quarter of the resamplings has nothing, a quarter all.
        assert_eq!(ratio_interval(&[[3.0, 3.0], [3.0, 3.0]]), [1.0, 1.0]);
        assert_eq!(ratio_interval(&[[6.0, 6.0], [0.0, 6.0]]), [0.0, 1.0]);
        assert_eq!(ratio(&[[6.0, 6.0], [0.0, 6.0]]), 0.5);
        let [low, high] = rms_interval(1.0, 10).unwrap();
        assert!((low - (10.0f64 / 20.483).sqrt()).abs() < 1e-4 && (high - (10.0f64 / 3.247).sqrt()).abs() < 1e-3);
    }
}
