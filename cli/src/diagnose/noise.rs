//! Is the residual noise? Tests, periodogram and Allan deviation.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::data::RunData;
use super::result::{Spectra, Test};
use super::statistics::{chi_square_tail, median};

/// A test fails below this.
const LEVEL: f64 = 1e-3;
/// Lags of the test for whiteness.
const LAGS: usize = 10;
/// Most frequencies of the periodogram.
const FREQUENCIES: usize = 400;

/// The residual of a run by the cell, °/h; not-a-number where a cell does not enter.
pub type Residual = Vec<f64>;

/// Tests of all runs' residuals together.
pub fn tests(runs: &[RunData], residuals: &[Residual], noise_deg_h: f64) -> Vec<Test> {
    let mut tests = vec![whiteness(runs, residuals), stays(runs, residuals, noise_deg_h)];
    tests.extend(periodogram_test(&periodogram(runs, residuals), runs.len()));
    tests
}

fn test(name: &'static str, about: &'static str, statistic: f64, p_value: f64) -> Test {
    Test { name, about, statistic, p_value, passed: p_value >= LEVEL }
}

/// Pairs of cells of the same stay that are `lag` apart.
fn pairs<'a>(run: &'a RunData, residual: &'a Residual, lag: usize) -> impl Iterator<Item = (f64, f64)> + 'a {
    (lag..residual.len())
        .filter(move |&i| run.cells[i].stay == run.cells[i - lag].stay)
        .map(move |i| (residual[i - lag], residual[i]))
        .filter(|(a, b)| a.is_finite() && b.is_finite())
}

/// Ljung and Box (Biometrika 65, 1978, p. 297): autocorrelations up to ten lags, inside stays.
fn whiteness(runs: &[RunData], residuals: &[Residual]) -> Test {
    let mut statistic = 0.0;
    let mut lags = 0.0;
    for lag in 1..=LAGS {
        let (mut product, mut squares, mut count) = (0.0, 0.0, 0.0);
        for (run, residual) in runs.iter().zip(residuals) {
            for (a, b) in pairs(run, residual, lag) {
                product += a * b;
                squares += 0.5 * (a * a + b * b);
                count += 1.0;
            }
        }
        if count > 20.0 && squares > 0.0 {
            statistic += count * (product / squares).powi(2);
            lags += 1.0;
        }
    }
    let about = "autocorrelation of the seconds inside stays, ten lags: chi-square";
    test("whiteness", about, statistic, chi_square_tail(statistic, lags))
}

/// Means of stays against what white noise leaves them.
fn stays(runs: &[RunData], residuals: &[Residual], noise_deg_h: f64) -> Test {
    let (mut statistic, mut freedom) = (0.0, 0.0);
    for (run, residual) in runs.iter().zip(residuals) {
        let mut stays = std::collections::BTreeMap::<usize, (f64, f64)>::new();
        for (cell, value) in run.cells.iter().zip(residual).filter(|(_, value)| value.is_finite()) {
            let (sum, seconds) = stays.entry(cell.stay).or_default();
            *sum += value * cell.seconds;
            *seconds += cell.seconds;
        }
        statistic += stays.values().map(|(sum, seconds)| sum * sum / seconds).sum::<f64>();
        freedom += (stays.len() as f64 - 3.0).max(0.0);
    }
    statistic /= noise_deg_h * noise_deg_h;
    let p_value = if freedom > 0.0 { chi_square_tail(statistic, freedom) } else { 1.0 };
    test("stays", "means of the stays against their white noise: chi-square", statistic, p_value)
}

/// Frequencies and powers; white noise has a mean power of 1.
fn periodogram(runs: &[RunData], residuals: &[Residual]) -> Vec<(f64, f64)> {
    let longest_s = runs.iter().filter_map(|run| run.cells.last()).map(|cell| cell.t_s).fold(0.0, f64::max);
    let step_s = runs.iter().filter_map(|run| run.cells.first()).map(|cell| cell.seconds).fold(0.0, f64::max);
    if !(longest_s > 0.0 && step_s > 0.0) {
        return Vec::new();
    }
    let count = ((0.5 * longest_s / step_s) as usize).clamp(1, FREQUENCIES);
    let frequencies: Vec<f64> = (1..=count).map(|n| n as f64 * 0.5 / step_s / count as f64).collect();
    frequencies
        .par_iter()
        .map(|&frequency| {
            let (mut power, mut number) = (0.0, 0.0);
            for (run, residual) in runs.iter().zip(residuals) {
                let (mut cos, mut sin, mut squares, mut cells) = (0.0, 0.0, 0.0, 0.0);
                for (cell, value) in run.cells.iter().zip(residual).filter(|(_, value)| value.is_finite()) {
                    let (s, c) = (TAU * frequency * cell.t_s).sin_cos();
                    cos += c * value;
                    sin += s * value;
                    squares += value * value;
                    cells += 1.0;
                }
                if squares > 0.0 && cells > 8.0 {
                    power += (cos * cos + sin * sin) / squares;
                    number += 1.0;
                }
            }
            (frequency, if number > 0.0 { power / number } else { 0.0 })
        })
        .collect()
}

