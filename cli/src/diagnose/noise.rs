//! Is the residual noise? Tests, periodogram and Allan deviation.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use rayon::prelude::*;

use super::problem::Problem;
use super::result::{Spectra, Test};
use super::run_residual::{OWN_UNKNOWNS, RunResidual};
use super::statistics::{chi_square_tail, dot, least_squares};
use crate::run_data::RunData;

/// A test fails below this.
pub const SIGNIFICANCE: f64 = 1e-3;
/// Lags of the test for whiteness.
const LAGS: usize = 10;
/// Most frequencies of the periodogram.
const FREQUENCIES: usize = 400;
/// Classes of a channel's values.
const CLASSES: usize = 10;

/// The residual of a run by the sample, °/h; not-a-number where a sample does not enter.
pub type Residual = Vec<f64>;

/// Tests of what is left of all runs together, in units of white noise in the layout of the problem.
pub fn tests(problem: &Problem, left: &[f64]) -> Vec<Test> {
    let runs: Vec<Left> = problem
        .residuals
        .iter()
        .zip(problem.ranges())
        .map(|(residual, range)| Left { residual, z: &left[range] })
        .collect();
    let mut tests = vec![whiteness(&runs), dwells(&runs), closure(&runs)];
    tests.extend(highest_peak(&runs));
    // Slow noise is the business of the test of the dwells; a dependence must stand out of it.
    let dispersion = problem.overdispersion(left).max(1.0);
    let channels: BTreeSet<String> = runs.iter().flat_map(|run| run.residual.run.channel_names()).collect();
    tests.extend(channels.iter().map(|channel| dependence(&runs, channel, dispersion)));
    tests
}

/// What is left of a run.
struct Left<'a, 'b> {
    residual: &'a RunResidual<'b>,
    z: &'a [f64],
}

impl Left<'_, '_> {
    /// Cells that enter: number, dwell and value.
    fn samples(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let entering = self.residual.run.samples.iter().zip(&self.residual.root_weight).zip(self.z).enumerate();
        entering.filter(|(_, ((_, weight), _))| **weight > 0.0).map(|(i, ((sample, _), z))| (i, sample.dwell, *z))
    }

    /// Pairs of samples of the same dwell that are `lag` apart.
    fn pairs(&self, lag: usize) -> impl Iterator<Item = (f64, f64)> {
        let enters = |i: usize| self.residual.root_weight[i] > 0.0;
        let samples = &self.residual.run.samples;
        (lag..samples.len())
            .filter(move |&i| samples[i].dwell == samples[i - lag].dwell && enters(i) && enters(i - lag))
            .map(move |i| (self.z[i - lag], self.z[i]))
    }
}

fn test(name: impl Into<String>, about: impl Into<String>, statistic: f64, p_value: f64) -> Test {
    Test {
        name: name.into(),
        about: about.into(),
        statistic,
        p_value,
        passed: p_value >= SIGNIFICANCE,
        not_applied: None,
    }
}

/// Ljung and Box (Biometrika 65, 1978, p. 297): autocorrelations up to ten lags, inside dwells.
fn whiteness(runs: &[Left]) -> Test {
    let mut statistic = 0.0;
    let mut lags = 0.0;
    for lag in 1..=LAGS {
        let (mut product, mut squares, mut count) = (0.0, 0.0, 0.0);
        for (a, b) in runs.iter().flat_map(|run| run.pairs(lag)) {
            product += a * b;
            squares += 0.5 * (a * a + b * b);
            count += 1.0;
        }
        if count > 20.0 && squares > 0.0 {
            statistic += count * (product / squares).powi(2);
            lags += 1.0;
        }
    }
    let about = "autocorrelation of the seconds inside dwells, ten lags: chi-square";
    test("whiteness", about, statistic, chi_square_tail(statistic, lags))
}

