//! The Allan deviation and what it is made of.

use allan::{Allan, DataType, Style};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Averaging times go up to this share of the recording: beyond it two or three clusters decide.
pub const LONGEST_SHARE: f64 = 0.2;
/// A process enters where it raises the logarithm of the likelihood, half the residual sum of squares, by 6. One recording of white noise in fifty, from a
/// minute to four hours long, then shows anything else, and one in thirty at the most (`white_noise_is_taken_for_nothing_else`). By the Bayesian
/// information criterion, ln n for n points, it is one in four: points beside each other are correlated, and 31 sets of processes are tried.
const EVIDENCE: f64 = 12.0;
/// White noise of the rate is in every gyro: a set of processes without it has to fit better by so much, and with it beside the others as well.
const WITHOUT_WALK: f64 = 0.5 * EVIDENCE;
/// Slow processes are looked for where the longest averaging time is so many times the shortest. The deviation is known to 30 % at the longest, a fifth of
/// the recording, and to 19 % at half of it. Within a decade these two correlated points decide whether a curve that falls by √10 becomes level; within
/// two decades there are six points, of which the first four hold the white noise to a few per cent.
pub const SLOW_SPAN: f64 = 100.0;
/// Processes that are fast: quantisation and angle random walk.
const FAST: usize = 2;
/// Place of the angle random walk among the processes.
const WALK: usize = 1;
/// The noise processes of the fit: name, letter and unit of the coefficient.
pub const PROCESSES: [(&str, &str, &str); 5] = [
    ("quantisation", "Q", "arcsec"),
    ("angle random walk", "N", "°/√h"),
    ("bias instability", "B", "°/h"),
    ("rate random walk", "K", "°/h/√h"),
    ("rate ramp", "R", "°/h per hour"),
];

/// The deviation at one averaging time.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    pub tau_s: f64,
    pub sigma_deg_h: f64,
    /// Relative standard deviation of the deviation itself.
    pub relative: f64,
}

/// Coefficients of the noise processes; 0 where a process is not seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Noise {
    /// Q: white noise of the angle, arcsec.
    pub quantisation_arcsec: f64,
    /// N: white noise of the rate, °/√h.
    pub angle_random_walk_deg_per_sqrt_h: f64,
    /// B: flicker noise of the rate, °/h.
    pub bias_instability_deg_h: f64,
    /// K: random walk of the rate, °/h/√h.
    pub rate_random_walk_deg_h_per_sqrt_h: f64,
    /// R: a drift of the rate, °/h per hour.
    pub rate_ramp_deg_h_per_h: f64,
}

impl Noise {
    /// In the order of [`PROCESSES`].
    pub fn coefficients(&self) -> [f64; PROCESSES.len()] {
        [
            self.quantisation_arcsec,
            self.angle_random_walk_deg_per_sqrt_h,
            self.bias_instability_deg_h,
            self.rate_random_walk_deg_h_per_sqrt_h,
            self.rate_ramp_deg_h_per_h,
        ]
    }

    /// Part of each process in the Allan deviation at an averaging time, °/h.
    pub fn deviations_deg_h(&self, tau_s: f64) -> [f64; PROCESSES.len()] {
        let (coefficients, variances) = (self.coefficients(), unit_variances(tau_s));
        std::array::from_fn(|process| coefficients[process] * variances[process].sqrt())
    }
}

/// Overlapping Allan deviation of the angle at even steps, at 1, 2, 4, 10, … steps.
pub fn allan(angle_arcsec: &[f64], interval_s: f64) -> Vec<Point> {
    let rows = angle_arcsec.len() - 1;
    let longest = ((LONGEST_SHARE * rows as f64) as usize).max(1);
    let mut allan = Allan::builder().style(Style::Decade124).max_tau(longest).data_type(DataType::Phase).build_allan();
    angle_arcsec.iter().for_each(|&angle| allan.record(angle));
    let point = |tau: allan::Tau| {
        let degrees_of_freedom = degrees_of_freedom(angle_arcsec.len() as f64, f64::from(tau.tau()));
        let sigma_deg_h = tau.deviation()? / interval_s;
        let relative = (0.5 / degrees_of_freedom).sqrt();
        (sigma_deg_h > 0.0).then_some(Point { tau_s: f64::from(tau.tau()) * interval_s, sigma_deg_h, relative })
    };
    allan.iter().filter_map(point).collect()
}