/// The highest line: R runs' mean power, times 2R, is a chi-square of 2R; the highest of many is paid for.
fn periodogram_test(powers: &[(f64, f64)], runs: usize) -> Option<Test> {
    let highest = powers.iter().map(|each| each.1).fold(0.0, f64::max);
    let twice = 2.0 * runs as f64;
    let p_value = (chi_square_tail(twice * highest, twice) * powers.len() as f64).min(1.0);
    let about = "highest power of the periodogram, white noise having 1 on average";
    (!powers.is_empty()).then(|| test("lines", about, highest, p_value))
}

/// Spectra for drawing.
pub fn spectra(runs: &[RunData], before: &[Residual], after: &[Residual], white_deg_h: f64) -> Spectra {
    let (powers_before, powers_after) = (periodogram(runs, before), periodogram(runs, after));
    let step_s = runs.iter().filter_map(|run| run.cells.first()).map(|cell| cell.seconds).fold(0.0, f64::max);
    let longest = runs.iter().map(|run| run.cells.len()).max().unwrap_or(0);
    let mut counts: Vec<usize> = Vec::new();
    let mut count = 1.0f64;
    while (count as usize) * 3 <= longest {
        if counts.last() != Some(&(count as usize)) {
            counts.push(count as usize);
        }
        count *= 1.4;
    }
    let allan_all = |residuals: &[Residual]| counts.iter().map(|&count| allan(residuals, count)).collect::<Vec<_>>();
    Spectra {
        frequency_hz: powers_before.iter().map(|each| each.0).collect(),
        power_before: powers_before.iter().map(|each| each.1).collect(),
        power_after: powers_after.iter().map(|each| each.1).collect(),
        tau_s: counts.iter().map(|&count| count as f64 * step_s).collect(),
        allan_before_deg_h: allan_all(before),
        allan_after_deg_h: allan_all(after),
        allan_white_deg_h: counts.iter().map(|&count| white_deg_h / (count as f64 * step_s).sqrt()).collect(),
    }
}

/// Overlapping Allan deviation over `count` cells, from run to run (cells that do not enter are bridged).
fn allan(residuals: &[Residual], count: usize) -> f64 {
    let (mut sum, mut number) = (0.0, 0.0);
    for residual in residuals {
        let values: Vec<f64> = residual.iter().copied().filter(|value| value.is_finite()).collect();
        let mut total = vec![0.0];
        for value in &values {
            total.push(total.last().copied().unwrap_or(0.0) + value);
        }
        for i in 0..(values.len() + 1).saturating_sub(2 * count) {
            let difference = (total[i + 2 * count] - 2.0 * total[i + count] + total[i]) / count as f64;
            sum += 0.5 * difference * difference;
            number += 1.0;
        }
    }
    if number > 0.0 { (sum / number).sqrt() } else { 0.0 }
}

/// A line with a phase of its own in every run: period, amplitude and p-value. Its frequency must stand alone, four times
/// as high as what surrounds it, and lie within the stays, at 0.02 Hz or more.
pub fn line(runs: &[RunData], residuals: &[Residual]) -> Option<(f64, f64, f64)> {
    let powers = periodogram(runs, residuals);
    let (place, &(frequency, power)) =
        powers.iter().enumerate().filter(|(_, each)| each.0 >= 0.02).max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    let around = |i: &usize| i.abs_diff(place) > 3 && i.abs_diff(place) <= 15;
    let nearby = median((0..powers.len()).filter(around).map(|i| powers[i].1).collect());
    let twice = 2.0 * runs.len() as f64;
    let p_value = chi_square_tail(twice * power / nearby.max(1.0), twice) * powers.len() as f64;
    let cells = runs.iter().map(|run| run.cells.len()).sum::<usize>() as f64 / runs.len() as f64;
    let squares: Vec<f64> =
        residuals.iter().flatten().filter(|value| value.is_finite()).map(|value| value * value).collect();
    let mean_square = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    // A line of amplitude a in n cells has a power of n a²/4 over the mean square.
    let amplitude = (4.0 * (power - nearby).max(0.0) * mean_square / cells).sqrt();
    (p_value < 1e-4 && power > 4.0 * nearby).then_some((1.0 / frequency, amplitude, p_value))
}
