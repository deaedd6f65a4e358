//! Differences of neighbouring seconds: what of a rate is white noise, whatever slower is in it.

/// Highest order of the differences.
const ORDERS: usize = 4;
/// Ratio of root mean squares below which a higher order is taken in the place of the first. Of a random walk, or of steps, the fourth
/// order still has √((20/70)/(1/2)) = 0.76 of it: neither is taken for a wave.
const PLAINLY_LESS: f64 = 0.6;
/// Standard deviations, and that of the ratio's logarithm for one difference: of √½ Σρ² / n the fourth order has 1.15/√n (ρ = −56/70,
/// 28/70, −8/70, 1/70), the first 0.87/√n (ρ = −½), and most of it in common.
const DEVIATIONS: f64 = 3.0;
const SCATTER: f64 = 0.8;

/// Differences of the lowest order beside which none is plainly less: of the first, unless something fast and smooth stands in these. Each
/// is divided by what white noise of 1 in a second makes of it, and stands with the number of its last second. `chains` are numbers of
/// seconds that follow one another.
pub fn quiet(rate: &[f64], interval_s: &[f64], chains: &[Vec<usize>]) -> Vec<(usize, f64)> {
    let first = of_order(1, rate, interval_s, chains);
    let own = mean_square(&first);
    let least = (2..=ORDERS)
        .map(|order| of_order(order, rate, interval_s, chains))
        .filter(|each| !each.is_empty())
        .min_by(|a, b| mean_square(a).total_cmp(&mean_square(b)));
    let is_less = |each: &Vec<(usize, f64)>| {
        let limit = PLAINLY_LESS.min((-DEVIATIONS * SCATTER / (each.len() as f64).sqrt()).exp());
        mean_square(each) < limit * limit * own
    };
    least.filter(is_less).unwrap_or(first)
}

fn mean_square(differences: &[(usize, f64)]) -> f64 {
    differences.iter().map(|each| each.1 * each.1).sum::<f64>() / differences.len().max(1) as f64
}

fn of_order(order: usize, rate: &[f64], interval_s: &[f64], chains: &[Vec<usize>]) -> Vec<(usize, f64)> {
    // Binomial coefficients with alternating signs.
    let mut shares = vec![1.0];
    for place in 0..order {
        shares.push(-shares[place] * (order - place) as f64 / (place + 1) as f64);
    }
    let of = |seconds: &[usize]| {
        let (difference, variance) =
            seconds.iter().zip(&shares).fold((0.0, 0.0), |(difference, variance), (&i, share)| {
                (difference + share * rate[i], variance + share * share / interval_s[i])
            });
        (seconds[order], difference / variance.sqrt())
    };
    chains.iter().flat_map(|chain| chain.windows(order + 1)).map(of).collect()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Sum of twelve uniform numbers less six: nearly normal, of variance 1.
    fn noise(seed: u64, number: usize) -> Vec<f64> {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        (0..number).map(|_| (0..12).map(|_| generator.random::<f64>()).sum::<f64>() - 6.0).collect()
    }

    fn sigma(rate: &[f64]) -> f64 {
        let chain: Vec<usize> = (0..rate.len()).collect();
        mean_square(&quiet(rate, &vec![1.0; rate.len()], &[chain])).sqrt()
    }

    /// Of 0, 1, 0, 1 in seconds of 1 s: ±1/√2, ∓2/√6; in seconds of 4 s twice that.
    #[test]
    fn differences_by_hand() {
        let rate = [0.0, 1.0, 0.0, 1.0];
        let chain = vec![vec![0, 1, 2, 3]];
        let first = of_order(1, &rate, &[1.0; 4], &chain);
        assert_eq!(first.len(), 3);
        assert!((first[0].1.abs() - 0.5f64.sqrt()).abs() < 1e-12 && first[0].0 == 1);
        let second = of_order(2, &rate, &[4.0; 4], &chain);
        assert_eq!(second.len(), 2);
        assert!((second[1].1.abs() - 4.0 / 6f64.sqrt()).abs() < 1e-12 && second[1].0 == 3);
    }

    /// White noise, noise of an angle (whose higher differences are more) and a random walk keep their first differences.
    #[test]
    fn noise_keeps_its_first_differences() {
        for seed in 0..20 {
            let white = noise(seed, 200);
            let of_angle: Vec<f64> = white.windows(2).map(|pair| pair[1] - pair[0]).collect();
            let walk: Vec<f64> = white
                .iter()
                .scan(0.0, |at, step| {
                    *at += step;
                    Some(*at)
                })
                .collect();
            for rate in [white, of_angle, walk] {
                let chain: Vec<usize> = (0..rate.len()).collect();
                assert_eq!(quiet(&rate, &vec![1.0; rate.len()], &[chain]).len(), rate.len() - 1);
            }
        }
    }

    /// Beside noise of 1 the first differences of a wave of 0.09 Hz and an amplitude of 30 are 30 · 2 sin(0.09 π)/√2/√2 = 8.4; the fourth
    /// 30 (2 sin 0.09 π)⁴/√70/√2 = 0.25.
    #[test]
    fn a_wave_is_not_noise() {
        let wave = |i: usize| 30.0 * (std::f64::consts::TAU * 0.09 * i as f64).sin();
        let rate: Vec<f64> = noise(7, 400).into_iter().enumerate().map(|(i, noise)| noise + wave(i)).collect();
        let found = sigma(&rate);
        assert!((found - 1.0).abs() < 0.15, "{found}");
    }
}