/// Of the overlapping estimate at `m` steps for white noise of the rate in `n` angles (Riley, NIST SP 1065, 2008, table 5).
fn degrees_of_freedom(n: f64, m: f64) -> f64 {
    let of_long = 1.5 * (n - 1.0) / m - 2.0 * (n - 2.0) / n;
    (of_long * 4.0 * m * m / (4.0 * m * m + 5.0)).max(1.0)
}

/// Whether the averaging times span enough for slow processes.
pub fn spans_slow(points: &[Point]) -> bool {
    points.first().zip(points.last()).is_some_and(|(first, last)| last.tau_s >= 0.99 * SLOW_SPAN * first.tau_s)
}

/// Fits the variances by the processes, each point weighted by its relative error, no coefficient below 0: among all sets
/// of processes that fit without a negative one, the set with the least residual sum of squares, each further process
/// having to earn its place.
pub fn fit(points: &[Point]) -> Noise {
    let looked_for = if spans_slow(points) { PROCESSES.len() } else { FAST };
    let best = (1_u32..1 << looked_for)
        .filter_map(|set| {
            let columns: Vec<usize> = (0..looked_for).filter(|process| set & (1 << process) != 0).collect();
            let (squares, residual) = solve(points, &columns)?;
            let without_walk = if columns.contains(&WALK) { 0.0 } else { WITHOUT_WALK };
            let criterion = residual + EVIDENCE * columns.len() as f64 + without_walk;
            Some((criterion, columns, squares))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let mut squares = [0.0; PROCESSES.len()];
    if let Some((_, columns, found)) = best {
        columns.iter().zip(found.iter()).for_each(|(&column, &square)| squares[column] = square);
    }
    let [quantisation, angle, flicker, walk, ramp] = squares.map(f64::sqrt);
    Noise {
        quantisation_arcsec: quantisation,
        angle_random_walk_deg_per_sqrt_h: angle,
        bias_instability_deg_h: flicker,
        rate_random_walk_deg_h_per_sqrt_h: walk,
        rate_ramp_deg_h_per_h: ramp,
    }
}

/// Variance in (°/h)² at τ seconds for a unit coefficient of each process, in the units of [`Noise`]: 1 arcsec/s is
/// 1 °/h; 1 °/√h is 60 °/h in one second.
fn unit_variances(tau_s: f64) -> [f64; PROCESSES.len()] {
    let hours = tau_s / 3600.0;
    [3.0 / (tau_s * tau_s), 1.0 / hours, flicker_deviation().powi(2), hours / 3.0, hours * hours / 2.0]
}

/// Allan deviation of flicker noise of 1 °/h, °/h, at every averaging time.
pub fn flicker_deviation() -> f64 {
    (2.0 * std::f64::consts::LN_2 / std::f64::consts::PI).sqrt()
}

/// Squared coefficients of some processes and the weighted residual sum of squares; `None` if one would be negative, or is no number.
fn solve(points: &[Point], columns: &[usize]) -> Option<(DVector<f64>, f64)> {
    if points.is_empty() {
        return None;
    }
    // Relative error of a variance is twice that of its deviation; rows are divided by their sigmas.
    let weight = |point: &Point| 1.0 / (2.0 * point.relative * point.sigma_deg_h * point.sigma_deg_h);
    let scale: Vec<f64> = columns
        .iter()
        .map(|&column| points.iter().map(|p| (weight(p) * unit_variances(p.tau_s)[column]).powi(2)).sum::<f64>().sqrt())
        .collect();
    let design = DMatrix::from_fn(points.len(), columns.len(), |row, i| {
        weight(&points[row]) * unit_variances(points[row].tau_s)[columns[i]] / scale[i]
    });
    let observed = DVector::from_fn(points.len(), |row, _| weight(&points[row]) * points[row].sigma_deg_h.powi(2));
    if !design.iter().chain(observed.iter()).all(|value| value.is_finite()) {
        return None;
    }
    let scaled = design.clone().svd(true, true).solve(&observed, 1e-12).ok()?;
    if !scaled.iter().all(|square| *square >= 0.0) {
        return None;
    }
    let residual = (observed - design * &scaled).norm_squared();
    Some((DVector::from_fn(columns.len(), |i, _| scaled[i] / scale[i]), residual))
}

/// Correlation of neighbours, and the standard deviation that it would have in white noise.
pub fn autocorrelation(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let products: f64 = values.windows(2).map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum();
    (if squares > 0.0 { products / squares } else { 0.0 }, 1.0 / (values.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn normal(rng: &mut ChaCha8Rng) -> f64 {
        use rand::Rng;
        // Twelve uniform numbers less six: variance 1.
        (0..12).map(|_| rng.next_u32() as f64 / f64::from(u32::MAX)).sum::<f64>() - 6.0
    }

    fn angle(rates: impl Iterator<Item = f64>) -> Vec<f64> {
        std::iter::once(0.0)
            .chain(rates.scan(0.0, |sum, rate| {
                *sum += rate;
                Some(*sum)
            }))
            .collect()
    }

    #[test]
    fn the_deviation_by_hand() {
        // Rates 1, 3, 2, 6 at one second: differences 2, −1, 4; half their mean square is (4 + 1 + 16)/6 = 3.5.
        let points = allan(&angle([1.0, 3.0, 2.0, 6.0].into_iter()), 1.0);
        assert!((points[0].sigma_deg_h - 3.5_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn white_noise_is_an_angle_random_walk() {
        // 0.0015 °/√h is 0.09 °/h in a second. Relative sigma of N from 20,000 seconds: 1/√(2 · 1.5 · 20,000) = 0.4 % at
        // one second; four sigma of the fit is below 3 %.
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let noise = fit(&allan(&angle((0..20_000).map(|_| 0.09 * normal(&mut rng))), 1.0));
        assert!((noise.angle_random_walk_deg_per_sqrt_h / 0.0015 - 1.0).abs() < 0.03, "{noise:?}");
        assert_eq!((noise.quantisation_arcsec, noise.rate_ramp_deg_h_per_h), (0.0, 0.0), "{noise:?}");
    }

    #[test]
    fn white_angle_noise_is_quantisation() {
        // Angle errors of 0.05 arcsec, independent: σ²(τ) = 3 Q²/τ² (by hand at one second: variance of x2 − 2 x1 + x0 is
        // 6 Q², half of it 3 Q²), and neighbouring rates correlate by −1/2.
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let angles: Vec<f64> = (0..20_000).map(|_| 0.05 * normal(&mut rng)).collect();
        let noise = fit(&allan(&angles, 1.0));
        assert!((noise.quantisation_arcsec / 0.05 - 1.0).abs() < 0.05, "{noise:?}");
        let rates: Vec<f64> = angles.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let (correlation, sigma) = autocorrelation(&rates);
        assert!((correlation + 0.5).abs() < 4.0 * sigma, "{correlation}");
    }

    #[test]
    fn white_noise_is_taken_for_nothing_else() {
        // 200 recordings of each length: one in fifty expected, 4 ± 2; four sigma above are 12.
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for seconds in [60, 300, 1000] {
            let other = (0..200).filter(|_| {
                let noise = fit(&allan(&angle((0..seconds).map(|_| 0.09 * normal(&mut rng))), 1.0));
                let walk = noise.angle_random_walk_deg_per_sqrt_h;
                noise != Noise { angle_random_walk_deg_per_sqrt_h: walk, ..Noise::default() } || walk == 0.0
            });
            let other = other.count();
            assert!(other <= 12, "{other} of 200 recordings of {seconds} s show more than white noise");
        }
    }

    #[test]
    fn degrees_of_freedom_by_hand() {
        // Neighbouring differences of white rates have a correlation of −1/2: the variance of the mean square of n of them is 2 (1 + 2/4)/n of its square,
        // that of chi-square with 2 n/3 degrees of freedom.
        assert!((degrees_of_freedom(30_001.0, 1.0) / 20_000.0 - 1.0).abs() < 1e-3);
        // At a fifth of a recording: (1.5 · 5 − 2) = 5.5.
        assert!((degrees_of_freedom(10_001.0, 2000.0) - 5.5).abs() < 0.01);
    }

    #[test]
    fn nothing_to_fit_is_no_noise() {
        assert_eq!(fit(&[]), Noise::default());
        assert_eq!(fit(&allan(&[0.0; 100], 1.0)), Noise::default());
        let endless = Point { tau_s: 1.0, sigma_deg_h: f64::INFINITY, relative: 0.1 };
        assert_eq!(fit(&[endless, endless]), Noise::default());
    }

    #[test]
    fn slow_processes_are_looked_for_over_two_decades() {
        let ramp = |seconds: u32| allan(&angle((0..seconds).map(|second| 0.001 * f64::from(second))), 1.0);
        assert!(fit(&ramp(499)).rate_ramp_deg_h_per_h == 0.0 && fit(&ramp(500)).rate_ramp_deg_h_per_h > 0.0);
    }

    /// Flicker noise of B = 0.01 °/h as a sum of first-order processes whose time constants lie a factor 3 apart, each of variance B² ln 3/π (that sum is
    /// B²/(2πf) on both sides of the spectrum), with a random walk of 0.02 °/h/√h and white noise of 0.0015 °/√h, for four hours.
    fn flicker(seed: u64) -> Vec<Point> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let deviation = 0.01 * (3_f64.ln() / std::f64::consts::PI).sqrt();
        let mut processes: Vec<(f64, f64)> =
            (0..12).map(|i| ((-1.0 / (0.3 * 3_f64.powi(i))).exp(), deviation * normal(&mut rng))).collect();
        let mut walk = 0.0;
        let rates: Vec<f64> = (0..14_400)
            .map(|_| {
                for (keeps, value) in &mut processes {
                    *value = *keeps * *value + deviation * (1.0 - *keeps * *keeps).sqrt() * normal(&mut rng);
                }
                walk += 0.02 / 60.0 * normal(&mut rng);
                processes.iter().map(|process| process.1).sum::<f64>() + walk + 0.09 * normal(&mut rng)
            })
            .collect();
        allan(&angle(rates.into_iter()), 1.0)
    }

    #[test]
    fn the_instability_is_that_of_the_fit_and_not_the_curves_least_point() {
        // Eight recordings: single fits scatter by some 15 % (as the points of long averaging times do, 9 to 20 % each), their mean by 5 %; the least
        // point over 0.664 is a fifth too high, for white noise and walk are in it.
        let curves: Vec<Vec<Point>> = (0..8).map(flicker).collect();
        let mean = |of: &dyn Fn(&Vec<Point>) -> f64| curves.iter().map(of).sum::<f64>() / curves.len() as f64 / 0.01;
        let fitted = mean(&|points| fit(points).bias_instability_deg_h);
        let least = mean(&|points| {
            points.iter().map(|point| point.sigma_deg_h).fold(f64::INFINITY, f64::min) / flicker_deviation()
        });
        assert!((fitted - 1.0).abs() < 0.15 && least > 1.1, "{fitted} {least}");
    }

    #[test]
    fn a_ramp_by_hand() {
        // 3.6 °/h per hour is 0.001 °/h per second; at τ the means differ by 0.001 τ: σ = 0.001 τ/√2.
        let points = allan(&angle((0..2000).map(|second| 0.001 * f64::from(second))), 1.0);
        assert!(
            points.iter().all(|point| (point.sigma_deg_h * 2_f64.sqrt() / (0.001 * point.tau_s) - 1.0).abs() < 1e-6)
        );
        assert!((fit(&points).rate_ramp_deg_h_per_h - 3.6).abs() < 1e-3);
    }
}