/// Means of dwells against what white noise leaves them.
fn dwells(runs: &[Left]) -> Test {
    let (mut statistic, mut freedom) = (0.0, 0.0);
    for run in runs {
        let mut dwells = std::collections::BTreeMap::<usize, (f64, f64)>::new();
        for (_, dwell, z) in run.samples() {
            let (sum, count) = dwells.entry(dwell).or_default();
            *sum += z;
            *count += 1.0;
        }
        statistic += dwells.values().map(|(sum, count)| sum * sum / count).sum::<f64>();
        freedom += (dwells.len() as f64 - OWN_UNKNOWNS).max(0.0);
    }
    let p_value = if freedom > 0.0 { chi_square_tail(statistic, freedom) } else { 1.0 };
    test("dwells", "means of the dwells against their white noise: chi-square", statistic, p_value)
}

/// The closure of every run against its sigma: a part with cos 2θ, which no azimuth and no bias make.
fn closure(runs: &[Left]) -> Test {
    let (mut statistic, mut number) = (0.0, 0.0);
    for run in runs {
        let samples = &run.residual.run.samples;
        let column: Vec<f64> = samples.iter().map(|sample| sample.cos * sample.cos - sample.sin * sample.sin).collect();
        let weighted = run.residual.weighted(&column);
        let closure = run.residual.project(&weighted);
        let (seen, all) = (dot(&closure, &closure), dot(&weighted, &weighted));
        if seen > 1e-3 * all {
            statistic += dot(&closure, run.z).powi(2) / seen;
            number += 1.0;
        }
    }
    let p_value = if number > 0.0 { chi_square_tail(statistic, number) } else { 1.0 };
    test("closure", "closures of the runs against their sigmas: chi-square", statistic, p_value)
}

/// Whether what is left goes with a channel, in the runs that have it: its means in ten classes of the channel's values.
fn dependence(runs: &[Left], channel: &str, dispersion: f64) -> Test {
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for run in runs {
        let values = run.residual.run.channel(channel);
        pairs.extend(values.iter().flat_map(|values| run.samples().map(|(i, _, z)| (values[i], z))));
    }
    pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let classes = pairs.chunks(pairs.len().div_ceil(CLASSES).max(1));
    let mean_square = |class: &[(f64, f64)]| class.iter().map(|each| each.1).sum::<f64>().powi(2) / class.len() as f64;
    let number = classes.len() as f64;
    let statistic = classes.map(mean_square).sum::<f64>() / dispersion;
    let about = format!("means in ten classes of {channel}: chi-square");
    test(format!("dependence:{channel}"), about, statistic, chi_square_tail(statistic, number))
}

/// The highest peak of the periodogram: the mean power of R runs, times 2R, is a chi-square of 2R; the highest of many is corrected
/// for.
fn highest_peak(runs: &[Left]) -> Option<Test> {
    let data: Vec<&RunData> = runs.iter().map(|run| run.residual.run).collect();
    let of = |run: &Left| {
        let mut residual = vec![f64::NAN; run.residual.run.samples.len()];
        run.samples().for_each(|(i, _, z)| residual[i] = z);
        residual
    };
    let residuals = runs.iter().map(of).collect::<Vec<_>>();
    let powers = periodogram(&data, &residuals);
    let highest = powers.iter().map(|each| each.1).fold(0.0, f64::max);
    let twice = 2.0 * residuals.iter().filter(|residual| has_power(residual)).count() as f64;
    let p_value = (chi_square_tail(twice * highest, twice) * powers.len() as f64).min(1.0);
    let about = "highest power of the periodogram, white noise having 1 on average";
    (!powers.is_empty()).then(|| test("periodogram", about, highest, p_value))
}

