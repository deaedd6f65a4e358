//! Rates in whole quanta: what their rounding leaves in the mean of a dwell.
//!
//! A gyro or a recorder that gives whole quanta q, and is quieter than they are, repeats itself while it rests: the rounding error is the same in every
//! second, and no mean makes it less. Noise of a standard deviation σ dithers it: of the error, even over ±q/2 with a variance of q²/12, it leaves
//! exp(−4π²σ²/q²) (Widrow and Kollár, Quantization Noise, 2008, chapter 5: the first term of the rounding error's Fourier series).

use std::f64::consts::PI;
use std::ops::Range;

/// Two rates that differ by less than this share of their size are one that was printed twice.
const SAME: f64 = 1e-9;

/// The quantum of some rates, in their unit: the least step between two of them.
pub fn quantum(rates: &[f64]) -> f64 {
    let mut sorted = rates.to_vec();
    sorted.sort_by(f64::total_cmp);
    let steps = sorted.windows(2).map(|pair| (pair[1] - pair[0], SAME * pair[1].abs()));
    let least = steps.filter(|(step, same)| step > same).map(|(step, _)| step).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

/// Variance of the rounding error that all seconds of one dwell share, from their rates in order.
pub fn shared_variance(rates: &[f64], quantum: f64) -> f64 {
    if quantum == 0.0 || rates.len() < 2 {
        return 0.0;
    }
    let squares: f64 = rates.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    let noise2 = squares / (2.0 * (rates.len() - 1) as f64);
    quantum * quantum / 12.0 * (-4.0 * PI * PI * noise2 / (quantum * quantum)).exp()
}

/// What each bin's variance grows by so that what the run says of one rate is as uncertain as its rounding makes it: dwells that read the same share the
/// error. `dwells`: number of the dwell by bin; `rates`: of every second of the run.
pub fn by_bin(bins: &[Range<usize>], dwells: &[usize], rates: &[f64]) -> Vec<f64> {
    let of_bins =
        |bins: &[Range<usize>]| -> Vec<f64> { bins.iter().flat_map(|bin| &rates[bin.clone()]).copied().collect() };
    let quantum = quantum(&of_bins(bins));
    let mut rest = bins;
    let of_dwell = |numbers: &[usize]| {
        let (own, after) = rest.split_at(numbers.len());
        rest = after;
        let rates = of_bins(own);
        let reading = rates.iter().sum::<f64>() / rates.len() as f64;
        (reading, shared_variance(&rates, quantum), own.len())
    };
    let of_dwells: Vec<(f64, f64, usize)> = dwells.chunk_by(|a, b| a == b).map(of_dwell).collect();
    let grown = |&(reading, variance, count): &(f64, f64, usize)| {
        let alike = of_dwells.iter().filter(|each| (each.0 - reading).abs() < 0.5 * quantum);
        std::iter::repeat_n(alike.map(|each| each.2).sum::<usize>() as f64 * variance, count)
    };
    of_dwells.iter().flat_map(grown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A gyro that gives whole 0.6 °/h and repeats one of them: 0.6²/12 = 0.03 (°/h)² that no mean makes less. Where every other second is one quantum
    /// more, σ² = 0.36/2 and exp(−4π²/2) = 3·10⁻⁹ of it is left. Rates of many digits have no quantum to speak of.
    #[test]
    fn what_noise_does_not_dither_is_left() {
        assert!((quantum(&[1.2, 0.6, 1.2, 3.0]) - 0.6).abs() < 1e-12);
        assert!((shared_variance(&[1.2; 20], 0.6) - 0.03).abs() < 1e-12);
        let dithered: Vec<f64> = (0..20).map(|i| if i % 2 == 0 { 1.2 } else { 1.8 }).collect();
        assert!(shared_variance(&dithered, 0.6) < 1e-9);
        assert_eq!((quantum(&[2.5; 9]), shared_variance(&[2.5; 9], 0.0)), (0.0, 0.0));
    }

    /// Two bins of one dwell that repeats itself, one of another that does not: the mean of the first two has the variance of their dwell.
    #[test]
    fn bins_share_the_error_of_their_dwell() {
        let grown = by_bin(&[0..2, 2..4, 5..9], &[0, 0, 1], &[0.6, 0.6, 0.6, 0.6, 9.9, 1.2, 1.8, 1.2, 1.8]);
        assert!((grown[0] / 2.0 - 0.03).abs() < 1e-12 && grown[0] == grown[1] && grown[2] < 1e-9, "{grown:?}");
        // Where a third bin of another dwell reads the same, all three share it.
        let grown = by_bin(&[0..2, 2..4, 5..7, 7..8], &[0, 0, 1, 2], &[0.6, 0.6, 0.6, 0.6, 9.9, 0.6, 0.6, 1.2]);
        assert!(grown[..3].iter().all(|each| (each / 3.0 - 0.03).abs() < 1e-12), "{grown:?}");
    }
}