/// Azimuths against their references (degrees), error, sigma and heading of each run: as large as their sigmas say, and
/// without a dependence on the heading.
pub fn azimuth_tests(errors: &[(f64, f64, f64)]) -> Vec<Test> {
    if errors.is_empty() {
        return Vec::new();
    }
    let number = errors.len() as f64;
    let statistic: f64 = errors.iter().map(|(error, sigma, _)| (error / sigma).powi(2)).sum();
    let about = "azimuths against their references in sigmas: chi-square";
    let mut tests = vec![test("azimuth", about, statistic, chi_square_tail(statistic, number))];
    let factors: [fn(f64) -> f64; 5] =
        [|_| 1.0, f64::cos, f64::sin, |heading| (2.0 * heading).cos(), |heading| (2.0 * heading).sin()];
    let column = |factor: fn(f64) -> f64| -> Vec<f64> {
        errors.iter().map(|(_, sigma, heading)| factor(heading.to_radians()) / sigma).collect()
    };
    let columns = factors.map(column);
    let y: Vec<f64> = errors.iter().map(|(error, sigma, _)| error / sigma).collect();
    let borrowed: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    if let Some((found, _)) = least_squares(&borrowed, &y) {
        let explained: f64 = columns.iter().zip(&found).map(|(column, c)| c * dot(column, &y)).sum();
        let about = "azimuth errors against the heading, two harmonics: chi-square";
        tests.push(test("heading", about, explained, chi_square_tail(explained, 5.0)));
    }
    tests
}

/// Frequencies and powers; white noise has a mean power of 1.
fn periodogram(runs: &[&RunData], residuals: &[Residual]) -> Vec<(f64, f64)> {
    let longest_s = runs.iter().filter_map(|run| run.samples.last()).map(|sample| sample.t_s).fold(0.0, f64::max);
    let step_s = runs.iter().filter_map(|run| run.samples.first()).map(|sample| sample.seconds).fold(0.0, f64::max);
    if !(longest_s > 0.0 && step_s > 0.0) {
        return Vec::new();
    }
    let count = ((0.5 * longest_s / step_s) as usize).clamp(1, FREQUENCIES);
    // Half the rate of the samples is left out: power there is that of cosines alone, a chi-square of one.
    let frequencies: Vec<f64> = (1..=count).map(|n| n as f64 * 0.5 / step_s / (count + 1) as f64).collect();
    let entering = runs.iter().copied().zip(residuals).filter(|(_, residual)| has_power(residual));
    let entering: Vec<(&RunData, &Residual)> = entering.collect();
    frequencies.par_iter().map(|&frequency| (frequency, power(&entering, frequency))).collect()
}

/// Whether a run has samples enough for a power.
fn has_power(residual: &Residual) -> bool {
    let entering = || residual.iter().filter(|value| value.is_finite());
    entering().count() > 8 && entering().any(|value| *value != 0.0)
}

/// Mean power at a frequency of runs that have one, 0 of none; white noise has 1.
fn power(runs: &[(&RunData, &Residual)], frequency: f64) -> f64 {
    let mut power = 0.0;
    for (run, residual) in runs {
        let (mut cos, mut sin, mut squares) = (0.0, 0.0, 0.0);
        for (sample, value) in run.samples.iter().zip(*residual).filter(|(_, value)| value.is_finite()) {
            let (s, c) = (TAU * frequency * sample.t_s).sin_cos();
            cos += c * value;
            sin += s * value;
            squares += value * value;
        }
        power += (cos * cos + sin * sin) / squares;
    }
    power / runs.len().max(1) as f64
}

/// Spectra for drawing.
pub fn spectra(runs: &[&RunData], before: &[Residual], after: &[Residual], white_deg_h: f64) -> Spectra {
    let (powers_before, powers_after) = (periodogram(runs, before), periodogram(runs, after));
    let step_s = runs.iter().filter_map(|run| run.samples.first()).map(|sample| sample.seconds).fold(0.0, f64::max);
    let longest = runs.iter().map(|run| run.samples.len()).max().unwrap_or(0);
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

/// Overlapping Allan deviation over `count` samples, from run to run (samples that do not enter are bridged).
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
